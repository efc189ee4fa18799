"""Devkit scripts with the pinned ('legacy') and the newest server libraries against a real simulation."""

from __future__ import annotations

import contextlib
import json
import math
import subprocess
import time
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Frame, ScenarioSpec, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.engineio import Dialect
from autodrive.graphics.cameras.jpeg import JpegEncoder, images_of
from autodrive.protocol.devkit import initial_telemetry, telemetry
from autodrive.protocol.devkit_profile import PROFILES
from autodrive.scenario import VehiclePlacement
from autodrive.scenario.kinds import find
from autodrive.scenario.maps.lanes import LaneGraph
from autodrive.scenario.maps.map import load_map
from tests.connect.bridge.conftest import ROOT, Resets, peer, python_of, script
from tests.connect.bridge.servers.matlab_toolbox import MatlabToolbox
from tests.protocol.devkit_frames import frame, scan, vehicle
from tests.support.lockstep import answered_ticks
from tests.support.waiting import LIMIT, free_port, is_listening, wait_until

FOLLOW_LOOP = ROOT / "examples" / "devkit" / "follow_loop.py"
FOLLOW_LANE = ROOT / "examples" / "devkit" / "follow_lane.py"
SLOW = Path(__file__).parent / "servers" / "slow.py"
LEAGUE = Path(__file__).parent / "servers" / "league.py"
AALTO = Path(__file__).parent / "servers" / "aalto.py"
NEORACER = Path(__file__).parent / "servers" / "neoracer.py"
READ_TELEMETRY = Path(__file__).parent / "servers" / "read_telemetry.py"
SMALL_IMAGES = {("V1", side): (64, 48) for side in ("front", "rear")}
"""Eventlet unmasks messages byte by byte in Python, and the script decodes them."""
STACKS = {"legacy": Dialect.ENGINE_IO_3, "newest": Dialect.ENGINE_IO_4}


@pytest.fixture(scope="module")
def lanes() -> LaneGraph:
    return load_map("mini_map").lane_graph


class Drive:
    """Sink: position and throttle of the car at every tick."""

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
    ("stack", "year", "duration"), [("legacy", "2023", 20.0), ("newest", "2025", 10.0), ("legacy", "2020", 10.0)]
)
@pytest.mark.slow
@pytest.mark.toolchain
def test_a_script_follows_the_loop_of_the_mini_map(lanes: LaneGraph, stack: str, year: str, duration: float) -> None:
    """With each real server library, in ticks of 50 ms"""
    port, drive = free_port(), Drive()
    simulation = Simulation(autodrive.make(ScenarioSpec(map="mini_map", tick=0.05)), is_paused=True)
    simulation.add_sink(drive)
    with (
        simulation,
        script(stack, FOLLOW_LOOP, "--generation", year, port=port),
        DevkitBridge(simulation, port=port, image_sizes=lambda: SMALL_IMAGES) as bridge,
    ):
        for _ in islice(answered_ticks(simulation, bridge), round(duration / 0.05)):
            pass
        counters = bridge.counters
    assert (counters.dialect, counters.profile) == (STACKS[stack], year)
    assert counters.connections == 1
    assert counters.refused_values == counters.bad_packets == 0
    assert min(drive.throttles[10:]) == 1.0  # no tick without a command: it would brake
    loop = lanes.length(lanes.loop(lanes.nearest(0.0, 0.0, 0.0).lane))  # pyright: ignore
    assert drive.distance > duration / 120.0 * 3.0 * loop
    # lanes are 0.3 m wide, the car 0.175 m: within this offset its sides stay in the lane
    assert max(abs(lanes.nearest(x, y).offset) for x, y in drive.positions[::10]) < 0.0625  # pyright: ignore


def round_outer_lane(x: float, y: float) -> float:
    """Offset of a point from the right-hand lane around the mini-map [m]: curves of 0.85 m radius at four corners."""
    across, along = abs(x - 0.7) - 1.0, abs(y - 1.55) - 0.7
    return math.hypot(max(across, 0.0), max(along, 0.0)) + min(max(across, along), 0.0) - 0.85


