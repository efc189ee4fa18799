"""The driver of a real car: its numbers against the environment and closed forms, and its safety layer in a world."""

from __future__ import annotations

import ast
import itertools
import json
import math
import sys
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.deployment import driver as driver_module
from autodrive.experiments.deployment.deploy import deploy
from autodrive.experiments.deployment.driver import (
    FAR,
    LOG_COLUMNS,
    READINGS,
    CarCommand,
    CarDriver,
    CarError,
    CarLog,
    CarPolicy,
    CarSettings,
    ScanLayout,
    Sectors,
    free_distances,
    safe_speed,
    seen_from,
    topics,
)
from autodrive.experiments.envs.roboracer_env import RoboRacerVectorEnv
from autodrive.experiments.policies import Policy
from autodrive.experiments.policies.policy import Pace, PolicyDrivers
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.protocol.messages import Command
from autodrive.recording.drives import read_drives
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import load_map
from autodrive.world.compile import on_grid
from autodrive.world.factory import make

SETTINGS = CarSettings()
BEARINGS = [SETTINGS.first_degree + (k + 0.5) * SETTINGS.sector_degrees for k in range(SETTINGS.sectors)]
NAMES = [*READINGS, *(f"range_{bearing:g}" for bearing in BEARINGS)]
LAYOUT = ScanLayout(math.radians(-135.0), math.radians(0.25), 1081, 0.06, 10.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the included policy."""
    path = tmp_path_factory.mktemp("car")
    deploy("race", path)
    return path


def constant(path: Path, drive: float, steer: float) -> Path:
    """A policy that always gives these outputs."""
    layers = ((np.zeros((2, 1), np.float32), np.array([drive, steer], np.float32)),)
    Policy("time_trial", ("wheel_speed",), (1.0,), (0.0, 0.3), layers).save(path / "policy.npz")
    return path


# -- numbers -----------------------------------------------------------------------------------------------------------


def test_the_sectors_have_the_bits_of_the_observation_of_the_environment() -> None:
    env = RoboRacerVectorEnv(2, noise=2.0)
    with closing(env):
        observed = env.reset(seed=3)[0]
        for _ in range(4):
            ranges = np.array(env.batch.readings.lidar_ranges).reshape(2, -1)
            layout = ScanLayout(float(np.float32(LAYOUT[0])), float(np.float32(LAYOUT[1])), ranges.shape[1])
            for seen, scan in zip(observed, ranges, strict=True):
                sectors, _ = Sectors(layout, SETTINGS)(scan.astype(np.float32).astype(np.float64))
                assert np.array_equal(sectors.astype(np.float32), seen[-SETTINGS.sectors :])
            observed = env.step(np.array([[0.2, 0.3], [0.1, -0.2]]))[0]


def room(angles: NDArray[Any], x: float, y: float) -> NDArray[Any]:
    """Ranges from a place to the walls of a room, 8 m x 5 m around the origin, in these directions [rad]."""
    across = np.where(np.sin(angles) > 0.0, 2.5 - y, 2.5 + y) / np.maximum(abs(np.sin(angles)), 1e-9)
    along = np.where(np.cos(angles) > 0.0, 4.0 - x, 4.0 + x) / np.maximum(abs(np.cos(angles)), 1e-9)
    return np.minimum(along, across)


FINE = np.arange(1080) * math.radians(0.25) + math.radians(-135.0)
"""Directions of the scanner of the training."""


@pytest.mark.parametrize(
    ("first", "step", "count", "changes", "rough"),
    [
        (-135.0, 0.5, 541, {}, 0.03),
        (0.0, 0.25, 1440, {}, 0.005),  # a circle that begins ahead
        (-180.0, 1.0, 360, {}, 0.08),
        (135.0, -0.25, 1081, {}, 0.005),  # clockwise
        (-135.0, 0.25, 1081, {"lidar_is_upside_down": True}, 0.005),
        (45.0, 0.25, 1440, {"lidar_yaw": math.radians(-30.0)}, 0.005),
    ],
)
def test_scans_of_other_layouts_give_the_sectors_of_the_scanner_of_the_training(
    first: float, step: float, count: int, changes: dict[str, Any], rough: float
) -> None:
    settings = replace(SETTINGS, **changes)
    angles = math.radians(first) + math.radians(step) * np.arange(count)
    bearings = (-angles if settings.lidar_is_upside_down else angles) + settings.lidar_yaw
    layout = ScanLayout(math.radians(first), math.radians(step), count, 0.05, 12.0)
    sectors, _ = Sectors(layout, settings)(room(bearings, 0.7, -0.4))
    expected = room(FINE, 0.7, -0.4).reshape(54, 20).min(axis=1)
    # the shortest range is between two rays: it differs by the slope of a wall over a step of the coarser scanner
    assert sectors == pytest.approx(np.minimum(expected, 10.0), abs=rough, rel=rough)


def test_a_scanner_at_another_place_gives_the_ranges_from_the_place_of_the_training() -> None:
    settings = replace(SETTINGS, lidar=(0.05, 0.03))
    angles = np.arange(1440) * math.radians(0.25) - math.pi
    layout = ScanLayout(-math.pi, math.radians(0.25), 1440, 0.05, 12.0)
    sectors, points = Sectors(layout, settings)(room(angles, 0.05, 0.03))
    expected = room(FINE, *settings.policy_lidar).reshape(54, 20).min(axis=1)
    assert sectors == pytest.approx(expected, rel=0.01)
    # the points of the braking model are on the walls, in the frame of the car
    assert np.minimum(abs(abs(points[:, 0]) - 4.0), abs(abs(points[:, 1]) - 2.5)) == pytest.approx(0.0, abs=1e-9)


def test_a_sector_without_a_ray_has_the_shorter_range_of_its_neighbours() -> None:
    layout = ScanLayout(math.radians(-130.0), math.radians(10.0), 27, 0.05, 12.0)
    ranges = np.arange(27) * 0.1 + 1.0
    sectors, _ = Sectors(layout, SETTINGS)(ranges)
    seen, between = sectors[1::2], sectors[2::2]
    assert seen == pytest.approx(ranges)
    assert between == pytest.approx(ranges[:-1])


def test_rays_without_a_return_or_a_measurement_are_what_ros_says() -> None:
    ranges = np.full(1081, 3.0)
    ranges[:20] = np.inf  # no return
    ranges[20:39] = np.nan  # no measurement: the last ray of the sector counts
    ranges[40:60] = -np.inf  # too near
    ranges[60:80] = 0.01  # nearer than the scanner measures: to be discarded, so the neighbour counts
    sectors, points = Sectors(LAYOUT, SETTINGS)(ranges)
    assert sectors[:5].tolist() == [10.0, 3.0, 0.0, 0.0, 3.0]
    assert np.hypot(points[:, 0] - SETTINGS.lidar[0], points[:, 1]) == pytest.approx(3.0)


def test_a_scanner_that_sees_too_little_is_refused_and_one_that_sees_less_is_noted(folder: Path) -> None:
    with pytest.raises(CarError, match=r"covers -90 to 90 degrees, so 18 of the 54 sectors .* needs -135 to 135"):
        Sectors(ScanLayout(-0.5 * math.pi, math.radians(0.5), 361), SETTINGS)
    car = CarDriver(SETTINGS, folder)
    car.on_scan(0.0, 0.0, ScanLayout(math.radians(-120.0), math.radians(0.5), 481, 0.05, 12.0), np.full(481, 2.0))
    assert "does not see 6 of the 54 sectors" in car.notes[0]


@pytest.mark.parametrize("name", ["race", "paced"])
def test_the_policy_gives_the_numbers_of_the_simulator(name: str, tmp_path: Path) -> None:
    policy, rng = Policy.find("race"), np.random.default_rng(5)
    if name == "paced":
        inputs = ("wheel_speed", "yaw_rate@2", "steer@1", "throttle@3")
        sizes = (len(inputs), 8, 2)
        layers = tuple(
            (rng.normal(0.0, 0.5, (out, into)).astype(np.float32), rng.normal(0.0, 0.2, out).astype(np.float32))
            for into, out in itertools.pairwise(sizes)
        )
        policy = replace(policy, pace=Pace(inputs, (0.2,) * 4, (0.8, 1.6), 0.98, layers, 0.2))
    policy.save(tmp_path / "policy.npz")
    car, reference = CarPolicy(tmp_path / "policy.npz", NAMES), PolicyDrivers(policy, NAMES)
    slower = CarPolicy(tmp_path / "policy.npz", NAMES)
    slow_reference = PolicyDrivers(policy.slower(2.0), NAMES)
    for _ in range(20):
        readings = np.r_[rng.uniform(-1.0, 5.0, len(READINGS)), rng.uniform(0.2, 10.0, 54)]
        assert car.act(readings) == pytest.approx(reference.act(readings[None])[0], abs=1e-12)
        if name == "race":  # a pace limits the throttle after the division, as `slower` does
            assert slower.act(readings, 2.0) == pytest.approx(slow_reference.act(readings[None])[0], abs=1e-12)


@pytest.mark.parametrize("speed", [0.0, 0.5, 3.0, 8.0])
def test_the_safe_speed_is_that_of_a_stop_with_constant_deceleration(speed: float) -> None:
    assert safe_speed(speed * speed / (2.0 * 4.0), 4.0) == pytest.approx(speed)
    assert safe_speed(-0.1, 4.0) == 0.0


@pytest.mark.parametrize("curvature", [0.0, 0.7, -1.2])
def test_points_are_seen_from_the_pose_after_an_arc(curvature: float) -> None:
    points, pose = np.array([[2.0, 0.5], [-1.0, -3.0]]), np.zeros(3)
    for _ in range(10000):  # Euler's method, with the heading in the middle of each step
        pose += 1e-4 * np.array([math.cos(pose[2] + 5e-5 * curvature), math.sin(pose[2] + 5e-5 * curvature), curvature])
    c, s = math.cos(pose[2]), math.sin(pose[2])
    expected = [[c * x + s * y, c * y - s * x] for x, y in points - pose[:2]]
    assert seen_from(points, curvature, 1.0) == pytest.approx(np.array(expected), abs=1e-6)


@pytest.mark.parametrize("curvature", [0.0, 0.3, -0.8, 1.5])
def test_the_free_distance_is_that_at_which_a_moved_car_touches(curvature: float) -> None:
    front, half, rng = 0.42, 0.15, np.random.default_rng(2)
    points = rng.uniform((0.45, -2.0), (4.0, 2.0), (40, 2))
    free = float(free_distances(points, np.array([curvature]), front=front, half_width=half)[0])
    touched = FAR
    for way in np.arange(0.0, 3.0, 0.002):
        turn = curvature * way
        x = way if not curvature else math.sin(turn) / curvature
        y = 0.0 if not curvature else (1.0 - math.cos(turn)) / curvature
        ahead = (points[:, 0] - x) * math.cos(turn) + (points[:, 1] - y) * math.sin(turn)
        left = (points[:, 1] - y) * math.cos(turn) - (points[:, 0] - x) * math.sin(turn)
        if ((ahead >= 0.0) & (ahead <= front) & (abs(left) <= half)).any():
            touched = way
            break
    # the model never sees more room; it may see less, because the ring of its outer corner counts at all angles
    assert free <= touched + 0.01
    assert free >= min(touched, 3.0) - 0.35


# -- safety ------------------------------------------------------------------------------------------------------------


class Bench:
    """A driver on a bench: time passes in steps of 5 ms, and messages come at their rates."""

    def __init__(self, folder: Path, **changes: Any) -> None:
        self.driver = CarDriver(replace(SETTINGS, **changes), folder)
        self.time, self.rng = 0.0, np.random.default_rng(1)
        self.commands: list[tuple[float, CarCommand]] = []

    def run(
        self,
        duration: float,
        *,
        scan: Callable[[float], Any] | None = lambda _: 3.0,
        delay: float = 0.0,
        has_speed: bool = True,
        has_button: bool = True,
        speed: float = 1.0,
    ) -> list[CarCommand]:
        """Commands in that time. `scan`: range at a time, None: no scans; `delay` of their stamps [s]."""
        first = len(self.commands)
        for tick in range(round(duration / 0.005)):
            self.time += 0.005
            if tick % 5 == 0:
                if has_speed:
                    self.driver.on_speed(self.time, speed)
                    self.driver.on_yaw_rate(self.time, 0.0)
                self.driver.on_dead_man(self.time, has_button)
                if scan is not None:
                    ranges = scan(self.time) + self.rng.normal(0.0, 0.01, 1081)
                    self._add(self.driver.on_scan(self.time, self.time - delay, LAYOUT, ranges))
            if tick % 5 == 3:
                self._add(self.driver.tick(self.time))
        return [command for _, command in self.commands[first:]]

    def _add(self, command: CarCommand | None) -> None:
        if command is not None:
            self.commands.append((self.time, command))


def test_a_lost_scan_stops_the_car_within_a_tenth_of_a_second(folder: Path) -> None:
    bench = Bench(folder)
    assert {command.stop for command in bench.run(1.0)} == {""}
    lost = bench.time
    assert bench.run(0.3, scan=None)[-1].stop == "no scan"
    stop = next(time for time, command in bench.commands if command.stop)
    assert (stop - lost <= 0.1 and stop == bench.commands[-1][0]) or stop - lost <= 0.1
    after = [command for time, command in bench.commands if time >= stop]
    assert all(command.speed == 0.0 and command.throttle == 0.0 for command in after)
    assert bench.run(0.2)[-1].stop == ""  # it drives again with scans


def test_nothing_is_commanded_before_the_first_scan(folder: Path) -> None:
    bench = Bench(folder)
    assert bench.run(0.5, scan=None) == []
    assert bench.run(0.5, has_button=False) == []
    assert bench.run(0.2) != []


@pytest.mark.parametrize(
    ("missing", "reason"), [({"has_speed": False}, "no speed"), ({"has_button": False}, "dead man")]
)
def test_the_car_stops_without_its_speed_or_the_dead_mans_button(
    missing: dict[str, Any], reason: str, folder: Path
) -> None:
    bench = Bench(folder)
    bench.run(0.5)
    assert bench.run(1.0, **missing)[-1].stop == reason
    assert bench.driver.summary()["stops"] == {reason: 1}


def test_a_scan_that_is_late_old_or_frozen_is_no_new_scan(folder: Path) -> None:
    bench = Bench(folder)
    bench.run(0.5)
    assert bench.run(0.4, delay=0.2)[-1].stop == "no scan"
    assert "later than others" in bench.driver.problem
    frozen = CarDriver(SETTINGS, folder)
    ranges, stops = np.full(1081, 3.0), []
    for step in range(20):
        now = 0.025 * step
        frozen.on_speed(now, 1.0)
        frozen.on_yaw_rate(now, 0.0)
        frozen.on_dead_man(now, True)
        frozen.on_scan(now, now, LAYOUT, ranges)
        stops.append((frozen.tick(now) or CarCommand(1.0, 0.0, 0.0, 0.0, "")).stop)
    assert stops[0] == ""
    assert stops[-1] == "no scan"
    assert "hangs" in frozen.problem
    assert frozen.on_scan(0.6, 0.05, LAYOUT, ranges + 0.1) is None
    assert "earlier one" in frozen.problem


def test_a_scan_with_few_measurements_or_other_numbers_of_rays_is_refused(folder: Path) -> None:
    bench = Bench(folder)
    bench.run(0.5)
    assert bench.run(0.4, scan=lambda _: math.nan)[-1].stop == "no scan"
    assert "100 % of the rays" in bench.driver.problem
    bench.driver.on_scan(bench.time, bench.time, LAYOUT, np.full(7, 1.0))
    assert "7 ranges" in bench.driver.problem


def test_a_clock_that_jumps_back_stops_the_car_until_there_are_new_messages(folder: Path) -> None:
    bench = Bench(folder)
    bench.run(0.5)
    command = bench.driver.tick(-100.0)
    assert command is not None
    assert command.stop == "no scan"


def test_a_clock_that_is_set_later_does_not_make_all_scans_old(folder: Path) -> None:
    bench = Bench(folder)
    bench.driver.on_scan(0.0, 4.0, LAYOUT, np.full(1081, 3.0))  # the clock of a simulator is not known yet
    assert "has not begun" in bench.driver.problem
    bench.driver.on_scan(0.1, 4.0, LAYOUT, np.full(1081, 3.0))  # the clock is far behind that of the scanner
    bench.time = 100.0
    assert bench.run(0.3)[-1].stop == ""


def test_a_slow_scanner_drives_with_the_steps_of_the_policy_and_a_slower_one_is_named(folder: Path) -> None:
    bench = Bench(folder)
    times = []
    for tick in range(200):
        now = 0.005 * tick
        if tick % 10 == 0:  # 20 Hz
            bench.driver.on_speed(now, 1.0)
            bench.driver.on_yaw_rate(now, 0.0)
            bench.driver.on_dead_man(now, True)
            command = bench.driver.on_scan(now, now, LAYOUT, 3.0 + 0.01 * bench.rng.normal(size=1081))
        else:
            command = bench.driver.tick(now)
        times += [now] if command is not None and not command.stop else []
    assert len(times) >= 24
    assert np.diff(times).max() <= 0.05
    slow = CarDriver(SETTINGS, folder)
    for step in range(8):
        slow.on_scan(0.1 * step, 0.1 * step, LAYOUT, 3.0 + 0.01 * bench.rng.normal(size=1081))
    assert "0.100 s apart" in slow.notes[0]


def test_the_speed_cap_rises_step_by_step(tmp_path: Path) -> None:
    bench = Bench(constant(tmp_path, 1.0, 0.0), speed_cap=0.5, cap_step=0.25, cap_interval=0.5, cap_most=1.0)
    speeds = [max(command.speed for command in bench.run(0.5, scan=lambda _: 9.0)) for _ in range(5)]
    assert all(speed <= cap + 1e-9 for speed, cap in zip(speeds, (0.5, 0.75, 1.0, 1.0, 1.0), strict=True))
    assert speeds[0] <= 0.5 < speeds[1] <= 0.75 < speeds[2]


def test_wrong_settings_are_named(tmp_path: Path) -> None:
    for values, text in [
        ({"spede_cap": 1.0}, r"'spede_cap' is not known. Known: policy,"),
        ({"speed_cap": "fast"}, r'speed_cap must be like 1.0, not "fast"'),
        ({"lidar": [0.1]}, r"lidar must be like \[0.2733, 0.0\]"),
        ({"braking": 0.0}, r"braking must be over 0, not 0"),
        ({"margin": -1.0}, r"margin must be 0 or more"),
        ({"drive_topic": ""}, r"throttle_topic and steering_command_topic"),
        ({"odometry_topic": ""}, r"give odometry_topic, speed_topic or encoder_topics"),
        ({"pose_type": "Pose"}, r"Known: PoseStamped"),
        ({"sectors": 100}, r"at most 360 degrees"),
    ]:
        (tmp_path / "settings.json").write_text(json.dumps(values))
        with pytest.raises(CarError, match=text):
            CarSettings.read(tmp_path / "settings.json")
    (tmp_path / "settings.json").write_text(SETTINGS.json())
    read = CarSettings.read(tmp_path / "settings.json", ["drive_topic=/my", "speed_cap=2", "encoder_topics=/a,/b"])
    assert asdict(read) == asdict(replace(SETTINGS, drive_topic="/my", speed_cap=2.0, encoder_topics=("/a", "/b")))


# -- a whole car -------------------------------------------------------------------------------------------------------


def drive_on(
    track: str,
    folder: Path,
    duration: float,
    *,
    settings: CarSettings = SETTINGS,
    latency: float = 0.0,
    steering_offset: float = 0.0,
    grip: float = 1.0,
    log: CarLog | None = None,
) -> tuple[CarDriver, int, float]:
    """Drive a car in a world; its driver, the collisions, and the speed at the end [m/s].

    `latency` of the commands [s]; `steering_offset` as a share of the greatest angle; `grip`: factor.
    """
    car = VehiclePlacement(type="roboracer", grip_factor=grip, sensors={"lidar": SensorSettings(noise="realistic")})
    scenario = ScenarioSpec(map=track, vehicles={"V1": car}, tick=0.005)
    driver, queue, told = CarDriver(replace(settings, dead_man_topic=""), folder, log), [], Command()
    with closing(make(on_grid(scenario, load_map(track)))) as world:
        scanned = -1.0
        while world.time < duration and not world.frame.vehicles["V1"].collision_count:
            frame, now = world.frame.vehicles["V1"], world.time
            assert frame.lidar is not None
            if frame.lidar.time > scanned:
                scanned, scan = frame.lidar.time, frame.lidar
                driver.on_encoder(now, float(frame.encoders.angles.mean()))
                driver.on_yaw_rate(now, float(frame.imu.angular_velocity[2]))
                x, y, _ = frame.pose.position.tolist()
                driver.on_pose(now, x, y, yaw_from_quaternion(frame.pose.orientation))
                layout = ScanLayout(
                    scan.angle_min, scan.angle_increment, len(scan.ranges), scan.range_min, scan.range_max
                )
                if command := driver.on_scan(now, scanned, layout, scan.ranges):
                    queue.append((now + latency, Command(command.throttle, command.steering + steering_offset)))
            while queue and queue[0][0] <= now + 1e-9:
                _, told = queue.pop(0)
            world.step({"V1": told})
        car_frame = world.frame.vehicles["V1"]
        return driver, car_frame.collision_count, float(np.hypot(*car_frame.velocity[:2]))


def test_a_policy_that_drives_into_walls_is_stopped_before_them(tmp_path: Path) -> None:
    settings = replace(SETTINGS, speed_cap=6.0, cap_most=6.0, cap_step=0.0)
    driver, collisions, speed = drive_on(
        "practice", constant(tmp_path, 0.6, 0.0), 12.0, settings=settings, latency=0.04
    )
    assert driver.totals.stops["wall"] >= 1
    assert driver.totals.driven > 5.0
    assert collisions == 0
    assert speed < 0.3  # it stands before the wall


def test_a_car_with_less_grip_latency_and_a_steering_offset_drives_clean_with_the_log_of_its_drive(
    folder: Path, tmp_path: Path
) -> None:
    settings = replace(SETTINGS, speed_cap=3.0, cap_step=1.0, cap_interval=5.0)
    log = CarLog(tmp_path / "drive.csv", settings)
    driver, collisions, _ = drive_on(
        "practice", folder, 22.0, settings=settings, latency=0.04, steering_offset=0.05, grip=0.75, log=log
    )
    log.close(driver.summary())
    assert collisions == 0
    assert driver.totals.driven > 60.0
    assert driver.cap == 5.0
    rows = np.genfromtxt(tmp_path / "drive.csv", delimiter=",", names=True, usecols=range(len(LOG_COLUMNS)))
    assert len(rows) == driver.totals.steps == pytest.approx(22.0 / 0.025, abs=3)
    assert np.diff(rows["time"]) == pytest.approx(0.025, abs=1e-5)
    way = np.hypot(np.diff(rows["x"]), np.diff(rows["y"])).sum()
    assert way == pytest.approx(driver.totals.driven, rel=0.08)  # the wheels slip
    (read,) = read_drives(tmp_path / "drive.csv")  # as `autodrive identify` reads it
    assert read.problems == ()
    assert len(read.time) == len(rows)
    assert np.interp(10.0, read.time, read.x) == pytest.approx(
        np.interp(10.0, rows["time"] - rows["time"][0], rows["x"])
    )
    assert np.interp(10.0, read.time, read.speed) == pytest.approx(
        np.interp(10.025, rows["time"], rows["wheel_speed"]), rel=0.15
    )
    assert rows["throttle"] * 25.252 == pytest.approx(rows["command_speed"], abs=1e-4)
    summary = json.loads((tmp_path / "drive.json").read_text())
    assert summary["steps"] == len(rows)
    assert summary["seconds_from_scan_to_command"]["greatest"] == 0.0


# -- what a car has ----------------------------------------------------------------------------------------------------


def test_the_driver_is_of_python_3_8_and_imports_numpy_only() -> None:
    text = Path(driver_module.__file__).read_text(encoding="utf-8")
    tree = ast.parse(text, feature_version=(3, 8))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.partition(".")[0] for name in names} - sys.stdlib_module_names == {"numpy"}
    for script in Path(driver_module.__file__).with_name("car").glob("*.py"):
        ast.parse(script.read_text(encoding="utf-8"), feature_version=(3, 8))


def test_a_node_subscribes_what_the_settings_name(folder: Path) -> None:
    def names(**changes: Any) -> dict[str, str]:
        return {topic.name: topic.type for topic in topics(CarDriver(replace(SETTINGS, **changes), folder))}

    assert names() == {"/scan": "LaserScan", "/odom": "Odometry", "/dead_man": "Bool"}
    changes = {"odometry_topic": "", "imu_topic": "/imu", "encoder_topics": ("/l", "/r"), "dead_man_topic": "/joy"}
    assert names(**changes, dead_man_type="Joy", pose_topic="/pose") == {
        "/scan": "LaserScan", "/imu": "Imu", "/l": "JointState", "/r": "JointState", "/joy": "Joy",
        "/pose": "PoseStamped",
    }  # fmt: skip
