"""The examples in examples/python do what their first lines say."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import pty
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import yaml

import autodrive
from autodrive import Frame, ScenarioSpec, Simulation
from autodrive.base.transforms import euler_from_quaternion
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.graphics.cameras.jpeg import JpegEncoder, images_of
from autodrive.protocol.messages import Collision
from autodrive.scenario import VehiclePlacement, load_scenario
from autodrive.scenario.kinds import find
from autodrive.scenario.maps.map import load_map
from tests.support.command_line import call
from tests.support.lockstep import answered_ticks
from tests.support.waiting import free_port, is_listening, wait_until

EXAMPLES = Path(__file__).parents[3] / "examples" / "python"


@contextlib.contextmanager
def example(name: str, port: int, stdin: int = subprocess.DEVNULL) -> Iterator[None]:
    command = [sys.executable, str(EXAMPLES / name), str(port)]
    with subprocess.Popen(command, stdin=stdin, stdout=subprocess.DEVNULL) as process:
        try:
            wait_until(lambda: is_listening(port) or process.poll() is not None)
            assert process.poll() is None, f"{name} did not start"
            yield
        finally:
            process.kill()


def drive(name: str, scenario: str, duration: float) -> list[Frame]:
    """Frames of a drive of that simulated duration [s], in lock-step with ticks of 50 ms; nothing was hit."""
    port = free_port()
    world = autodrive.make(load_scenario(scenario).model_copy(update={"tick": 0.05}))
    with (
        example(name, port),
        Simulation(world, is_paused=True) as simulation,
        DevkitBridge(simulation, port=port) as bridge,
    ):
        frames = list(itertools.islice(answered_ticks(simulation, bridge), round(duration / 0.05)))
    assert not any(frame.events for frame in frames)
    return frames


@pytest.mark.process
@pytest.mark.slow
def test_the_waypoints_are_followed_within_the_lane() -> None:
    lanes = load_map("mini_map").lane_graph
    car = [frame.vehicles["V1"] for frame in drive("2_follow_waypoints.py", "mini_map", 25.0)]
    # lanes are 0.3 m wide, the car 0.175 m: within this offset its sides stay in the lane
    nearest = [lanes.nearest(*one.pose.position[:2]) for one in car]
    assert max(abs(one.offset) for one in nearest if one) < 0.0625
    assert sum(one.speed for one in car) * 0.05 > 8.5  # 0.8 of 0.44 m/s for 25 s are 8.8 m


@pytest.mark.process
@pytest.mark.slow
def test_the_lane_is_kept_by_the_front_camera(tmp_path: Path) -> None:
    """More than half a lap, with a crossroads; each tick of 50 ms waits for the reply to the previous one."""
    nigel = yaml.safe_load(find("vehicle", "nigel").read_text())
    nigel["cameras"] = {"front": nigel["cameras"]["front"] | {"rate": 10.0}}
    (tmp_path / "nigel.yaml").write_text(yaml.safe_dump(nigel))
    places = {"V1": VehiclePlacement(type=str(tmp_path / "nigel.yaml"), is_autonomous=True)}
    world = autodrive.make(ScenarioSpec(map="mini_map", vehicles=places, tick=0.05), cameras="software")
    lanes, way, port = load_map("mini_map").lane_graph, 0.0, free_port()
    images = partial(images_of, encoder=JpegEncoder())
    with (
        example("3_follow_lane.py", port),
        Simulation(world, is_paused=True) as simulation,
        DevkitBridge(simulation, port=port, images=images) as bridge,
    ):
        for frame in answered_ticks(simulation, bridge):
            car = frame.vehicles["V1"]
            way += 0.05 * float(car.velocity[0])
            nearest = lanes.nearest(*car.pose.position[:2])
            assert nearest
            assert abs(nearest.offset) < 0.0625  # as above
            assert frame.time < 30.0, "the car is too slow"
            if way > 6.5:
                break


@pytest.mark.process
def test_the_car_stops_before_the_box() -> None:
    car = drive("4_stop_before_box.py", "boxes", 6.0)[-1].vehicles["V1"]
    assert abs(car.speed) < 1e-3
    assert car.pose.position[0] > 0.3
    assert car.lights.headlights == 1


@pytest.mark.process
def test_the_script_for_boxes_finds_another_scenario() -> None:
    port = free_port()
    command = [sys.executable, str(EXAMPLES / "4_stop_before_box.py"), str(port)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_until(lambda: is_listening(port) or process.poll() is not None)
        with Simulation(autodrive.make("mini_map")) as simulation, DevkitBridge(simulation, port=port):
            _, error = process.communicate(timeout=60.0)
    assert process.returncode == 1
    assert f"Start the simulator with:  autodrive run boxes --devkit 127.0.0.1:{port}" in error


@pytest.mark.process
@pytest.mark.slow
def test_the_ten_lines_of_the_first_drive_complete_a_lap(tmp_path: Path) -> None:
    """In lock-step, with the track and the rules of docs/first_drive.md; the port is another."""
    text = (EXAMPLES.parents[1] / "docs" / "first_drive.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    port = free_port()
    (tmp_path / "first_lap.py").write_text(code.replace("drive(step, car)", f"drive(step, car, port={port})"))
    with subprocess.Popen([sys.executable, tmp_path / "first_lap.py"], stdout=subprocess.DEVNULL) as process:
        try:
            wait_until(lambda: is_listening(port))
            options = ["--devkit", f"127.0.0.1:{port}", "--lockstep", "--headless", "--laps", "1"]
            done = call("race", "practice", *options, cwd=tmp_path)
        finally:
            process.kill()
    assert done.returncode == 0, done.stderr
    (lap,) = re.findall(r"\| 1 \| \S+ \| ([\d.]+) \| 0 \|", done.stdout)  # no collision
    assert 26.0 < float(lap) < 30.0  # the page says about 28 s


@pytest.mark.process
@pytest.mark.slow
def test_the_car_parks_in_the_bay() -> None:
    car = drive("5_park.py", "mini_map", 17.0)[-1].vehicles["V1"]
    yaw = euler_from_quaternion(car.pose.orientation)[2]
    assert abs(car.speed) < 1e-3
    # the centre of the car is 7 cm ahead of its rear axle; the bay is 0.376 x 0.29 m, the car 0.32 x 0.18 m
    assert car.pose.position[0] + 0.07 * math.cos(yaw) == pytest.approx(0.511, abs=0.028)
    assert car.pose.position[1] == pytest.approx(-1.375, abs=0.04)
    assert abs(math.remainder(yaw - math.pi, 2.0 * math.pi)) < 0.06


def test_simulate_prints_the_summary_of_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(EXAMPLES / "6_simulate.py"))
    assert re.match(r"500 ticks, \d+ times real time\nV1: 0\.00 m, 0 collisions\n", capsys.readouterr().out)


@pytest.mark.process
def test_keys_of_a_terminal_drive_the_car() -> None:
    port = free_port()
    terminal, stdin = pty.openpty()
    simulation = Simulation(autodrive.make("plane"))
    with example("1_teleoperate.py", port, stdin=stdin), simulation, DevkitBridge(simulation, port=port) as bridge:
        wait_until(lambda: bridge.counters.commands_received)
        os.write(terminal, b"wwwal")
        wait_until(lambda: simulation.frame.vehicles["V1"].throttle == pytest.approx(0.6))
        wait_until(lambda: simulation.frame.vehicles["V1"].steering > 0.05)
        wait_until(lambda: simulation.frame.vehicles["V1"].lights.headlights == 1)
        os.write(terminal, b"x")
        wait_until(lambda: simulation.frame.vehicles["V1"].throttle == 0.0)


@pytest.mark.process
def test_four_cars_drive_through_the_crossing() -> None:
    """From places at different distances from the middle, to the arm opposite."""
    scenario, port = load_scenario("crossing"), free_port()
    cars, ways = {}, []
    for (name, car), distance in zip(scenario.vehicles.items(), (1.5, 1.7, 1.8, 1.4), strict=True):
        far = np.array([car.x, car.y])
        away = np.where(abs(far) > 1.0, np.sign(far), 0.0)  # from the middle, along the arm
        x, y = (far + (distance - far @ away) * away).tolist()
        cars[name] = car.model_copy(update={"x": x, "y": y})
        ways.append(-away)
    world = autodrive.make(scenario.model_copy(update={"tick": 0.05, "vehicles": cars}))
    with (
        example("8_crossing.py", port),
        Simulation(world, is_paused=True) as simulation,
        DevkitBridge(simulation, port=port) as bridge,
    ):
        frames = list(itertools.islice(answered_ticks(simulation, bridge), 300))
    assert not any(isinstance(event, Collision) for frame in frames for event in frame.events)
    for car, way in zip(frames[-1].vehicles.values(), ways, strict=True):
        assert car.pose.position[:2] @ way > 1.4
        assert abs(car.speed) < 1e-2
