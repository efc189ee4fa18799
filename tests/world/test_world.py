"""World.step, and commands, lights, sensors, teleport and reset of a world."""

# pyright: reportPossiblyUnboundVariable=false
# A loop over a fixed number of ticks leaves its last Frame.

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import CommandError, EngineError
from autodrive.base.transforms import euler_from_quaternion
from autodrive.protocol.messages import Command, Frame, Headlights, Indicators, TailLights
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.cars import OBEYS_AT_ONCE, car_file
from tests.support.frames import arrays, digest, digests

LIMIT = math.radians(30.0)
STANDING = Command()


def plane(**changes: Any) -> World:
    return autodrive.make(ScenarioSpec(**changes))


def two_cars(**changes: Any) -> World:
    return plane(vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(y=2.0)}, **changes)


def drive(world: World, ticks: int, **command: Any) -> Frame:
    frame = world.frame
    for _ in range(ticks):
        frame = world.step({"V1": Command(**command)})
    return frame


# -- time and Frames ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("tick", "substep"), [(0.01, 0.001), (0.02, 0.0005), (0.005, 0.005), (0.1, 0.002)])
def test_time_is_the_number_of_ticks_times_the_tick_without_drift(tick: float, substep: float) -> None:
    world = plane(tick=tick, substep=substep)
    assert (world.frame.tick, world.frame.time, world.tick_duration) == (0, 0.0, tick)
    for k in range(1, 200):
        frame = world.step()
        assert (frame.tick, frame.time) == (k, float(k * Fraction(str(tick))))
        assert frame is world.frame
        assert frame.time == world.time
        assert frame.vehicles["V1"].imu.time == frame.time


def test_a_frame_is_read_only() -> None:
    world = plane(boxes={"box": BoxSpec(x=0.36, y=0.0)})
    frames = [drive(world, 1, throttle=1.0) for _ in range(100)]
    frame = frames[-1]
    assert any(past.events for past in frames)
    found = [array for past in frames for array in arrays(past)]
    assert len(arrays(frame)) > 20
    assert not [array for array in found if array.flags.writeable]
    with pytest.raises(AttributeError):
        frame.time = 0.0  # pyright: ignore[reportAttributeAccessIssue]


def test_later_ticks_do_not_change_a_frame() -> None:
    world = plane(boxes={"box": BoxSpec(x=0.36, y=0.0)})
    frame = drive(world, 50, throttle=1.0)
    before = digest(frame)
    drive(world, 50, throttle=-1.0)
    world.teleport("V1", 1.0, 1.0)
    world.reset()
    assert digest(frame) == before


# -- commands ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("throttle", "steering"), [(3.0, 0.0), (-1e9, 2.0), (0.5, -1e308)])
def test_commands_beyond_one_count_as_one(throttle: float, steering: float) -> None:
    beyond, clamped = plane(), plane()
    for _ in range(60):
        a = beyond.step({"V1": Command(throttle, steering)})
        b = clamped.step({"V1": Command(max(-1.0, min(1.0, throttle)), max(-1.0, min(1.0, steering)))})
        assert digest(a) == digest(b)


@pytest.mark.parametrize(
    ("tick", "timeout"), [(0.01, 0.5), (0.01, 0.07), (0.02, 0.5), (0.1, 0.3), (0.01, 0.29), (0.02, 0.03), (0.01, 0.003)]
)
def test_a_command_acts_in_the_ticks_that_begin_before_the_timeout(tmp_path: Path, tick: float, timeout: float) -> None:
    car = VehiclePlacement(type=car_file(tmp_path, OBEYS_AT_ONCE))
    world = plane(vehicles={"V1": car}, tick=tick, command_timeout=timeout)
    frames = [world.step({"V1": Command(throttle=0.5, steering=1.0)})]
    acting = math.ceil(round(timeout / tick, 9))
    frames += [world.step() for _ in range(acting)]
    assert [frame.vehicles["V1"].throttle for frame in frames] == [0.5] * acting + [0.0]
    assert frames[-1].vehicles["V1"].lights.tail_lights == TailLights.BRIGHT


