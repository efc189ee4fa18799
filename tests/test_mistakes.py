"""Mistakes that people make in their first scripts, files and commands: each message says what would be right."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import autodrive
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import Server
from autodrive.experiments.policies import Policy
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.run import simulate
from tests.connect.client.conftest import bare
from tests.support.command_line import refused

COMMANDS = "such as {'V1': Command(throttle=0.5, steering=0.2)}, not "
SHAPE = "throttle and steering as numbers of the shape (2,), not "
CLOSED = "closed: make a new"
SCRIPTS = {
    # -- names ------------------------------------------------------------------------------------------------------
    "autodrive.Wrold": "Did you mean 'World'?",
    "Command(throtle=0.5)": "Known: throttle, steering, headlights, indicators. Did you mean 'throttle'?",
    "make(camera=True)": "Known: scenario, seed, cameras, engine. Did you mean 'cameras'?",
    "make('minimap')": "Did you mean 'mini_map'?",
    "make('Plane')": "Did you mean 'plane'?",
    "make('plane', engine='bullet')": "must be 'auto' or 'always'",
    "make('mini_map', cameras='ultra')": "Known: auto, software, software-fxaa, small, gpu",
    "autodrive.load_vehicle('niegl')": "Did you mean 'nigel'?",
    "autodrive.load_map('mini-map')": "Did you mean 'mini_map'?",
    "ScenarioSpec(vehicle={})": "Did you mean 'vehicles'?",
    "VehiclePlacement(yaw=90)": "Did you mean 'yaw_deg'?",
    "BatchWorld('plane', worlds=2)": "Known: scenario, n, seed, threads, engine.",
    "Client(addresses='127.0.0.1')": "Did you mean 'address'?",
    "gymnasium.make('NigelLaneKeeping-v0', frameskip=2)": "Did you mean 'frame_skip'?",
    "gymnasium.make('NigelLaneKeeping-v0', observation='camra')": "Known: state, lidar, camera. Did you mean 'camera'?",
    "gymnasium.make('RoboRacer-v0', track='practice')": "Did you mean 'tracks'?",
    "gymnasium.make('NigelLaneKeping-v0')": "Did you mean: `NigelLaneKeeping`?",
    "Policy.find('driver')": "Or give an .npz file",
    # -- readings ---------------------------------------------------------------------------------------------------
    "frame.vehicles['v1']": "Known: V1. Did you mean 'V1'?",
    "frame.vehicle['V1']": "Did you mean: 'vehicles'?",
    "car.velocty": "Did you mean: 'velocity'?",
    "car.lidar.range": "Did you mean: 'ranges'?",
    "car.cameras['front']": "autodrive.make(..., cameras=True)",
    "world.vehicles['V1']": "Did you mean: 'vehicle'?",
    "world.vehicle('v1')": "Known: V1. Did you mean 'V1'?",
    "world.vehicle('V1').wheel('left')": "Known: front_left, front_right, rear_left, rear_right.",
    "car.lidar.ranges[0] = 1.0": "assignment destination is read-only",
    "recording['V1/throtle']": "Did you mean 'V1/throttle'?",
    "open_recording('scenario.yaml')": "this is not an MCAP file",
    # -- commands ---------------------------------------------------------------------------------------------------
    "world.step(Command(0.5))": COMMANDS + "Command(",
    "world.step({'V1': (0.5, 0.0)})": COMMANDS + "(0.5, 0.0)",
    "world.step({'v1': Command()})": "Did you mean 'V1'?",
    "world.step({'V1': Command('fast')})": "must be a finite number in [-1, 1], not fast",
    "world.reset(poses={'V1': (0.0, 0.0)})": "must be x, y [m] and yaw [rad], not (0.0, 0.0)",
    "world.set_driving_mode('V1', 'manual')": "must be True or False, not 'manual'",
    "world.set_driving_mode(['V1'], True)": "vehicle '['V1']' is not in this world. Known: V1.",
    "world.restore(frame)": "needs a Snapshot, which save() returns, not Frame",
    "world.add_sensor('V1', 'radar', 3)": "an object with `rate`, `columns` and the function `sample(view, random)`",
    "Simulation(world).request('reset')": "must be an Operation, such as Reset(), not 'reset'",
    "BatchWorld('plane', 2).step(np.zeros((2, 2)))": "(worlds, vehicles, 2) = (2, 1, 2), not (2, 2)",
    "environment.step(np.zeros(3))": SHAPE + "float64 of the shape (3,)",
    "environment.step('left')": SHAPE,
    # -- another kind of thing --------------------------------------------------------------------------------------
    "make(3)": "a scenario must be a name, such as 'boxes', or the path of a YAML file, not 3",
    "make({'map': 'plane'})": "or the path of a YAML file, not {'map': 'plane'}",
    "ScenarioSpec(vehicles=['nigel'])": "must be 'key: value' entries",
    "Simulation('plane')": "a Simulation needs a World, such as autodrive.make('plane'), not 'plane'",
    "Recorder('drive.mcap', 'plane')": "a Recorder needs a World, such as autodrive.make('plane'), not 'plane'",
    "simulate('plane')": "simulate() needs RunOptions, such as RunOptions('plane'), not 'plane'",
    "Client(8730)": "use '127.0.0.1:8730' or the link that it prints",
    "Client('127.0.0.1:1', patience=0.0)": "start one with 'autodrive'",
    # -- after the end ----------------------------------------------------------------------------------------------
    "world = make('plane'); world.close(); world.step()": CLOSED,
    "world = make('plane'); world.close(); world.reset()": CLOSED,
    "batch = BatchWorld('plane'); batch.close(); batch.step(np.zeros((1, 1, 2)))": CLOSED,
    "batch = BatchWorld('plane'); batch.close(); batch.reset()": CLOSED,
    "environment.close(); environment.step(np.zeros(2))": CLOSED,
    "vector.close(); vector.step(np.zeros((2, 2)))": CLOSED,
    "client.close(); client.step()": "this Client was closed: make a new one",
}
"""Line of a script -> a part of what Python prints."""

FILES = {
    "vehicles:\n\tV1: {}": "invalid YAML (line 2): .*; indent with spaces, not with a tab",
    "boxes:\n  a:\n    x: 1\n   y: 2": "indent all keys of a mapping by the same number of spaces",
    "map:plane\nseed: 1": "(line 2): .*; write 'key: value', with a space after the colon",
    "vehicles: {V1: {type: my_car}}": "vehicle 'my_car' is not known. .* If you mean the file, write 'my_car.yaml'",
    "map: my_map": "map 'my_map' is not known. .* If you mean the file, write 'my_map.yaml'",
    "map: minimap": "Did you mean 'mini_map'?",
    "vehicle: {V1: {}}": "vehicle (line 1): .* Did you mean 'vehicles'?",
    "vehicles: {V1: {typ: nigel}}": "Did you mean 'type'?",
    "vehicles: {V1: {heading: 90}}": "Did you mean 'yaw_deg'?",
    "vehicles: {V1: {x: '1,5'}}": "must be a number, not '1,5'",
    "vehicles: [nigel]": "must be 'key: value' entries",
    "map: plane\nmap: mini_map": "map (line 2): duplicate key, first defined in line 1",
    "dt: 0.01": "Did you mean 'tick'?",
}
"""Scenario file -> a part of the message."""

COMMAND_LINES = {
    "run minimap": "Did you mean 'mini_map'?",
    "show niegl": "Did you mean 'nigel'?",
    "run scenario.yml": "file 'scenario.yml' does not exist",
}
"""Command of `autodrive` -> a part of the message."""


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """What the scripts use."""
    public = {name: getattr(autodrive, name) for name in autodrive.__all__}
    world = autodrive.make("plane")
    path = tmp_path_factory.mktemp("mistakes") / "run.mcap"
    with Recorder(path, world, has_meshes=False):
        frame = world.step()
    environment = gymnasium.make("NigelLaneKeeping-v0")
    environment.reset(seed=0)
    vector = gymnasium.make_vec("NigelLaneKeeping-v0", num_envs=2)
    vector.reset(seed=0)
    served = Served(autodrive.Simulation(autodrive.make("plane"), is_paused=True), bare)
    with open_recording(path) as recording, Server(served, PageOptions(port=0)) as server:
        yield {
            **public,
            "autodrive": autodrive,
            "gymnasium": gymnasium,
            "np": np,
            "Policy": Policy,
            "Recorder": Recorder,
            "open_recording": open_recording,
            "simulate": simulate,
            "world": world,
            "frame": frame,
            "car": frame.vehicles["V1"],
            "recording": recording,
            "environment": environment,
            "vector": vector,
            "client": autodrive.Client(server.url),
        }


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder, with files of the user."""
    monkeypatch.chdir(tmp_path)
    for name in ("my_car", "my_map", "scenario"):
        Path(f"{name}.yaml").write_text("title: Mine\n")


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_mistake_in_a_script(names: dict[str, Any], script: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(Exception) as caught:  # noqa: PT011  the text is compared below
        exec(script, names)
    capsys.readouterr()
    sys.__excepthook__(caught.type, caught.value, None)  # as Python prints it, with its own suggestions
    assert SCRIPTS[script] in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("text", FILES)
def test_a_mistake_in_a_file(text: str) -> None:
    Path("scenario.yaml").write_text(f"{text}\n")
    with pytest.raises(autodrive.SpecError) as caught:
        autodrive.make("scenario.yaml")
    pattern = re.escape(FILES[text]).replace(r"\.\*", ".*")
    assert re.search(pattern, str(caught.value)), str(caught.value)


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_a_mistake_in_a_command(line: str) -> None:
    assert COMMAND_LINES[line] in refused(*line.split())
