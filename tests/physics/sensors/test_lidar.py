"""LIDAR compared with closed forms, with MuJoCo's rays, and with rotated and moved copies of a scene."""

# mujoco has no type information
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.transforms import (
    Quaternion,
    Vector,
    compose,
    quaternion_from_euler,
    quaternion_from_yaw,
    rotate,
    rotation_from_quaternion,
)
from autodrive.base.yaml_files import parse
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.outline import approximate_bearing
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.messages import LidarScan
from tests.support.one_sensor import OneSensor
from tests.support.sensor_scenes import BOX, CYLINDER, SPHERE, Solid, scene

# tolerance of ranges [m]; double precision at 12 m is three digits better
EXACT = 1e-9
HEIGHT = 0.2


def turned(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> tuple[float, ...]:
    return tuple(rotation_from_quaternion(quaternion_from_euler(roll, pitch, yaw)))


def scan(
    solids: list[Solid],
    spec: LidarSpec | None = None,
    position: Vector = (0.0, 0.0, HEIGHT),
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0),
    vehicle: int = 0,
) -> LidarScan:
    where = scene(solids, vehicles=2, vehicle_position=[position] * 2, vehicle_orientation=[orientation] * 2)
    return OneSensor(spec or LidarSpec(), where, vehicle=vehicle).sample()


def ray_angles(result: LidarScan) -> NDArray[np.floating[Any]]:
    return result.angle_min + result.angle_increment * np.arange(len(result.ranges))


# -- closed forms -----------------------------------------------------------------------------------------------


def test_range_to_a_wall_is_its_distance_over_the_cosine() -> None:
    result = scan([Solid(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))])
    angles = ray_angles(result)
    with np.errstate(divide="ignore"):
        expected = np.where(np.cos(angles) > 3.0 / 12.0, 3.0 / np.cos(angles), math.inf)
    np.testing.assert_allclose(result.ranges, expected, atol=EXACT)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.1), (0.05, 0.0), (0.1, -0.2)])
def test_tilted_sensor_detects_the_floor(roll: float, pitch: float) -> None:
    q = quaternion_from_euler(roll, pitch, 0.7)
    result = scan([], LidarSpec(rays=720), orientation=q)
    fall = np.array([-rotate(q, (math.cos(a), math.sin(a), 0.0))[2] for a in ray_angles(result)])
    with np.errstate(divide="ignore"):
        expected = np.where(fall > HEIGHT / 12.0, HEIGHT / fall, math.inf)
    np.testing.assert_allclose(result.ranges, expected, atol=EXACT)


def test_lidar_detects_other_vehicles_but_not_its_own() -> None:
    own, other = (
        Solid(BOX, (0.1,) * 3, (0.0, 0.0, HEIGHT), vehicle=0),
        Solid(BOX, (0.1,) * 3, (0, 1, HEIGHT), vehicle=1),
    )
    assert scan([own, other]).ranges[90] == pytest.approx(0.9, abs=EXACT)
    assert np.isneginf(scan([own, other], vehicle=1).ranges).all()  # inside the box of the other


def test_scan_has_the_origin_and_axes_of_the_mount() -> None:
    spec = LidarSpec(mount=Mount(position=(0.5, 0.0, 0.1), rotation_deg=(0.0, 0.0, 90.0)))
    wall = Solid(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))
    assert scan([wall], spec).ranges[270] == pytest.approx(
        2.5, abs=EXACT
    )  # ahead of the vehicle is right of the sensor


# -- limits -----------------------------------------------------------------------------------------------------


def test_ranges_out_of_limits_are_infinite() -> None:
    solids = [
        Solid(BOX, (1.0, 0.1, 1.0), (1.149, 0.0, 0.0)),  # front: 1 mm below the minimum
        Solid(BOX, (0.1, 1.0, 1.0), (0.0, 1.151, 0.0)),  # left: 1 mm above the minimum
        Solid(BOX, (1.0, 0.1, 1.0), (-12.999, 0.0, 0.0)),  # rear: 1 mm below the maximum
        Solid(BOX, (0.1, 1.0, 1.0), (0.0, -13.001, 0.0)),  # right: 1 mm above the maximum
    ]
    ranges = scan(solids).ranges[[0, 90, 180, 270]]
    np.testing.assert_allclose(ranges, (-math.inf, 0.151, 11.999, math.inf), atol=EXACT)