def test_a_car_without_commands_brakes_and_straightens_its_wheels() -> None:
    world = plane()
    assert drive(world, 100, throttle=1.0, steering=1.0).vehicles["V1"].steering == pytest.approx(LIMIT)
    for _ in range(49):
        assert world.step().vehicles["V1"].throttle == 1.0
    for _ in range(100):
        vehicle = world.step().vehicles["V1"]
    assert vehicle.throttle == 0.0
    assert vehicle.steering == pytest.approx(0.0, abs=1e-9)  # e^(-1 s / 20 ms)
    assert np.abs(vehicle.velocity).max() < 1e-4  # stands; the springs have almost calmed down
    assert not vehicle.wheels.angular_velocity.any()


def test_a_repeated_command_keeps_the_car_moving() -> None:
    world = plane()
    for k in range(200):
        frame = world.step({"V1": Command(throttle=1.0)} if k % 40 == 0 else None)
    assert frame.vehicles["V1"].throttle == 1.0


def test_a_vehicle_without_a_command_stands_still() -> None:
    world = two_cars()
    start = world.frame.vehicles["V2"].pose.position
    vehicle = drive(world, 200, throttle=1.0, steering=-0.2).vehicles["V2"]
    assert np.abs(vehicle.pose.position - start).max() < 1e-9  # rounding alone


def test_each_vehicle_obeys_its_own_commands() -> None:
    world, left, right = two_cars(), plane(), plane()
    a, b = Command(throttle=0.8, steering=0.7), Command(throttle=-0.5, steering=-0.3)
    for _ in range(150):
        both = world.step({"V2": b, "V1": a})
        first, two = left.step({"V1": a}), right.step({"V1": b})
    assert digest(both.vehicles["V1"].pose) == digest(first.vehicles["V1"].pose)
    moved = both.vehicles["V2"].pose.position - (0.0, 2.0, 0.0)
    assert moved == pytest.approx(two.vehicles["V1"].pose.position, abs=1e-9)  # rounding about y = 2, grown over 1.5 s


# -- lights ------------------------------------------------------------------------------------------------------


def test_headlights_and_indicators_keep_their_state_until_the_next_command() -> None:
    world = plane()
    drive(world, 1, headlights=Headlights.HIGH, indicators=Indicators.HAZARD)
    for frame in (drive(world, 30), world.step(), drive(world, 200, throttle=0.1)):
        lights = frame.vehicles["V1"].lights
        assert (lights.headlights, lights.indicators) == (Headlights.HIGH, Indicators.HAZARD)
    lights = drive(world, 1, headlights=Headlights.LOW).vehicles["V1"].lights
    assert (lights.headlights, lights.indicators) == (Headlights.LOW, Indicators.HAZARD)
    lights = drive(world, 1, indicators=Indicators.OFF).vehicles["V1"].lights
    assert (lights.headlights, lights.indicators) == (Headlights.LOW, Indicators.OFF)


@pytest.mark.parametrize("since", [0, 37])
def test_indicators_blink_at_one_hertz_dark_first_from_the_moment_they_are_switched_on(since: int) -> None:
    world = plane()
    drive(world, since)
    for k in range(1, 1001):
        lights = drive(world, 1, indicators=Indicators.LEFT).vehicles["V1"].lights
        assert lights.left_indicator == (k % 100 >= 50), k
        assert not lights.right_indicator


def test_the_blinking_continues_when_the_side_changes_and_restarts_after_off() -> None:
    world = plane()
    drive(world, 60, indicators=Indicators.LEFT)
    lights = drive(world, 1, indicators=Indicators.RIGHT).vehicles["V1"].lights
    assert (lights.left_indicator, lights.right_indicator) == (False, True)
    drive(world, 1, indicators=Indicators.OFF)
    assert not drive(world, 49, indicators=Indicators.RIGHT).vehicles["V1"].lights.right_indicator
    assert drive(world, 1, indicators=Indicators.RIGHT).vehicles["V1"].lights.right_indicator


