"""Users' scripts, with the libraries that the devkits pin ('legacy') and the newest, against the real simulation."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Frame, ScenarioSpec, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.engineio import Dialect
from autodrive.descriptions import find
from autodrive.jpeg import JpegEncoder, images_of
from autodrive.maps import LaneGraph, load_map
from autodrive.protocol.devkit import PROFILES, introduction, telemetry
from autodrive.protocol.messages import Step
from autodrive.scenario import VehiclePlacement
from autodrive.world import World
from tests.bridge.conftest import PATIENCE, ROOT, eventually, free_port, python_of, script
from tests.protocol.devkit_frames import frame, scan, vehicle

FOLLOW_LOOP = ROOT / "examples" / "devkit" / "follow_loop.py"
FOLLOW_LANE = ROOT / "examples" / "devkit" / "follow_lane.py"
SLOW = Path(__file__).parent / "servers" / "slow.py"
READ_TELEMETRY = Path(__file__).parent / "servers" / "read_telemetry.py"
STACKS = {"legacy": Dialect.ENGINE_IO_3, "newest": Dialect.ENGINE_IO_4}


@pytest.fixture(scope="module")
def lanes() -> LaneGraph:
    return load_map("mini_map").lane_graph


@pytest.fixture(scope="module")
def town(one_world: World) -> World:
    """After the other world, with which everything was compiled."""
    return autodrive.make(ScenarioSpec(map="mini_map"))


class Drive:
    """Where the car was, at every tick."""

    def __init__(self) -> None:
        self.positions: list[tuple[float, float]] = []
        self.throttles: list[float] = []

    def publish(self, frame: Frame) -> None:
        car = frame.vehicles["V1"]
        self.positions.append((float(car.pose.position[0]), float(car.pose.position[1])))
        self.throttles.append(car.throttle)

    @property
    def distance(self) -> float:
        return float(np.hypot(*np.diff(self.positions, axis=0).T).sum())


@pytest.mark.parametrize(
    ("stack", "year", "duration"), [("legacy", "2023", 120.0), ("newest", "2025", 40.0), ("legacy", "2020", 30.0)]
)
def test_a_script_follows_the_loop_of_the_mini_map(
    town: World, lanes: LaneGraph, stack: str, year: str, duration: float
) -> None:
    """At three times real time, so that it takes less than a minute."""
    town.reset(0)
    port, drive = free_port(), Drive()
    simulation = Simulation(town, speed=3.0)
    simulation.add_sink(drive)
    with script(stack, FOLLOW_LOOP, "--era", year, port=port), DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received)
        simulation.run(duration)
        counters = bridge.counters
    assert (counters.dialect, counters.profile) == (STACKS[stack], year)
    assert counters.connections == 1
    assert counters.refused_values == counters.bad_packets == 0
    # a command counts for 0.5 s of simulated time, then the brakes go on; 1 % is for what else the machine does
    assert np.mean(np.array(drive.throttles[100:]) < 1.0) < 0.01
    loop = lanes.length(lanes.loop(lanes.nearest(0.0, 0.0, 0.0).lane))  # pyright: ignore
    assert drive.distance > duration / 120.0 * 3.0 * loop
    # lanes are 0.3 m wide, the car 0.175 m: so far from the centre line its sides stay in the lane
    assert max(abs(lanes.nearest(x, y).offset) for x, y in drive.positions[::50]) < 0.0625  # pyright: ignore


def round_outer_lane(x: float, y: float) -> float:
    """How far a place is outside the right-hand lane around the mini-map [m]: curves of 0.85 m about four corners."""
    across, along = abs(x - 0.7) - 1.0, abs(y - 1.55) - 0.7
    return math.hypot(max(across, 0.0), max(along, 0.0)) + min(max(across, along), 0.0) - 0.85


def test_a_script_keeps_the_lane_around_the_mini_map_by_its_front_camera(tmp_path: Path) -> None:
    """Two laps, straight on over the crossroads; ten pictures a second, drawn in the tick.

    Each tick of 50 ms waits for the script's answer to the one before, so that a busy machine drives just the same.
    """
    file = tmp_path / "nigel.yaml"
    file.write_text(find("vehicle", "nigel").read_text().replace("rate: 30.0", "rate: 10.0"))
    places = {"V1": VehiclePlacement(type=str(file), is_autonomous=True)}
    world = autodrive.make(ScenarioSpec(map="mini_map", vehicles=places, tick=0.05), cameras="software")
    lap = 4.0 + 2.8 + 2.0 * math.pi * 0.85
    port, drive = free_port(), Drive()
    simulation = Simulation(world, is_paused=True)
    simulation.add_sink(drive)
    images = partial(images_of, encoder=JpegEncoder())
    with (
        simulation,
        script("newest", FOLLOW_LANE, port=port),
        DevkitBridge(simulation, port=port, images=images) as bridge,
    ):
        eventually(lambda: bridge.counters.commands_received)
        for number in range(1, 3001):
            answered = bridge.counters.commands_received
            simulation.request(Step()).result()
            eventually(lambda answered=answered: bridge.counters.commands_received > answered)
            assert abs(round_outer_lane(*drive.positions[-1])) < 0.0625
            if number % 100 == 0 and drive.distance > 2.0 * lap:
                break
        counters = bridge.counters
    assert drive.distance > 2.0 * lap
    assert counters.connections == 1
    assert counters.refused_values == counters.bad_packets == 0


def test_the_way_points_of_the_example_lie_on_the_lane(lanes: LaneGraph) -> None:
    route = np.loadtxt(FOLLOW_LOOP.with_name("mini_map_loop.csv"), delimiter=",")
    assert max(abs(lanes.nearest(x, y).offset) for x, y in route) < 0.002  # chords of 5 cm, three decimals  # pyright: ignore
    assert np.hypot(*(route - np.roll(route, 1, axis=0)).T).max() < 0.06


@pytest.mark.parametrize("stack", STACKS)
def test_a_script_may_start_late_and_be_killed_and_start_again(simulation: Simulation, stack: str) -> None:
    port = free_port()

    def speed() -> float:
        return simulation.frame.vehicles["V1"].speed

    with DevkitBridge(simulation, port=port) as bridge:
        with script(stack, FOLLOW_LOOP, port=port):
            eventually(lambda: speed() > 0.1)
        eventually(lambda: bridge.status == "connecting" and abs(speed()) < 0.01)
        with script(stack, FOLLOW_LOOP, port=port):
            eventually(lambda: speed() > 0.1)
        assert bridge.counters.reconnects == 1


@contextlib.contextmanager
def slow_script(stack: str, port: int, lines: Path) -> Iterator[None]:
    """Thinks for 50 ms; what it does is written to a file."""
    command = [python_of(stack), SLOW, "--port", str(port), "--think", "0.05"]
    with lines.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


@pytest.mark.parametrize("stack", STACKS)
def test_two_simulators_at_one_slow_script_pile_up_nothing(simulation: Simulation, stack: str, tmp_path: Path) -> None:
    """Its replies go to both. If each answered each of them, twice as many would come as the script reads."""
    port, lines = free_port(), tmp_path / "lines"
    other = Simulation(autodrive.make("plane"))
    with (
        slow_script(stack, port, lines),
        other,
        DevkitBridge(simulation, port=port) as first,
        DevkitBridge(other, port=port) as second,
    ):
        eventually(lambda: first.counters.commands_received and second.counters.commands_received)
        time.sleep(8.0 if stack == "legacy" else 4.5)  # Engine.IO 3 and 4 here wait 6 s and 3 s for a sign of life
        sent = first.counters.telemetry_sent + second.counters.telemetry_sent
        read = lines.read_text().split().count("telemetry")
        assert first.counters.reconnects == second.counters.reconnects == 0
        assert "disconnect" not in lines.read_text()
        for driven in (simulation, other):
            assert driven.frame.vehicles["V1"].throttle == 1.0
    assert read > 10
    assert sent - read <= 6  # two each, and those that pass between the two looks


def test_each_vehicle_obeys_its_own_keys(tmp_path: Path) -> None:
    places = {name: VehiclePlacement(y=y) for name, y in (("red", 0.0), ("green", 1.0))}
    simulation = Simulation(autodrive.make(ScenarioSpec(vehicles=places)))
    port = free_port()
    with slow_script("newest", port, tmp_path / "lines"), simulation, DevkitBridge(simulation, port=port):
        eventually(lambda: simulation.frame.vehicles["red"].speed > 0.1)  # the script speaks of V1 only
        assert simulation.frame.vehicles["green"].throttle == 0.0


# -- the parsers of the devkits ----------------------------------------------------------------------------------


def read_by(stack: str, cases: list[tuple[str, dict[str, str]]]) -> list[dict[str, object]]:
    """What the scripts of those years read in those telemetries, with the libraries of that stack."""
    text = json.dumps([{"year": year, "data": data} for year, data in cases])
    command = [str(python_of(stack)), str(READ_TELEMETRY)]
    done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("stack", STACKS)
def test_scripts_of_all_years_read_their_telemetry(stack: str) -> None:
    ranges = [math.inf, 1.0, 2.5] * 120
    told = frame(vehicle(lidar=scan(ranges, 0.0)))
    for year, data in zip(
        PROFILES, read_by(stack, [(y, telemetry(told, p)) for y, p in PROFILES.items()]), strict=True
    ):
        assert data["LIDAR Range Array"] == ranges
        assert data["Encoder Ticks"] == [1920, -7]
        assert data["Throttle"] == 0.5
        assert data["Orientation Quaternion"] == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], abs=5e-4)
        assert data["Front Camera Image"] == data["Rear Camera Image"] == [[720, 1280, 3], 0, 0], year


@pytest.mark.parametrize("stack", STACKS)
def test_scripts_of_all_years_read_the_first_message_though_nobody_knows_their_year(stack: str) -> None:
    for data in read_by(stack, [(year, introduction(frame())) for year in PROFILES]):
        assert data["Position"][2] == pytest.approx(0.0325, abs=0.02)  # type: ignore[index]  # 2020: the body's centre


@pytest.mark.parametrize("stack", STACKS)
def test_scripts_of_all_years_read_telemetry_before_the_first_scan(stack: str) -> None:
    cases = [(year, telemetry(frame(vehicle(lidar=None)), profile)) for year, profile in PROFILES.items()]
    assert [data["LIDAR Range Array"] for data in read_by(stack, cases)] == [[]] * 4