@pytest.mark.slow
@pytest.mark.toolchain
def test_a_script_keeps_the_lane_with_its_front_camera(tmp_path: Path) -> None:
    """Into a curve; ten images per simulated second, rendered in the tick.

    The rear image, which the script does not use, is small: Eventlet unmasks messages byte by byte in Python.
    """
    front, rear = find("vehicle", "nigel").read_text().replace("rate: 30.0", "rate: 10.0").split("  rear:\n    mount")
    file = tmp_path / "nigel.yaml"
    file.write_text(f"{front}  rear:\n    mount{rear.replace('640', '64').replace('480', '48')}")
    places = {"V1": VehiclePlacement(type=str(file), x=0.7, is_autonomous=True)}  # the curve begins at 1.7 m
    world = autodrive.make(ScenarioSpec(map="mini_map", vehicles=places, tick=0.1), cameras="software")
    way = 1.0 + 0.7  # half of the curve: a car that did not steer would leave the lane after 0.33 m of it
    port, drive = free_port(), Drive()
    simulation = Simulation(world, is_paused=True)
    simulation.add_sink(drive)
    images = partial(images_of, encoder=JpegEncoder())
    with (
        simulation,
        script("newest", FOLLOW_LANE, port=port),
        DevkitBridge(simulation, port=port, images=images) as bridge,
    ):
        for number, _ in zip(range(1, 1001), answered_ticks(simulation, bridge), strict=False):
            assert abs(round_outer_lane(*drive.positions[-1])) < 0.0625
            if number % 10 == 0 and drive.distance > way:
                break
        counters = bridge.counters
    assert drive.distance > way
    assert counters.connections == 1
    assert counters.refused_values == counters.bad_packets == 0


def test_the_waypoints_of_the_example_lie_on_the_lane(lanes: LaneGraph) -> None:
    route = np.loadtxt(FOLLOW_LOOP.with_name("mini_map_loop.csv"), delimiter=",")
    assert max(abs(lanes.nearest(x, y).offset) for x, y in route) < 0.002  # chords of 5 cm, three decimals  # pyright: ignore
    assert np.hypot(*(route - np.roll(route, 1, axis=0)).T).max() < 0.06


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_a_script_may_start_late_and_be_killed_and_start_again(simulation: Simulation, stack: str) -> None:
    port = free_port()

    def speed() -> float:
        return simulation.frame.vehicles["V1"].speed

    with DevkitBridge(simulation, port=port) as bridge:
        with script(stack, FOLLOW_LOOP, port=port):
            wait_until(lambda: speed() > 0.1)
        wait_until(lambda: bridge.status == "connecting" and abs(speed()) < 0.01)
        with script(stack, FOLLOW_LOOP, port=port):
            wait_until(lambda: speed() > 0.1)
        assert bridge.counters.reconnects == 1


@contextlib.contextmanager
def slow_script(stack: str, port: int, lines: Path) -> Iterator[None]:
    """A script that needs 50 ms for each message and writes its events to a file."""
    command = [python_of(stack), SLOW, "--port", str(port), "--think", "0.05"]
    with lines.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.kill()


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_two_simulators_at_one_slow_script_queue_no_messages(
    simulation: Simulation, stack: str, tmp_path: Path
) -> None:
    """The script broadcasts its replies; if each simulator answered each of them, messages would queue."""
    port, lines = free_port(), tmp_path / "lines"
    other = Simulation(autodrive.make("plane"))
    with (
        slow_script(stack, port, lines),
        other,
        DevkitBridge(simulation, port=port) as first,
        DevkitBridge(other, port=port) as second,
    ):
        wait_until(lambda: first.counters.commands_received and second.counters.commands_received)
        time.sleep(8.0)  # longer than the 6 s after which a script disconnects a client that shows no sign of life
        sent = first.counters.telemetry_sent + second.counters.telemetry_sent
        resent = first.counters.resends + second.counters.resends  # on a loaded machine, the script answers late
        read = lines.read_text().split().count("telemetry")
        assert first.counters.reconnects == second.counters.reconnects == 0
        assert "disconnect" not in lines.read_text()
        for driven in (simulation, other):  # between two commands it brakes if the script is slower than the time-out
            wait_until(lambda driven=driven: driven.frame.vehicles["V1"].throttle == 1.0)
    assert read > 10
    assert sent - resent - read <= 6  # two each, and those in transit between the two readings