def test_tail_lights_are_bright_while_braking_partial_with_headlights_and_else_off() -> None:
    def tail(**command: Any) -> TailLights:
        return drive(world, 2, **command).vehicles["V1"].lights.tail_lights  # a dead time of 10 ms

    world = plane()
    assert world.frame.vehicles["V1"].lights.tail_lights == TailLights.BRIGHT
    assert tail(throttle=0.3) == TailLights.OFF
    assert tail(throttle=0.3, headlights=Headlights.LOW) == TailLights.PARTIAL
    assert tail(throttle=0.3, headlights=Headlights.HIGH) == TailLights.PARTIAL
    assert tail(throttle=0.0) == TailLights.BRIGHT
    assert tail(throttle=-0.3, headlights=Headlights.OFF) == TailLights.OFF


def test_reverse_lights_are_on_from_the_command_until_the_wheels_turn_forward() -> None:
    world = plane()
    assert not drive(world, 100, throttle=1.0).vehicles["V1"].lights.reverse_lights
    assert drive(world, 2, throttle=-0.5).vehicles["V1"].lights.reverse_lights
    assert drive(world, 100, throttle=-0.5).vehicles["V1"].lights.reverse_lights
    for _ in range(100):
        vehicle = drive(world, 1, throttle=0.5).vehicles["V1"]
        rear = vehicle.wheels.angular_velocity[2:].mean()
        assert vehicle.lights.reverse_lights == (vehicle.throttle < 0.0 or rear < -0.05 * 2.0 * math.pi / 60.0)
    assert not vehicle.lights.reverse_lights
    drive(world, 100, throttle=-0.5)
    assert not drive(world, 100).vehicles["V1"].lights.reverse_lights  # braked and standing


# -- requests ----------------------------------------------------------------------------------------------------


def test_a_teleported_vehicle_stands_where_it_was_put() -> None:
    world = two_cars()
    drive(world, 100, throttle=1.0, steering=0.5)
    ticks = world.frame.vehicles["V1"].encoders.ticks
    world.teleport("V1", -3.0, 4.0, 2.0)
    vehicle = world.frame.vehicles["V1"]
    assert vehicle.pose.position == pytest.approx((-3.0, 4.0, 0.0325))
    assert euler_from_quaternion(vehicle.pose.orientation) == pytest.approx((0.0, 0.0, 2.0))
    assert not vehicle.velocity.any()
    assert not vehicle.angular_velocity.any()
    after = world.step({"V1": STANDING}).vehicles["V1"]
    assert after.ips.position == pytest.approx((-3.0, 4.0, 0.0325), abs=1e-3)  # brakes have a dead time of 10 ms
    for _ in range(100):
        after = world.step({"V1": STANDING}).vehicles["V1"]
    assert after.pose.position == pytest.approx((-3.0, 4.0, 0.0325), abs=3e-3)
    full_speed = 130 / 60 * 1920  # ticks a second
    assert np.abs(after.encoders.ticks - ticks).max() <= 0.01 * full_speed + 1  # they were driven for those 10 ms


def test_a_reset_world_equals_a_new_one() -> None:
    spec = ScenarioSpec(map="mini_map", boxes={"box": BoxSpec(x=0.36, y=0.0)})
    world, new = autodrive.make(spec), autodrive.make(spec)
    drive(world, 90, throttle=1.0, steering=0.3, headlights=Headlights.LOW, indicators=Indicators.HAZARD)
    world.teleport("V1", 5.0, 5.0)
    world.set_scene_light(False)
    world.set_driving_mode("V1", False)
    assert digest(world.reset()) == digest(new.frame)

    def again(frame: Frame) -> dict[str, Command]:
        return {"V1": Command(throttle=1.0)} if frame.tick < 20 else {}

    assert digests(world, 150, again) == digests(new, 150, again)


def test_a_new_seed_stays_until_the_next(tmp_path: Path) -> None:
    car = car_file(tmp_path, {"sensors.imu.noise": "realistic"})
    spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car)})
    world = autodrive.make(spec, seed=1)
    first = digests(world, 5, lambda _: {})
    world.reset(seed=2)
    second = digests(world, 5, lambda _: {})
    world.reset()
    assert digests(world, 5, lambda _: {}) == second == digests(autodrive.make(spec, seed=2), 5, lambda _: {}) != first


