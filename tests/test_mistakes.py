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
from autodrive import BatchWorld
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.experiments.policies import Policy
from autodrive.recording import Recorder
from autodrive.recording import open as open_recording
from autodrive.run import RunOptions, simulate
from autodrive.run.race import RaceOptions
from autodrive.scenario.kinds import names as vehicles
from autodrive.scenario.tracks.track import Track
from tests.connect.client.conftest import bare
from tests.support.cars import car_file
from tests.support.command_line import call, refused

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
    "gymnasium.make('RoboRacer-v0', trak='practice')": "Did you mean 'track'?",
    "gymnasium.make('NigelLaneKeping-v0')": "Did you mean: `NigelLaneKeeping`?",
    "Policy.find('driver')": "Or give an .npz file",
    "make('figure_eight')": "'figure_eight' is a map; a scenario there has the line 'map: figure_eight', in Python "
    "ScenarioSpec(map='figure_eight')",
    "make('roboracer')": "is a vehicle; a scenario with it has the line 'vehicles: {V1: {type: roboracer}}'",
    "make('tiny_town.yaml')": "If you mean the scenario of this package, write 'tiny_town'",
    "make(map='plane')": "Known: scenario, seed, cameras, engine.",
    "autodrive.load_vehicle('tiny_town')": "dart, f1tenth_mocap, neoracer, nigel, nigel_2020, nigel_2023, nuc1, nuc2, "
    "roboracer, roboracer_f1tenth, roboracer_physical. 'tiny_town' is a map",
    "RunOptions(durations=3)": "Did you mean 'duration'?",
    "RaceOptions('practice', lap=3)": "Did you mean 'laps'?",
    "simulate(scenario='plane')": "Known: options, stop, observer.",
    "ScenarioSpec(time_of_day=18.3)": "write HH:MM, such as 18:30",
    "ScenarioSpec(vehicles={1: {}})": "must be a text, not 1; put it in quotes",
    # -- readings ---------------------------------------------------------------------------------------------------
    "frame.vehicles['v1']": "Known: V1. Did you mean 'V1'?",
    "frame.vehicle['V1']": "Did you mean 'vehicles'?",
    "car.velocty": "Did you mean 'velocity'?",
    "car.lidar.range": "Did you mean 'ranges'?",
    "car.pose.x": "Known: orientation, position",
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
    "Client(8730)": "use '127.0.0.1:8730' or the link that the simulator prints",
    "Client('127.0.0.1:1', patience=0.0)": "start a simulator with 'autodrive'",
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
    "time_of_day: 18.30": "18.3 would be 18.3 seconds after midnight: write HH:MM, such as 18:30",
    "time_of_day: '18,30'": "such as 18:30, not '18,30'",
    "time_of_day: 6pm": "such as 18:30, not '6pm'",
    "vehicles:\n  V1:\n    x: 0,5": "write 0.5, with a decimal point",
    "vehicles: {V1: {x: 0,5}}": "If '5' belongs to a decimal number, write a point: 0.5",
    "vehicles: {V1: {yaw_deg: 90°}}": "write a number without '°'",
    "boxes: {a: {x: 1, y: 0, mass: 200g}}": "write a number without 'g', in the unit",
    "vehicles: {V1: {type:nigel}}": "write 'type: nigel', with a space after the colon",
    "vehicles: {V1: nigel}": "must be 'key: value' entries, not 'nigel'. Known: .*, type, x, y, yaw_deg.",
    "vehicles: {V1: {x: 010}}": "(line 1): '010' would be an octal number: write 10",
    "vehicles: {1: {}}": "a name is letters, digits and '_', such as V1 or box_1, not '1'",
    "title: no": "must be a text, not False; put it in quotes (YAML reads yes, no, on and off as true and false)",
    "title: 1": "must be a text, not 1; put it in quotes",
    "map: tiny_town.yml": "file 'tiny_town.yml' does not exist. If you mean the map of this package, write 'tiny_town'",
    "map: nigel": "'nigel' is a vehicle.",
    "weather: rain": "rain: 0.6 in a file, rain=0.6 in a command",
    "weather: {rain: 60}": "must be at most 1, not 60",
    "race: practice": "must be 'key: value' entries, not 'practice'. Known: laps, rules, track.",
    "": "expected 'key: value' lines (ScenarioSpec), found nothing",
}
"""Scenario file -> a part of the message."""