@pytest.mark.toolchain
def test_each_vehicle_obeys_its_own_keys(tmp_path: Path) -> None:
    places = {name: VehiclePlacement(y=y) for name, y in (("red", 0.0), ("green", 1.0))}
    simulation = Simulation(autodrive.make(ScenarioSpec(vehicles=places)))
    port = free_port()
    with slow_script("newest", port, tmp_path / "lines"), simulation, DevkitBridge(simulation, port=port):
        wait_until(lambda: simulation.frame.vehicles["red"].speed > 0.1)  # the script addresses V1 only
        assert simulation.frame.vehicles["green"].throttle == 0.0


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_a_script_of_the_league_drives_two_cars_from_the_first_message_on(stack: str, tmp_path: Path) -> None:
    """It reads every key of both cars without asking whether it is there, and holds V1 Reset for 20 messages."""
    places = {"red": VehiclePlacement(type="roboracer"), "green": VehiclePlacement(type="roboracer", y=1.0)}
    simulation = Simulation(autodrive.make(ScenarioSpec(vehicles=places, tick=0.025)))
    sizes = {(name, "front"): (64, 36) for name in places}
    profile = simulation.world.vehicle_specs["red"].devkit_profile
    port, lines, drive = free_port(), tmp_path / "lines", Resets()
    simulation.add_sink(drive)
    command = [python_of(stack), LEAGUE, "--port", str(port), "--vehicles", "2"]
    with lines.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT) as process:
        try:
            wait_until(lambda: is_listening(port) or process.poll() is not None)
            bridge = DevkitBridge(
                simulation,
                port=port,
                image_sizes=lambda: sizes,
                vehicle_profile=lambda: profile,
                resend_delay=2 * LIMIT,  # a message that the script does not answer ends the exchange
            )
            with simulation, bridge:
                wait_until(lambda: process.poll() is not None or bridge.counters.commands_received > 100)
                counters = bridge.counters
            assert process.poll() is None, lines.read_text()
        finally:
            process.kill()
    first, *others = [json.loads(line) for line in lines.read_text().splitlines() if line.endswith("]")]
    assert (counters.profile, counters.refused_values) == ("roboracer", 0)
    assert [car["ranges"] for car in first] == [1081, 1081]
    assert [car["image"] for car in first] == [[36, 64, 3]] * 2
    assert drive.count == 1
    red, green = others[-1]
    assert (red["throttle"], green["throttle"]) == (0.1, 0.2)
    assert 0.0 < red["linear_velocity"][0] < green["linear_velocity"][0]
    # the speed is that of the rear axle, the velocity that of the centre of mass, which pitching moves
    assert green["speed"] == pytest.approx(green["linear_velocity"][0], abs=2e-3)


@pytest.mark.parametrize(("stack", "rays"), [("legacy", [360, 360]), ("newest", [0, 360])])
@pytest.mark.toolchain
def test_a_script_that_reads_gzip_only_drives_nigel_from_the_first_message_on(
    simulation: Simulation, stack: str, rays: list[int], tmp_path: Path
) -> None:
    """The bridge node of Aalto University: an exception ends it, and so does a message that is sent again."""
    port, lines = free_port(), tmp_path / "lines"
    command = [python_of(stack), AALTO, "--port", str(port)]
    with lines.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT) as process:
        try:
            wait_until(lambda: is_listening(port) or process.poll() is not None)
            bridge = DevkitBridge(simulation, port=port, image_sizes=lambda: SMALL_IMAGES, resend_delay=2 * LIMIT)
            with bridge:
                wait_until(lambda: process.poll() is not None or bridge.counters.commands_received > 20)
                counters = bridge.counters
            assert process.poll() is None, lines.read_text()
        finally:
            process.kill()
    assert (counters.dialect, counters.profile, counters.resends) == (STACKS[stack], "2025", 0)
    received = [int(line) for line in lines.read_text().splitlines() if line.isdigit()]  # not the warnings of libraries
    assert received[:2] == rays
    assert set(received[1:]) == {360}