def test_scene_light_and_driving_mode_change_at_once_and_stay() -> None:
    world = two_cars()
    assert world.frame.scene_light
    assert world.frame.vehicles["V2"].is_autonomous
    world.set_scene_light(False)
    world.set_driving_mode("V2", False)
    for frame in (world.frame, world.step()):
        assert not frame.scene_light
        assert not frame.vehicles["V2"].is_autonomous
        assert frame.vehicles["V1"].is_autonomous


def test_a_reset_places_vehicles_and_objects_and_every_sensor_reads_there() -> None:
    box = {"box": BoxSpec(x=1.0, y=0.0, size=(0.3, 0.3, 0.3))}
    world = plane(boxes=box)
    drive(world, 20, throttle=1.0)
    frame = world.reset(5, poses={"V1": (1.0, 2.0, 0.5 * math.pi), "box": (1.0, 3.0, 0.0)})
    car = frame.vehicles["V1"]
    assert car.ips.position == pytest.approx([1.0, 2.0, car.pose.position[2]])
    assert car.lidar is not None
    assert car.lidar.ranges[0] == pytest.approx(1.0 - 0.15 - 0.1445, abs=1e-3)  # to the box, from the mount
    assert frame.tick == 0
    fresh = plane(boxes=box)
    fresh.reset(5, poses={"V1": (1.0, 2.0, 0.5 * math.pi), "box": (1.0, 3.0, 0.0)})
    commands = lambda _: {"V1": Command(throttle=1.0)}  # noqa: E731
    assert digests(world, 30, commands) == digests(fresh, 30, commands)
    assert world.reset().vehicles["V1"].pose.position[0] == 0.0  # only that time


def test_a_restore_recovers_from_a_diverged_state_in_contact_with_a_box() -> None:
    world = plane(boxes={"box": BoxSpec(x=0.36, y=0.0)})
    drive(world, 60, throttle=1.0)  # it pushes
    saved = world.save()
    future = digests(world, 50, lambda _: {"V1": Command(throttle=1.0)})
    world.compiled.state.qpos[2] = math.nan
    with pytest.raises(EngineError, match="unstable"):
        drive(world, 1)
    world.restore(saved)
    assert digests(world, 50, lambda _: {"V1": Command(throttle=1.0)}) == future


# -- views and sensors -------------------------------------------------------------------------------------------


def test_a_view_reads_the_ground_truth_of_the_frame() -> None:
    world = two_cars()
    view = world.vehicle("V1")
    vehicle = drive(world, 40, throttle=1.0, steering=0.5).vehicles["V1"]
    assert view.steering_angle == vehicle.steering
    assert view.throttle == vehicle.throttle
    assert view.position.tolist() == vehicle.pose.position.tolist()
    for i, name in enumerate(("front_left", "front_right", "rear_left", "rear_right")):
        for field in ("slip_ratio", "slip_angle", "angular_velocity", "normal_load", "compression", "steering_angle"):
            values = getattr(vehicle.wheels, field)
            assert getattr(view.wheel(name), field) == values[i]
    assert view.wheel("rear_left").slip_ratio > 0.0
    assert world.vehicle("V2").wheel("rear_left").slip_ratio == pytest.approx(0.0, abs=1e-9)
    view.position[:] = 9.0  # a copy
    assert view.position.tolist() == vehicle.pose.position.tolist()
    with pytest.raises(CommandError, match="V5"):
        world.vehicle("V5")