@pytest.mark.parametrize("kind", [BOX, CYLINDER, SPHERE])
def test_ranges_inside_a_solid_are_minus_infinity(kind: int) -> None:
    assert np.isneginf(scan([Solid(kind, (1.0, 1.0, 1.0), (0.2, 0.1, HEIGHT), turned(0.1, 0.2, 0.3))]).ranges).all()


def test_ranges_in_an_empty_scene_are_infinite() -> None:
    result = scan([])
    assert np.isposinf(result.ranges).all()
    assert (result.intensities == 47.0).all()


# -- configuration ----------------------------------------------------------------------------------------------


def test_default_is_the_lidar_of_the_report() -> None:
    result = scan([])
    assert (len(result.ranges), result.angle_min, math.degrees(result.angle_increment)) == (360, 0.0, 1.0)
    assert (result.range_min, result.range_max, result.scan_rate, result.time_increment) == (0.15, 12.0, 7.0, 0.0)


def test_1080_rays_at_40_hz_are_configured_in_one_line() -> None:
    line = "{rays: 1080, rate: 40, angle_min_deg: -135, angle_increment_deg: 0.25, range_min: 0.06, range_max: 10}"
    result = scan([Solid(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))], parse(line, LidarSpec))
    assert result.scan_rate == 40.0
    assert result.ranges[540] == pytest.approx(3.0, abs=EXACT)
    assert math.degrees(result.angle_min + 1079 * result.angle_increment) == pytest.approx(134.75)


# -- independent references -------------------------------------------------------------------------------------


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_approximate_bearing_has_the_error_bound_of_the_handbook(x: float, y: float) -> None:
    if max(abs(x), abs(y)) > 1e-200:
        assert abs(approximate_bearing(x, y) - math.atan2(y, x)) <= 1.2e-5  # 1e-5, its coefficients have 7 digits


def random_solid(rng: np.random.Generator, is_upright: bool = False) -> Solid:
    kind = int(rng.choice([BOX, CYLINDER, SPHERE]))
    size = rng.uniform(0.05, 0.8, {BOX: 3, CYLINDER: 2, SPHERE: 1}[kind])
    if kind == BOX and rng.random() < 0.3:
        size[int(rng.integers(3))] = 5.0  # a wall or a beam
    bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(1.0, 9.0)
    position = (distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(-0.2, 0.6))
    tilt = 0.0 if is_upright else rng.choice([0.02, 3.0])
    roll, pitch, yaw = rng.uniform(-1, 1, 3) * (tilt, tilt, math.pi)
    return Solid(kind, size, position, turned(roll, pitch, yaw))


