"""The LIDAR against closed forms, against MuJoCo's rays, and against itself turned round."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from autodrive.descriptions import parse
from autodrive.sensors.lidar import Lidar, LidarSpec, RollingLidar
from autodrive.sensors.outline import approximate_bearing
from autodrive.sensors.sensor import Mount
from autodrive.transforms import compose, quaternion_from_euler, quaternion_from_yaw, rotate, rotation_from_quaternion

from .world import BOX, CYLINDER, SPHERE, Thing, scene

# What is asked of the LIDAR [m]; double precision over 12 m leaves three digits to spare.
EXACT = 1e-9
HEIGHT = 0.2


def turned(roll=0.0, pitch=0.0, yaw=0.0):
    return rotation_from_quaternion(quaternion_from_euler(roll, pitch, yaw))


def scan(things, spec=None, position=(0.0, 0.0, HEIGHT), orientation=(1.0, 0.0, 0.0, 0.0), vehicle=0):
    shapes, state = scene(things, vehicle_position=[position] * 2, vehicle_orientation=[orientation] * 2)
    return Lidar(spec or LidarSpec()).sample(shapes, state, vehicle, 1.0)


def ray_angles(result):
    return result.angle_min + result.angle_increment * np.arange(len(result.ranges))


# -- closed forms -----------------------------------------------------------------------------------------------


def test_wall_ahead_is_its_distance_over_the_cosine():
    result = scan([Thing(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))])
    angles = ray_angles(result)
    with np.errstate(divide="ignore"):
        expected = np.where(np.cos(angles) > 3.0 / 12.0, 3.0 / np.cos(angles), math.inf)
    np.testing.assert_allclose(result.ranges, expected, atol=EXACT)


def test_ray_at_a_corner_of_a_box_is_as_long_as_the_corner_is_far():
    turned_by = math.radians(45.0)
    result = scan([Thing(BOX, (0.5, 0.5, 1.0), (3.0, 0.0, 0.0), turned(yaw=turned_by))])
    assert result.ranges[0] == pytest.approx(3.0 - math.sqrt(0.5), abs=EXACT)


def test_two_edges_of_a_turned_box_meet_at_its_near_corner():
    near = 3.0 - math.sqrt(0.5)  # each edge leans back by 45 degrees: x = near + |y|
    result = scan([Thing(BOX, (0.5, 0.5, 1.0), (3.0, 0.0, 0.0), turned(yaw=math.radians(45.0)))])
    for degrees in (-10, -5, 0, 5, 10):
        angle = math.radians(degrees)
        assert result.ranges[degrees] == pytest.approx(near / (math.cos(angle) - abs(math.sin(angle))), abs=EXACT)


@pytest.mark.parametrize("kind", [CYLINDER, SPHERE])
def test_round_things_are_met_where_their_circle_is(kind):
    distance, radius = 2.0, 0.5
    size = (radius, 1.0) if kind == CYLINDER else (radius,)
    result = scan([Thing(kind, size, (0.0, distance, HEIGHT))])
    angles = ray_angles(result) - math.pi / 2.0
    chord = radius**2 - (distance * np.sin(angles)) ** 2
    hit = (chord >= 0.0) & (np.cos(angles) > 0.0)
    expected = np.where(hit, distance * np.cos(angles) - np.sqrt(np.maximum(chord, 0.0)), math.inf)
    np.testing.assert_allclose(result.ranges, expected, atol=EXACT)
    assert hit.sum() == 2 * math.floor(math.degrees(math.asin(radius / distance))) + 1


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.1), (0.05, 0.0), (0.1, -0.2)])
def test_tilted_sensor_sees_the_floor(roll, pitch):
    q = quaternion_from_euler(roll, pitch, 0.7)
    result = scan([], LidarSpec(rays=720), orientation=q)
    fall = np.array([-rotate(q, (math.cos(a), math.sin(a), 0.0))[2] for a in ray_angles(result)])
    with np.errstate(divide="ignore"):
        expected = np.where(fall > HEIGHT / 12.0, HEIGHT / fall, math.inf)
    np.testing.assert_allclose(result.ranges, expected, atol=EXACT)


def test_tilted_sensor_looks_over_a_low_box_that_a_level_one_sees():
    box = Thing(BOX, (0.1, 0.1, 0.15), (2.0, 0.0, 0.15))
    assert scan([box]).ranges[0] == pytest.approx(1.9, abs=EXACT)
    looking_up = quaternion_from_euler(0.0, -0.1, 0.0)
    assert scan([box], orientation=looking_up).ranges[0] == math.inf


def test_leaning_box_is_met_on_its_sloping_face():
    lean = 0.3  # about y: the face turned to the sensor leans away, its distance along a level ray is d / cos(lean)
    result = scan([Thing(BOX, (0.5, 2.0, 2.0), (3.0, 0.0, HEIGHT), turned(pitch=lean))])
    for degrees in (-20, 0, 15):
        expected = (3.0 - 0.5 / math.cos(lean)) / math.cos(math.radians(degrees))
        assert result.ranges[degrees] == pytest.approx(expected, abs=EXACT)


def test_lying_cylinder_shows_its_side_and_its_caps():
    lying = Thing(CYLINDER, (0.2, 1.0), (3.0, 0.0, HEIGHT), turned(roll=math.pi / 2.0))  # its axis along y
    result = scan([lying])
    assert result.ranges[0] == pytest.approx(2.8, abs=EXACT)
    pointing = Thing(CYLINDER, (0.2, 1.0), (3.0, 0.0, HEIGHT), turned(pitch=math.pi / 2.0))  # its cap ahead
    assert scan([pointing]).ranges[2] == pytest.approx(2.0 / math.cos(math.radians(2.0)), abs=EXACT)


def test_nearest_of_many_wins_in_any_order():
    things = [Thing(SPHERE, (0.3,), (x, 0.0, HEIGHT)) for x in (4.0, 2.0, 6.0)]
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        assert scan([things[i] for i in order]).ranges[0] == pytest.approx(1.7, abs=EXACT)


def test_lidar_sees_other_vehicles_but_not_its_own():
    own, other = (
        Thing(BOX, (0.1,) * 3, (0.0, 0.0, HEIGHT), vehicle=0),
        Thing(BOX, (0.1,) * 3, (0, 1, HEIGHT), vehicle=1),
    )
    assert scan([own, other]).ranges[90] == pytest.approx(0.9, abs=EXACT)
    assert np.isneginf(scan([own, other], vehicle=1).ranges).all()  # inside the other's box


def test_scan_is_from_the_mount_in_its_axes():
    spec = LidarSpec(mount=Mount(position=(0.5, 0.0, 0.1), rotation_deg=(0.0, 0.0, 90.0)))
    wall = Thing(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))
    assert scan([wall], spec).ranges[270] == pytest.approx(
        2.5, abs=EXACT
    )  # ahead of the vehicle is right of the sensor


# -- limits -----------------------------------------------------------------------------------------------------


def test_too_near_is_minus_infinity_and_too_far_plus_infinity():
    things = [
        Thing(BOX, (1.0, 0.1, 1.0), (1.149, 0.0, 0.0)),  # ahead, 1 mm too near
        Thing(BOX, (0.1, 1.0, 1.0), (0.0, 1.151, 0.0)),  # left, 1 mm beyond the minimum
        Thing(BOX, (1.0, 0.1, 1.0), (-12.999, 0.0, 0.0)),  # behind, 1 mm within the maximum
        Thing(BOX, (0.1, 1.0, 1.0), (0.0, -13.001, 0.0)),  # right, 1 mm too far
    ]
    ranges = scan(things).ranges[[0, 90, 180, 270]]
    np.testing.assert_allclose(ranges, (-math.inf, 0.151, 11.999, math.inf), atol=EXACT)


@pytest.mark.parametrize("kind", [BOX, CYLINDER, SPHERE])
def test_inside_a_solid_everything_is_too_near(kind):
    assert np.isneginf(scan([Thing(kind, (1.0, 1.0, 1.0), (0.2, 0.1, HEIGHT), turned(0.1, 0.2, 0.3))]).ranges).all()


def test_in_the_open_nothing_is_seen():
    result = scan([])
    assert np.isposinf(result.ranges).all()
    assert (result.intensities == 47.0).all()


# -- configuration ----------------------------------------------------------------------------------------------


def test_default_is_that_of_the_report():
    result = scan([])
    assert (len(result.ranges), result.angle_min, math.degrees(result.angle_increment)) == (360, 0.0, 1.0)
    assert (result.range_min, result.range_max, result.scan_rate, result.time_increment) == (0.15, 12.0, 7.0, 0.0)


def test_1080_rays_at_40_hz_are_one_line():
    line = "{rays: 1080, rate: 40, angle_min_deg: -135, angle_increment_deg: 0.25, range_min: 0.06, range_max: 10}"
    result = scan([Thing(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))], parse(line, LidarSpec))
    assert result.scan_rate == 40.0
    assert result.ranges[540] == pytest.approx(3.0, abs=EXACT)
    assert math.degrees(result.angle_min + 1079 * result.angle_increment) == pytest.approx(134.75)


@pytest.mark.parametrize(
    "spec",
    [
        LidarSpec(rays=181, angle_min_deg=-90, angle_max_deg=90),
        LidarSpec(rays=181, angle_min_deg=90, angle_max_deg=-90),
        LidarSpec(rays=361, angle_min_deg=-180, angle_max_deg=180),
        LidarSpec(rays=360, angle_min_deg=180, angle_increment_deg=-1),
        LidarSpec(rays=1, angle_min_deg=-30),
        LidarSpec(rays=7, angle_min_deg=350, angle_increment_deg=3.3),
    ],
)
def test_any_field_of_view_is_a_choice_of_the_same_rays(spec):
    rng = np.random.default_rng(5)
    things = [random_thing(rng) for _ in range(20)]
    result = scan(things, spec)
    single = [
        scan(things, LidarSpec(rays=1, angle_min_deg=math.degrees(a) % 360)).ranges[0] for a in ray_angles(result)
    ]
    # an angle that goes through degrees and back errs by 1e-15 rad, which a grazing ray shows a hundredfold
    np.testing.assert_allclose(result.ranges, single, atol=EXACT)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"rays": 362, "angle_increment_deg": 1}, "spread over 361 deg; a scan spans 360 at most"),
        ({"range_min": 5, "range_max": 4}, "range_max 4 m must be above range_min 5 m"),
        ({"angle_max_deg": 90, "angle_increment_deg": 1}, "not by both"),
        ({"rays": 1, "angle_max_deg": 90}, "needs no angle_max_deg"),
        ({"angle_increment_deg": 0}, "increment is 0"),
    ],
)
def test_faulty_spec_is_refused(fields, text):
    with pytest.raises(ValidationError, match=text):
        LidarSpec(**fields)


# -- those who know better --------------------------------------------------------------------------------------


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
def test_approximate_bearing_errs_by_what_the_handbook_says(x, y):
    if max(abs(x), abs(y)) > 1e-200:
        assert abs(approximate_bearing(x, y) - math.atan2(y, x)) <= 1.2e-5  # 1e-5, its coefficients have 7 digits


def random_thing(rng, is_upright=False):
    kind = int(rng.choice([BOX, CYLINDER, SPHERE]))
    size = rng.uniform(0.05, 0.8, {BOX: 3, CYLINDER: 2, SPHERE: 1}[kind])
    if kind == BOX and rng.random() < 0.3:
        size[int(rng.integers(3))] = 5.0  # a wall or a beam
    bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(1.0, 9.0)
    position = (distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(-0.2, 0.6))
    tilt = 0.0 if is_upright else rng.choice([0.02, 3.0])
    roll, pitch, yaw = rng.uniform(-1, 1, 3) * (tilt, tilt, math.pi)
    return Thing(kind, size, position, turned(roll, pitch, yaw))


def mujoco_ranges(things, position, orientation, angles):
    """What mj_ray, an independent implementation, says of each ray; +inf is nothing."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
    for thing in things:
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