def test_a_held_vehicle_stays_at_its_pose_until_the_hold_ends() -> None:
    world = plane(vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(y=2.0)})
    pose = (1.0, -2.0, 0.2), (0.0, 0.0, 0.0, -2.0)
    world.hold("V1", *pose)
    for _ in range(50):
        vehicle = world.step({"V1": Command(throttle=1.0)}).vehicles["V1"]
        assert vehicle.pose.position.tolist() == [1.0, -2.0, 0.2]  # in the air, against gravity
        assert np.abs(vehicle.pose.orientation).tolist() == [0.0, 0.0, 0.0, 1.0]
        assert vehicle.speed == 0.0
    saved = world.save()
    later = digest(world.step())
    world.restore(saved)
    assert digest(world.step()) == later
    world.hold("V1", None)
    for _ in range(200):
        frame = world.step()
    assert frame.vehicles["V1"].pose.position[2] == pytest.approx(frame.vehicles["V2"].pose.position[2], abs=0.01)
    with pytest.raises(CommandError, match="V7"):
        world.hold("V7", None)


@pytest.mark.parametrize("ticks", [1, 3])
def test_a_held_vehicle_that_is_moved_reports_its_speed(ticks: int) -> None:
    """As a co-simulation moves it, on a circle of 2 m at 3 m/s; then it rests."""
    world = plane(vehicles={"V1": VehiclePlacement()})
    for tick in range(30):
        angle = 1.5 * 0.01 * tick
        if tick % ticks == 0:
            position = 2.0 * math.sin(angle), 2.0 * (1.0 - math.cos(angle)), 0.5
            world.hold("V1", position, (math.cos(angle / 2.0), 0.0, 0.0, math.sin(angle / 2.0)))
        car = world.step().vehicles["V1"]
        assert car.pose.position.tolist() == pytest.approx(position, abs=0.0)
        if tick >= ticks:
            assert car.speed == pytest.approx(3.0, rel=0.002)
            assert car.angular_velocity.tolist() == pytest.approx([0.0, 0.0, 1.5], abs=1e-6)
    for _ in range(ticks):
        car = world.step().vehicles["V1"]
    assert car.speed == 0.0


@pytest.mark.parametrize("goes", ["away", "free"])
def test_a_box_falls_when_the_held_car_under_it_goes(goes: str) -> None:
    """What sleeps is woken when a held car comes, moves or goes: the car may have carried it."""
    boxes = {"box": BoxSpec(x=0.131, y=0.0, z=0.6, mass=0.2), "far": BoxSpec(x=2.0, y=2.0)}
    world = plane(vehicles={"V1": VehiclePlacement()}, boxes=boxes)
    world.hold("V1", (0.0, 0.0, 0.3))
    for _ in range(200):
        high = world.step().objects["box"].pose.position[2]
    far = [*boxes].index("far")
    assert high > 0.35
    assert world.compiled.state.asleep[far] >= 0.0
    world.hold("V1", (3.0, 0.0, 0.3) if goes == "away" else None)
    assert world.compiled.state.asleep[far] < 0.0
    for _ in range(100):
        low = world.step().objects["box"].pose.position[2]
    assert low < high - 0.1


def test_the_light_follows_the_time_of_day() -> None:
    world = plane()
    assert (world.frame.scene_light, world.frame.time_of_day) == (True, None)
    world.set_time_of_day(5.9 * 3600.0, scale=3600.0)
    assert not world.frame.scene_light
    saved = world.save()
    for _ in range(20):
        frame = world.step()
    assert frame.scene_light  # 0.2 s later it is 6:06
    assert frame.time_of_day == pytest.approx(6.1 * 3600.0)
    world.restore(saved)
    assert world.step().time_of_day == pytest.approx(5.91 * 3600.0)
    world.set_time_of_day(None)
    assert world.step().time_of_day == pytest.approx(5.91 * 3600.0)
    world.set_scene_light(True)
    assert (world.frame.scene_light, world.frame.time_of_day) == (True, None)
    with pytest.raises(CommandError, match="finite"):
        world.set_time_of_day(math.inf)
    assert world.reset().time_of_day is None


