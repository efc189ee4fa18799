"""The examples of the Python devkit drive the simulator as they say."""

from __future__ import annotations

import contextlib
import math
import os
import pty
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
import yaml

import autodrive
from autodrive import Frame, ScenarioSpec, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.descriptions import find
from autodrive.jpeg import JpegEncoder, images_of
from autodrive.maps import load_map
from autodrive.protocol.messages import Event, Step
from autodrive.scenario import VehiclePlacement
from autodrive.transforms import euler_from_quaternion
from tests.bridge.conftest import eventually, free_port, is_listening

EXAMPLES = Path(__file__).parents[2] / "examples" / "python"


class Recorder:
    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def publish(self, frame: Frame) -> None:
        self.frames.append(frame)

    @property
    def events(self) -> list[Event]:
        return [event for frame in self.frames for event in frame.events]


@contextlib.contextmanager
def example(name: str, port: int, stdin: int = subprocess.DEVNULL) -> Iterator[None]:
    command = [sys.executable, str(EXAMPLES / name), str(port)]
    with subprocess.Popen(command, stdin=stdin, stdout=subprocess.DEVNULL) as process:
        try:
            eventually(lambda: is_listening(port) or process.poll() is not None)
            assert process.poll() is None, f"{name} did not start"
            yield
        finally:
            process.kill()


def drive(name: str, scenario: str, duration: float) -> Recorder:
    """What happened in so many simulated seconds, at twice real time."""
    port, recorder = free_port(), Recorder()
    simulation = Simulation(autodrive.make(scenario), speed=2.0)
    simulation.add_sink(recorder)
    with example(name, port), DevkitBridge(simulation, port=port):
        simulation.run(duration)
    return recorder


def test_the_waypoints_are_followed_within_the_lane() -> None:
    recorder = drive("2_follow_waypoints.py", "mini_map", 25.0)
    lanes = load_map("mini_map").lane_graph
    car = [frame.vehicles["V1"] for frame in recorder.frames]
    # lanes are 0.3 m wide, the car 0.175 m: so far from the centre line its sides stay in the lane
    nearest = [lanes.nearest(*one.pose.position[:2]) for one in car[::20]]
    assert max(abs(one.offset) for one in nearest if one) < 0.0625
    assert sum(abs(one.speed) for one in car) * 0.01 > 6.0
    assert not recorder.events


def test_the_lane_is_kept_by_the_front_camera(tmp_path: Path) -> None:
    """More than half a lap, with a crossroads; each tick of 50 ms waits for the script's answer to the one before."""
    nigel = yaml.safe_load(find("vehicle", "nigel").read_text())
    nigel["cameras"] = {"front": nigel["cameras"]["front"] | {"rate": 10.0}}
    (tmp_path / "nigel.yaml").write_text(yaml.safe_dump(nigel))
    places = {"V1": VehiclePlacement(type=str(tmp_path / "nigel.yaml"), is_autonomous=True)}
    simulation = Simulation(
        autodrive.make(ScenarioSpec(map="mini_map", vehicles=places, tick=0.05), cameras="software"), is_paused=True
    )
    lanes, way, port = load_map("mini_map").lane_graph, 0.0, free_port()
    images = partial(images_of, encoder=JpegEncoder())
    with example("3_follow_lane.py", port), simulation, DevkitBridge(simulation, port=port, images=images) as bridge:
        eventually(lambda: bridge.counters.commands_received)
        while way < 6.5:
            answered = bridge.counters.commands_received
            frame = simulation.request(Step()).result()
            eventually(lambda answered=answered: bridge.counters.commands_received > answered)
            car = frame.vehicles["V1"]
            way += 0.05 * float(car.velocity[0])
            nearest = lanes.nearest(*car.pose.position[:2])
            assert nearest
            assert abs(nearest.offset) < 0.0625  # as above
            assert frame.time < 40.0, "it does not get on"


def test_the_car_stops_before_the_box() -> None:
    recorder = drive("4_stop_before_box.py", "boxes", 6.0)
    car = recorder.frames[-1].vehicles["V1"]
    assert abs(car.speed) < 1e-3
    assert car.pose.position[0] > 0.3
    assert car.lights.headlights == 1
    assert not recorder.events


def test_the_car_parks_in_the_bay() -> None:
    recorder = drive("5_park.py", "mini_map", 17.0)
    car = recorder.frames[-1].vehicles["V1"]
    yaw = euler_from_quaternion(car.pose.orientation)[2]
    assert abs(car.speed) < 1e-3
    # the middle of the car is 7 cm ahead of its rear axle; the bay is 0.376 x 0.29 m, the car 0.32 x 0.18 m
    assert car.pose.position[0] + 0.07 * math.cos(yaw) == pytest.approx(0.511, abs=0.028)
    assert car.pose.position[1] == pytest.approx(-1.375, abs=0.04)
    assert abs(math.remainder(yaw - math.pi, 2.0 * math.pi)) < 0.06
    assert not recorder.events


def test_keys_of_a_terminal_drive_the_car() -> None:
    port = free_port()
    ours, its = pty.openpty()
    simulation = Simulation(autodrive.make("plane"))
    with example("1_teleoperate.py", port, stdin=its), simulation, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received)
        os.write(ours, b"wwwal")
        eventually(lambda: simulation.frame.vehicles["V1"].throttle == pytest.approx(0.6))
        eventually(lambda: simulation.frame.vehicles["V1"].steering > 0.05)
        eventually(lambda: simulation.frame.vehicles["V1"].lights.headlights == 1)
        os.write(ours, b"x")
        eventually(lambda: simulation.frame.vehicles["V1"].throttle == 0.0)