@pytest.mark.parametrize("is_upright", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_random_scenes_agree_with_mujoco(seed, is_upright):
    rng = np.random.default_rng(seed)
    things = [random_thing(rng, is_upright) for _ in range(30)]
    things = [t for t in things if np.linalg.norm(t.position - (0, 0, HEIGHT)) > t.bounding_radius]  # else inside
    tilt = float(rng.choice([0.0, 0.003, 0.05, 0.5]))
    q = quaternion_from_euler(*(rng.uniform(-1, 1, 3) * (tilt, tilt, math.pi)))
    result = scan(things, LidarSpec(rays=540, range_min=0.0), orientation=q)
    expected = mujoco_ranges(things, (0.0, 0.0, HEIGHT), q, ray_angles(result))
    np.testing.assert_allclose(result.ranges, expected, rtol=0.0, atol=EXACT)
    assert np.isfinite(result.ranges).mean() > 0.3


@settings(max_examples=50)
@given(st.integers(0, 359), st.integers(0, 1000))
def test_turning_the_car_by_a_degree_moves_the_scan_by_an_index(degrees, seed):
    rng = np.random.default_rng(seed)
    things = [random_thing(rng) for _ in range(10)]
    still = scan(things).ranges
    q = quaternion_from_yaw(math.radians(degrees))
    moved = np.roll(scan(things, orientation=q).ranges, degrees)
    agree = np.isclose(still, moved, rtol=0.0, atol=1e-7)  # grazing rays show the rounding of the angle ...
    assert (~agree).sum() <= 1  # ... and one at an outline may go either way


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
@settings(max_examples=50)
def test_moving_the_whole_world_changes_nothing(x, y, yaw):
    rng = np.random.default_rng(11)
    things = [random_thing(rng) for _ in range(10)]
    turn = np.array(turned(yaw=yaw)).reshape(3, 3)
    others = [Thing(t.kind, t.size, turn @ t.position + (x, y, 0), turn @ t.rotation) for t in things]
    there = scan(others, position=(x, y, HEIGHT), orientation=quaternion_from_yaw(yaw)).ranges
    agree = np.isclose(scan(things).ranges, there, rtol=0.0, atol=1e-7)
    assert (~agree).sum() <= 1


# -- rolling ----------------------------------------------------------------------------------------------------


def drive(spec, things, pose_at, ticks, dt=1.0 / 60.0, move=None):
    """All complete scans of a rolling LIDAR on a vehicle with that position and orientation over time."""
    lidar = RollingLidar(spec)
    lidar.reset(np.random.default_rng(0))
    scans = []
    for k in range(ticks + 1):
        time = k * dt
        position, orientation = pose_at(time)
        for thing in things:
            if move is not None:
                thing.position = np.array(move(time))
        shapes, state = scene(things, vehicle_position=[position], vehicle_orientation=[orientation])
        newest = lidar.sample(shapes, state, 0, time)
        if newest is not lidar.latest:
            scans.append(newest)
        lidar.latest = newest
    return scans


def ray_times(result):
    return result.time - result.time_increment * np.arange(len(result.ranges) - 1, -1, -1)


def test_rolling_scan_of_a_moving_car_measures_each_ray_from_where_it_was():
    speed = 0.5
    wall = Thing(BOX, (0.5, 50.0, 1.0), (6.5, 0.0, 0.0))
    still = (1.0, 0.0, 0.0, 0.0)
    scans = drive(LidarSpec(is_rolling=True), [wall], lambda t: ((speed * t, 0.0, HEIGHT), still), 60)
    assert [s.time for s in scans] == pytest.approx([n / 7.0 for n in range(1, 8)])
    for result in scans:
        cos = np.cos(ray_angles(result))
        with np.errstate(divide="ignore"):
            distance = (6.0 - speed * ray_times(result)) / cos
        np.testing.assert_allclose(
            result.ranges, np.where((cos > 0) & (distance <= 12.0), distance, math.inf), atol=EXACT
        )


def test_rolling_scan_of_a_turning_car_is_skewed_by_its_turn():
    rate = 0.8
    wall = Thing(BOX, (0.5, 50.0, 1.0), (3.5, 0.0, 0.0))
    spec = LidarSpec(is_rolling=True, rays=271, angle_min_deg=-135, angle_max_deg=135)
    scans = drive(spec, [wall], lambda t: ((0.0, 0.0, HEIGHT), quaternion_from_yaw(rate * t)), 60)
    for result in scans:
        cos = np.cos(ray_angles(result) + rate * ray_times(result))
        np.testing.assert_allclose(result.ranges, np.where(cos > 0.25, 3.0 / cos, math.inf), atol=EXACT)
    assert scans[0].time_increment == pytest.approx(1.0 / (7.0 * 360.0))  # the head turns once a period


def test_rolling_scan_sees_a_moving_box_where_it_was_at_each_ray():
    speed = 0.6
    box = Thing(BOX, (0.5, 50.0, 1.0), (0.0, 0.0, 0.0))
    still = ((0.0, 0.0, HEIGHT), (1.0, 0.0, 0.0, 0.0))
    scans = drive(LidarSpec(is_rolling=True), [box], lambda t: still, 40, move=lambda t: (3.5 + speed * t, 0.0, 0.0))
    for result in scans:
        cos = np.cos(ray_angles(result))
        with np.errstate(divide="ignore"):
            distance = (3.0 + speed * ray_times(result)) / cos
        np.testing.assert_allclose(
            result.ranges, np.where((cos > 0) & (distance <= 12.0), distance, math.inf), atol=EXACT
        )


@pytest.mark.parametrize("seed", range(6))
def test_rolling_scan_at_rest_is_the_instantaneous_one(seed):
    # two implementations of the same thing: outlines drawn into a fan, and rays cast one by one
    rng = np.random.default_rng(seed)
    things = [t for t in (random_thing(rng) for _ in range(30)) if np.linalg.norm(t.position) > t.bounding_radius + 0.3]
    q = compose(quaternion_from_yaw(rng.uniform(-3, 3)), quaternion_from_euler(*rng.uniform(-0.05, 0.05, 2), 0.0))
    rolling = drive(LidarSpec(is_rolling=True, rays=720), things, lambda t: ((0.0, 0.0, HEIGHT), q), 10)[0]
    instant = scan(things, LidarSpec(rays=720), orientation=q)
    np.testing.assert_allclose(rolling.ranges, instant.ranges, rtol=0.0, atol=EXACT)


def test_rolling_lidar_faster_than_the_ticks_reports_the_newest_scan():
    still = ((0.0, 0.0, HEIGHT), (1.0, 0.0, 0.0, 0.0))
    scans = drive(LidarSpec(is_rolling=True, rate=100.0), [], lambda t: still, 6, dt=0.05)
    assert [s.time for s in scans] == pytest.approx([0.05, 0.10, 0.15, 0.20, 0.25, 0.30])