COMMAND_LINES = {
    "run minimap": "Did you mean 'mini_map'?",
    "show niegl": "Did you mean 'nigel'?",
    "run scenario.yml": "file 'scenario.yml' does not exist",
    "run tiny_town.yaml": "If you mean the scenario of this package, write 'tiny_town'",
    "show figure_eight.yaml": "If you mean the map of this package, write 'figure_eight'",
    "run oval": "'oval' is a map; a scenario there has the line 'map: oval'",
    "race mini_map": "track 'mini_map' is not known. Known: cdc_tf_2025, fast, practice, technical. 'mini_map' is a",
    "race practice.yaml": "If you mean the track of this package, write 'practice'",
    "play race tiny_town": "'tiny_town' is a map.",
    "run --weather rain=0,6": "write rain=0.6, with a decimal point",
    "run --weather rain": "rain=0.6 in a command",
    "run --weather time=18.30": "write HH:MM, such as 18:30",
    "weather heavy-rain": "Did you mean 'heavy_rain'?",
    "run --duration 0,5": "must be a number such as 0.5",
    "run --speed 0,5": "a number from 1e-06 to 1e+06 or max, not '0,5'",
    "generate track --area 30,10": "--area must be AxB such as 30x10, not '30,10'",
    "new car mine": "'vehicle', 'map', 'scenario', 'driver'",
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
    with open_recording(path) as recording, SimulationServer(served, PageOptions(port=0)) as server:
        yield {
            **public,
            "autodrive": autodrive,
            "gymnasium": gymnasium,
            "np": np,
            "Policy": Policy,
            "Recorder": Recorder,
            "open_recording": open_recording,
            "simulate": simulate,
            "RunOptions": RunOptions,
            "RaceOptions": RaceOptions,
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


SILENT = {
    "traffic: {speed: 5}": "traffic (line 1): without 'cars' there is no traffic; write for example cars: 5",
    "map: oval\ntraffic: {cars: 1, speed: 5}": "traffic.speed (line 2): cars of the type 'nigel' drive at most "
    "0.442 m/s, not 5 m/s",
}
"""Scenario file that can run -> a part of the warning."""


@pytest.mark.parametrize("text", SILENT)
def test_a_mistake_that_changes_a_run_is_a_warning(text: str) -> None:
    Path("scenario.yaml").write_text(f"{text}\n")
    with pytest.warns(UserWarning, match=re.escape(SILENT[text])):
        autodrive.make("scenario.yaml")
    assert SILENT[text] in call("check", "scenario.yaml").stderr


def test_a_name_or_an_end_of_a_file_may_look_like_another_type() -> None:
    """YAML 1.1 reads the name no as a truth value."""
    Path("mine.YML").write_text("vehicles: {no: {}, V2: {x: 1}}\n")
    assert list(autodrive.make("mine.YML").frame.vehicles) == ["no", "V2"]
    assert call("check", "mine.YML").returncode == 0


@pytest.mark.parametrize(
    ("mass", "inertia", "is_wrong"),
    [(1.75, 1.0, True), (14.0, 1.0, True), (14.0, 32.0, False), (1.75, 4.0, False), (1.75, 20.0, True)],
)
def test_a_scaled_vehicle_whose_inertia_was_forgotten_is_told_so(
    mass: float, inertia: float, is_wrong: bool, tmp_path: Path
) -> None:
    """Twice the size, so 8 times the mass and 32 times the inertia; a solid box has m (b^2 + c^2) / 12."""
    moments = [inertia * moment for moment in (0.009297, 0.017956, 0.017591)]
    changes = {"size": [0.6, 0.35, 0.364], "body.mass": mass, "body.inertia": moments}
    said = call("check", car_file(tmp_path, changes)).stderr
    assert ("'inertia' of" in said) == is_wrong, said
    if is_wrong:
        box = [mass * (b * b + c * c) / 12.0 for b, c in ((0.35, 0.364), (0.6, 0.364), (0.6, 0.35))]
        assert f"[{', '.join(f'{moment:.3g}' for moment in box)}] kg m^2" in said


@pytest.mark.parametrize("name", vehicles("vehicle"))
def test_the_inertia_of_each_vehicle_of_the_package_is_likely(name: str) -> None:
    assert "inertia" not in call("check", name, "--kind", "vehicle").stderr


def test_objects_with_large_arrays_have_a_short_text() -> None:
    track, readings = Track.load("practice"), BatchWorld("plane", 3).readings
    assert repr(track) == "<Track 'practice' of 71.9 m: 1.20 to 1.20 m wide, 2 walls, a race line>"
    assert repr(readings) == "<Readings of 3 worlds at 0 to 0 s: 1 vehicles, 0 movable objects>"


@pytest.mark.parametrize("line", COMMAND_LINES)
def test_a_mistake_in_a_command(line: str) -> None:
    assert COMMAND_LINES[line] in refused(*line.split())