def mujoco_ranges(
    solids: list[Solid], position: Vector, orientation: Quaternion, angles: NDArray[np.floating[Any]]
) -> Floats:
    """Ranges by mj_ray, an independent implementation; +inf for no hit."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    for thing in solids:
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, thing.rotation.ravel())
        spec.worldbody.add_geom(type=thing.kind, size=thing.size, pos=thing.position, quat=quaternion)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ranges = []
    for angle in angles:
        direction = np.array(rotate(orientation, (math.cos(angle), math.sin(angle), 0.0)))
        found = mujoco.mj_ray(model, data, np.array(position), direction, None, 1, -1, np.zeros((1, 1), np.int32))
        ranges.append(math.inf if found < 0 or found > 12.0 else found)
    return np.array(ranges)


FANS = (
    LidarSpec(rays=540, range_min=0.0),
    LidarSpec(rays=181, angle_min_deg=-90, angle_max_deg=90, range_min=0.0),
    LidarSpec(rays=181, angle_min_deg=90, angle_max_deg=-90, range_min=0.0),
    LidarSpec(rays=361, angle_min_deg=-180, angle_max_deg=180, range_min=0.0),
    LidarSpec(rays=360, angle_min_deg=180, angle_increment_deg=-1, range_min=0.0),
    LidarSpec(rays=7, angle_min_deg=350, angle_increment_deg=3.3, range_min=0.0),
    LidarSpec(rays=1, angle_min_deg=-30, range_min=0.0),
)


@pytest.mark.parametrize("is_upright", [True, False])
@pytest.mark.parametrize("fan", range(len(FANS)))
def test_random_scenes_agree_with_mujoco(fan: int, is_upright: bool) -> None:
    hits = 0
    for seed in range(fan, 60, 10):
        rng = np.random.default_rng(seed)
        solids = [random_solid(rng, is_upright) for _ in range(30)]
        solids = [t for t in solids if np.linalg.norm(t.position - (0, 0, HEIGHT)) > t.bounding_radius]  # not inside
        tilt = float(rng.choice([0.0, 0.003, 0.05, 0.5]))
        q = quaternion_from_euler(*(rng.uniform(-1, 1, 3) * (tilt, tilt, math.pi)))
        result = scan(solids, FANS[fan], orientation=q)
        expected = mujoco_ranges(solids, (0.0, 0.0, HEIGHT), q, ray_angles(result))
        np.testing.assert_allclose(result.ranges, expected, rtol=0.0, atol=EXACT)
        hits += np.isfinite(result.ranges).mean()
    assert hits > 0.3


@settings(max_examples=25)
@given(st.integers(0, 359), st.integers(0, 1000))
def test_rotating_the_vehicle_by_one_degree_shifts_the_scan_by_one_ray(degrees: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    solids = [random_solid(rng) for _ in range(10)]
    still = scan(solids).ranges
    q = quaternion_from_yaw(math.radians(degrees))
    moved = np.roll(scan(solids, orientation=q).ranges, degrees)
    agree = np.isclose(still, moved, rtol=0.0, atol=1e-7)  # grazing rays amplify the rounding error of the angle ...
    assert (~agree).sum() <= 1  # ... and one ray at an outline may hit or miss


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
@settings(max_examples=25)
def test_moving_scene_and_vehicle_together_does_not_change_the_scan(x: float, y: float, yaw: float) -> None:
    rng = np.random.default_rng(11)
    solids = [random_solid(rng) for _ in range(10)]
    turn = np.array(turned(yaw=yaw)).reshape(3, 3)
    others = [Solid(t.kind, t.size, turn @ t.position + (x, y, 0), turn @ t.rotation) for t in solids]
    there = scan(others, position=(x, y, HEIGHT), orientation=quaternion_from_yaw(yaw)).ranges
    agree = np.isclose(scan(solids).ranges, there, rtol=0.0, atol=1e-7)
    assert (~agree).sum() <= 1


# -- rolling ----------------------------------------------------------------------------------------------------


def drive(
    spec: LidarSpec,
    solids: list[Solid],
    pose_at: Callable[[float], tuple[Vector, Quaternion]],
    ticks: int,
    tick: Fraction = Fraction(1, 60),
    move: Callable[[float], Vector] | None = None,
) -> list[LidarScan]:
    """All scans after that of the start of a rolling LIDAR on a vehicle with the pose `pose_at(time)`."""
    where = scene(solids)
    lidar = OneSensor(spec, where, tick=tick)
    scans: list[LidarScan] = []
    for k in range(ticks + 1):
        time = float(k * tick)
        where.state.vehicle_position[0], where.state.vehicle_orientation[0] = pose_at(time)
        if move is not None:
            where.state.shape_position[:] = move(time)
        newest = lidar.sample()
        if not scans or newest is not scans[-1]:
            scans.append(newest)
    return scans[1:]


def ray_times(result: LidarScan) -> NDArray[np.floating[Any]]:
    return result.time - result.time_increment * np.arange(len(result.ranges) - 1, -1, -1)


STILL: Quaternion = (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "box_speed", "fan"),
    [
        (0.5, 0.0, 0.0, {}),
        (0.0, 0.8, 0.0, {"rays": 271, "angle_min_deg": -135, "angle_max_deg": 135}),
        (0.0, 0.0, 0.6, {}),
    ],
)
def test_each_ray_of_a_rolling_scan_has_the_poses_of_vehicle_and_box_at_its_time(
    speed: float, yaw_rate: float, box_speed: float, fan: dict[str, Any]
) -> None:
    scans = drive(
        LidarSpec(is_rolling=True, **fan),
        [Solid(BOX, (0.5, 50.0, 1.0), (0.0, 0.0, 0.0))],
        lambda t: ((speed * t, 0.0, HEIGHT), quaternion_from_yaw(yaw_rate * t)),
        60,
        move=lambda t: (3.5 + box_speed * t, 0.0, 0.0),
    )
    assert [s.time for s in scans] == pytest.approx([n / 7.0 for n in range(1, 8)])
    assert scans[0].time_increment == pytest.approx(1.0 / (7.0 * 360.0))  # one revolution per period
    for result in scans:
        times = ray_times(result)
        cos = np.cos(ray_angles(result) + yaw_rate * times)
        with np.errstate(divide="ignore"):
            distance = (3.0 + (box_speed - speed) * times) / cos
        expected = np.where((cos > 0) & (distance <= 12.0), distance, math.inf)
        np.testing.assert_allclose(result.ranges, expected, atol=EXACT)


@pytest.mark.parametrize("degrees", [359.5, 270.0, 180.0, 40.0])
@pytest.mark.parametrize("seed", range(3))
def test_rolling_scan_at_rest_equals_the_instantaneous_scan(seed: int, degrees: float) -> None:
    # two implementations: outlines in a fan, and rays cast one by one
    rng = np.random.default_rng(seed)
    solids = [t for t in (random_solid(rng) for _ in range(30)) if np.linalg.norm(t.position) > t.bounding_radius + 0.3]
    q = compose(
        quaternion_from_yaw(rng.uniform(-3, 3)),
        quaternion_from_euler(rng.uniform(-0.05, 0.05), rng.uniform(-0.05, 0.05), 0.0),
    )
    mount = Mount(position=(0.05, -0.12, 0.03), rotation_deg=(1.0, -2.0, 30.0))
    fan: dict[str, Any] = {"rays": 720, "angle_min_deg": -0.4 * degrees, "angle_max_deg": 0.6 * degrees, "mount": mount}
    rolling = drive(LidarSpec(is_rolling=True, **fan), solids, lambda t: ((0.0, 0.0, HEIGHT), q), 10)[0]
    instant = scan(solids, LidarSpec(**fan), orientation=q)
    np.testing.assert_allclose(rolling.ranges, instant.ranges, rtol=0.0, atol=EXACT)


def test_rolling_lidar_has_a_scan_at_the_start_and_after_a_reset() -> None:
    solids = [Solid(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))]
    where = scene(solids, vehicle_position=[(0.0, 0.0, HEIGHT)])
    lidar = OneSensor(LidarSpec(is_rolling=True), where, tick=Fraction(1, 10))
    for _ in range(2):
        lidar.reset()
        first = lidar.sample()
        assert first.time == 0.0
        np.testing.assert_array_equal(first.ranges, scan(solids).ranges)  # it stood still before the start
        assert lidar.sample() is first
        assert lidar.sample().time == pytest.approx(1.0 / 7.0)


def test_rolling_lidar_with_several_scans_per_tick_reports_the_newest() -> None:
    spec = LidarSpec(is_rolling=True, rate=100.0)
    scans = drive(spec, [], lambda t: ((0.0, 0.0, HEIGHT), STILL), 6, tick=Fraction(1, 20))
    assert [s.time for s in scans] == pytest.approx([0.05, 0.10, 0.15, 0.20, 0.25, 0.30])