@pytest.mark.toolchain
def test_the_bridge_of_the_neoracer_drives_it_at_the_commanded_speed(tmp_path: Path) -> None:
    """In a circle to the left. With throttle 1, which it takes for 6 m/s, the treads do 36.1 / 0.25 x 0.0425 m/s."""
    places = {"V1": VehiclePlacement(type="neoracer", is_autonomous=True)}
    simulation = Simulation(autodrive.make(ScenarioSpec(vehicles=places, tick=0.025)))
    spec = simulation.world.vehicle_specs["V1"]
    sizes = {("V1", name): (camera.width, camera.height) for name, camera in spec.cameras.items()}
    port, lines = free_port(), tmp_path / "lines"
    command = [python_of("legacy"), NEORACER, "--port", str(port), "--speed", "2"]
    with lines.open("wb") as output, subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT) as process:
        try:
            wait_until(lambda: is_listening(port) or process.poll() is not None)
            bridge = DevkitBridge(
                simulation,
                port=port,
                image_sizes=lambda: sizes,
                vehicle_profile=lambda: spec.devkit_profile,
                resend_delay=2 * LIMIT,
            )
            with simulation, bridge:
                wait_until(lambda: process.poll() is not None or simulation.frame.time > 3.0)
                counters = bridge.counters
            assert process.poll() is None, lines.read_text()
        finally:
            process.kill()
    first, *_, last = [json.loads(line) for line in lines.read_text().splitlines() if line.endswith("}")]
    assert (counters.profile, counters.refused_values) == ("neoracer", 0)
    assert (first["rays"], first["image"]) == (1081, [640, 480])
    treads = 36.1 / 0.25 * 0.0425
    speed = math.hypot(*last["Linear Velocity"][:2])
    assert speed == pytest.approx(2.0 * 1.5 * treads / (6.0 + 0.5 * treads), rel=0.03)  # 3 %: the slip of the tyres
    assert last["Angular Velocity"][2] == pytest.approx(speed * math.tan(math.radians(6.0)) / 0.285, rel=0.1)
    assert last["Linear Velocity"][1] > 0.05  # of the centre of mass, ahead of the rear axle


def test_the_matlab_toolbox_drives_the_car_of_the_league() -> None:
    """With images of the camera of the car, and without an option."""
    places = {"V1": VehiclePlacement(type="roboracer", is_autonomous=True)}
    world = autodrive.make(ScenarioSpec(vehicles=places, tick=0.025), cameras="software")
    camera = world.vehicle_specs["V1"].cameras["front"]
    toolbox = MatlabToolbox()
    simulation = Simulation(world)
    with (
        peer(toolbox) as port,
        simulation,
        DevkitBridge(
            simulation,
            port=port,
            images=partial(images_of, encoder=JpegEncoder()),
            image_sizes=lambda: {("V1", "front"): (camera.width, camera.height)},
            vehicle_profile=lambda: world.vehicle_specs["V1"].devkit_profile,
        ) as bridge,
    ):
        wait_until(lambda: toolbox.errors or simulation.frame.vehicles["V1"].speed > 0.5)
        counters = bridge.counters
        steering = simulation.frame.vehicles["V1"].steering
    assert not toolbox.errors
    assert (counters.dialect, counters.profile, counters.bad_packets) == (Dialect.RAW, "roboracer", 0)
    assert steering > 0.0
    assert toolbox.readings[-1].numbers["Speed"] > 0.0
    assert toolbox.readings[-1].picture.std() > 1.0  # not the black image of a camera without one


# -- the parsers of the devkits ----------------------------------------------------------------------------------


def read_by(stack: str, cases: list[tuple[str, dict[str, str]]]) -> list[dict[str, object]]:
    """Values that scripts of each year parse from telemetry, with the libraries of that stack."""
    text = json.dumps([{"year": year, "data": data} for year, data in cases])
    command = [str(python_of(stack)), str(READ_TELEMETRY)]
    done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_scripts_of_all_years_read_their_telemetry(stack: str) -> None:
    ranges = [math.inf, 1.0, 2.5] * 120
    sent = frame(vehicle(lidar=scan(ranges, 0.0)))
    for year, data in zip(
        PROFILES, read_by(stack, [(y, telemetry(sent, p)) for y, p in PROFILES.items()]), strict=True
    ):
        assert data["LIDAR Range Array"] == ranges
        assert data["Encoder Ticks"] == [1920, -7]
        assert data["Throttle"] == 0.5
        assert data["Orientation Quaternion"] == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)], abs=5e-4)
        assert data["Front Camera Image"] == [[720, 1280, 3], 0, 0], year
        assert data.get("Rear Camera Image") == (None if PROFILES[year].has_race else data["Front Camera Image"])


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_scripts_of_all_years_read_the_initial_telemetry(stack: str) -> None:
    cases = [(year, initial_telemetry(frame(), lidar=profile.lidar)) for year, profile in PROFILES.items()]
    for data in read_by(stack, cases):
        assert data["Position"][2] == pytest.approx(0.0325, abs=0.02)  # type: ignore[index]  # 2020: the body's centre


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.toolchain
def test_scripts_of_all_years_read_telemetry_without_a_lidar(stack: str) -> None:
    cases = [(year, telemetry(frame(vehicle(lidar=None)), profile)) for year, profile in PROFILES.items()]
    for data in read_by(stack, cases):
        assert data["LIDAR Range Array"] == [math.inf] * 360
        assert data["LIDAR Scan Rate"] == 7.0