@pytest.mark.parametrize("is_rolling", [False, True])
def test_a_line_of_yaml_makes_1080_rays_at_40_hertz(tmp_path: Path, is_rolling: bool) -> None:
    lidar = {"rate": 40.0, "rays": 1080, "angle_min_deg": -135.0, "angle_increment_deg": 0.25, "is_rolling": is_rolling}
    car = car_file(tmp_path, {"sensors.lidar": lidar})
    world = plane(vehicles={"V1": VehiclePlacement(type=car)}, boxes={"box": BoxSpec(x=0.6, y=0.0)})
    times = []
    for frame in (world.reset(), *(world.step() for _ in range(100))):
        scan = frame.vehicles["V1"].lidar
        assert scan is not None
        if scan.time not in times:
            times.append(scan.time)
            assert scan.ranges.shape == scan.intensities.shape == (1080,)
            assert scan.scan_rate == 40.0
            assert np.isfinite(scan.ranges).any()
    assert len(times) == 41
    due = np.arange(41) / 40.0
    # a scan at one instant is made in the first tick that is due; the last ray of a rolling one leaves just in time
    assert times == pytest.approx(due if is_rolling else np.ceil(due / 0.01 - 1e-9) * 0.01, abs=1e-9)


def test_lidar_sees_a_box_and_another_car_where_they_are() -> None:
    world = plane(
        vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(x=1.5)},
        boxes={"box": BoxSpec(x=0.1445, y=0.8, size=(0.2, 0.1, 0.4))},
    )
    for _ in range(15):
        frame = world.step()
    scan, other = frame.vehicles["V1"].lidar, frame.vehicles["V2"].lidar
    assert scan is not None and other is not None  # noqa: PT018
    # the LIDAR stands at x = 0.1445; its collider, 0.07 long about x = 0.131, is what it sees of the other car
    tolerance = 1e-6  # the springs have settled to less
    assert scan.ranges[0] == pytest.approx(1.5 + 0.131 - 0.035 - 0.1445, abs=tolerance)
    assert scan.ranges[90] == pytest.approx(0.8 - 0.05, abs=tolerance)
    assert np.isposinf(scan.ranges[[45, 180, 270]]).all()
    assert other.ranges[180] == pytest.approx(1.5 + 0.1445 - 0.131 - 0.035, abs=tolerance)
    slanting = math.atan2(0.8, -1.5)  # the bearing of the box from V2
    hit = round(math.degrees(slanting))
    expected = 0.75 / math.sin(math.radians(hit))  # its near face is the line y = 0.75
    assert other.ranges[hit] == pytest.approx(expected, abs=tolerance)


def test_sensors_agree_with_the_ground_truth_of_their_frame() -> None:
    world = plane()
    before = world.frame.vehicles["V1"]
    for k in range(300):
        now = drive(world, 1, throttle=math.sin(0.02 * k), steering=math.cos(0.03 * k)).vehicles["V1"]
        assert now.ips.position.tolist() == now.pose.position.tolist()
        assert now.imu.orientation == pytest.approx(now.pose.orientation, abs=1e-15)  # composed with a unit mount
        assert now.imu.angular_velocity == pytest.approx(now.angular_velocity, abs=1e-12)
        expected = np.trunc(now.wheels.rotation_angle[2:] * 1920 / (2 * math.pi))
        assert now.encoders.ticks.tolist() == expected.tolist()
        assert now.encoders.angles == pytest.approx(expected * 2 * math.pi / 1920, abs=1e-12)
        turned = (now.wheels.rotation_angle - before.wheels.rotation_angle)[2:].mean()
        assert abs(turned) <= 1.001 * 0.01 * 130 * 2 * math.pi / 60  # the servo's gain is finite: 0.03 %
        before = now
    assert now.encoders.ticks.any()


def test_imu_integrates_to_the_velocity_of_its_mount() -> None:
    world = plane()
    velocity, lever = np.zeros(2), np.array([0.0398, 0.0014, 0.0825])
    for k in range(200):
        now = drive(world, 1, throttle=0.8, steering=0.5 * math.sin(0.05 * k)).vehicles["V1"]
        yaw = now.imu.euler[2]
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        velocity += 0.01 * turn @ now.imu.linear_acceleration[:2]
    at_mount = turn @ (now.velocity + np.cross(now.angular_velocity, lever))[:2]
    # the axes of the tick's end stand for those of the whole tick: yaw rates of 1 rad/s give 0.5 % of the speed
    assert velocity == pytest.approx(at_mount, abs=0.01)
