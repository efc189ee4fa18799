"""The complete car (nigel) on a plane against closed forms."""

import itertools
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from autodrive import Command, EngineError, Frame
from autodrive.base.arrays import Floats
from autodrive.base.transforms import rotate, rotation_from_quaternion
from autodrive.physics.tick import observe, place
from autodrive.scenario import BoxSpec
from tests.support.cars import OBEYS_AT_ONCE
from tests.support.physics import ROLLS_FREELY, WorldWith, drive

G = 9.81
MASS = 1.75
WHEELBASE = 0.14154
FULL_SPEED = 130 * 2 * math.pi / 60 * 0.0325


def x_of(frame: Frame) -> float:
    return float(frame.vehicles["V1"].pose.position[0])


def test_car_at_rest_has_a_quarter_of_its_weight_on_each_wheel(world_with: WorldWith) -> None:
    car = drive(world_with(), 1.0).vehicles["V1"]
    assert car.pose.position[2] == pytest.approx(0.0325, abs=1e-9)
    assert car.wheels.normal_load == pytest.approx(MASS * G / 4, abs=1e-6)  # 4.2919 N
    assert car.wheels.compression == pytest.approx(0.0, abs=1e-9)


def test_car_at_rest_does_not_drift(world_with: WorldWith) -> None:
    world = world_with()
    start = drive(world, 1.0).vehicles["V1"]
    end = drive(world, 60.0).vehicles["V1"]
    assert np.abs(end.pose.position - start.pose.position).max() < 1e-14  # rounding alone: 2e-15 m
    assert np.abs(end.pose.orientation - start.pose.orientation).max() < 1e-14


def test_braked_car_holds_on_a_slope_without_creeping(world_with: WorldWith) -> None:
    world = world_with(engine="always")
    slope = 0.2  # 11 degrees; the engine's gravity is tilted instead of the ground
    world.compiled.engine.model.opt.gravity[:] = (-G * math.sin(slope), 0.0, -G * math.cos(slope))
    settled = x_of(drive(world, 2.0))
    assert -4e-4 < settled < 0.0  # the holding spring of 25 Hz yields 0.08 mm, the pitch the same
    assert x_of(drive(world, 10.0)) == pytest.approx(settled, abs=1e-8)


def test_bounce_frequency_is_that_of_spring_and_damper(world_with: WorldWith) -> None:
    world = world_with()
    world.compiled.state.qvel[2] = 0.01
    height = []
    for _ in range(40):
        frame = drive(world, world.tick_duration)
        height.append(float(frame.vehicles["V1"].pose.position[2]) - 0.0325)
    # fit a damped cosine: the poles of x[n+1] = a x[n] + b x[n-1]
    h = np.array(height[:25])
    a, b = np.linalg.lstsq(np.stack([h[1:-1], h[:-2]], axis=1), h[2:], rcond=None)[0]
    pole = np.roots([1.0, -a, -b])[0]
    frequency = abs(np.angle(pole)) / (2 * math.pi * 0.01)
    m, k, c = MASS / 4, 5040.0, 20.0
    expected = math.sqrt(k / m - (c / (2 * m)) ** 2) / (2 * math.pi)
    assert expected == pytest.approx(16.69, abs=0.01)
    assert frequency == pytest.approx(expected, rel=0.015)  # semi-implicit steps of 1 ms are 1.1 % too fast


@pytest.mark.parametrize("throttle", [1.0, 0.5, -1.0])
def test_driven_wheels_reach_the_speed_set_by_the_throttle(world_with: WorldWith, throttle: float) -> None:
    car = drive(world_with(), 3.0, throttle=throttle).vehicles["V1"]
    tread = car.wheels.angular_velocity[2:] * 0.0325
    assert pytest.approx(0.44244, abs=1e-5) == FULL_SPEED
    assert tread == pytest.approx(throttle * FULL_SPEED, rel=1e-3)  # the servo's gain is finite: 0.03 %


def test_car_without_losses_reaches_tread_speed(world_with: WorldWith) -> None:
    car = drive(world_with(changes=ROLLS_FREELY), 6.0, throttle=1.0).vehicles["V1"]
    assert car.speed == pytest.approx(FULL_SPEED, rel=1e-3)


def test_full_throttle_is_the_speed_of_130_rpm(world_with: WorldWith) -> None:
    """Table 1 of the report: motors of 130 rpm; radius of the wheels: table 9."""
    car = drive(world_with(), 6.0, throttle=1.0).vehicles["V1"]
    assert car.speed == pytest.approx(FULL_SPEED, rel=0.006)  # air drag and the remaining damping: 0.5 %
    front = car.wheels.angular_velocity[:2] * 0.0325
    assert front == pytest.approx(car.speed, rel=0.01)  # the free wheels roll


def test_damping_of_table_9_in_newton_metres_drags_the_front_wheels(world_with: WorldWith) -> None:
    """nigel_2020: the balance of a front wheel, r F = c w, and of the car give its speed."""
    world = world_with(vehicle="nigel_2020")
    car = drive(world, 6.0, throttle=1.0).vehicles["V1"]
    force = world.compiled.state.wheel_force[:, 0]
    assert -0.0325 * force[:2] == pytest.approx(0.025 * car.wheels.angular_velocity[:2], rel=1e-6)
    assert force.sum() == pytest.approx(0.1 * MASS * car.speed, rel=1e-3)  # the drag of the air
    assert car.speed == pytest.approx(0.3947, abs=1e-4)  # the figure of docs/vehicle.md


def test_left_mirrors_right(world_with: WorldWith) -> None:
    left, right = world_with(), world_with()
    for k in range(300):
        steering = math.sin(0.05 * k)
        left.step({"V1": Command(throttle=0.8, steering=steering)})
        right.step({"V1": Command(throttle=0.8, steering=-steering)})
    a, b = left.frame.vehicles["V1"], right.frame.vehicles["V1"]
    assert a.pose.position == pytest.approx(b.pose.position * (1, -1, 1), abs=1e-9)  # rounding errors grow over 3 s
    assert a.pose.orientation == pytest.approx(b.pose.orientation * (1, -1, 1, -1), abs=1e-9)


@pytest.mark.parametrize("substep", [0.0005, 0.001, 0.002])
def test_braking_distance_lies_between_the_friction_limits(world_with: WorldWith, substep: float) -> None:
    world = world_with(changes=OBEYS_AT_ONCE, substep=substep)
    before = drive(world, 3.0, throttle=1.0)
    v = before.vehicles["V1"].speed
    distance = x_of(drive(world, 1.0)) - x_of(before)
    assert v**2 / (2 * 1.0 * G) < distance < v**2 / (2 * 0.5 * G)  # friction 1 at the extremum, 0.5 at the asymptote


@pytest.mark.parametrize("steering_deg", [10.0, 20.0, 30.0])
def test_slow_circle_has_the_radius_of_the_kinematic_bicycle(world_with: WorldWith, steering_deg: float) -> None:
    car = drive(world_with(changes=ROLLS_FREELY), 8.0, throttle=0.1, steering=steering_deg / 30.0).vehicles["V1"]
    radius = car.speed / car.angular_velocity[2]
    assert radius == pytest.approx(WHEELBASE / math.tan(math.radians(steering_deg)), rel=0.015)  # slip grows with speed


def test_turning_radii_are_those_of_table_10(world_with: WorldWith) -> None:
    for throttle, slip in ((0.1, 0.006), (1.0, 0.025)):  # slip grows with speed
        car = drive(world_with(), 8.0, throttle=throttle, steering=1.0).vehicles["V1"]
        rear = car.speed / car.angular_velocity[2]
        assert rear == pytest.approx(0.24515, rel=slip)
        assert math.hypot(rear, WHEELBASE) == pytest.approx(0.28308, rel=slip)


def test_coasting_car_never_gains_energy(world_with: WorldWith) -> None:
    world = world_with(changes={**ROLLS_FREELY, **OBEYS_AT_ONCE, "drivetrain.brake_torque": 0.0})
    drive(world, 2.0, throttle=0.8, steering=0.4)
    inertia = 0.5 * 0.034 * 0.0325**2
    energies = []
    for _ in range(300):
        car = world.step({"V1": Command(0.0, 0.4)}).vehicles["V1"]
        com = car.velocity + np.cross(car.angular_velocity, (0.07077, 0.0, 0.0418))
        energies.append(
            0.5 * MASS * com @ com
            + 0.5 * car.angular_velocity**2 @ np.array([0.009297, 0.017956, 0.017591])
            + 0.5 * inertia * np.sum(car.wheels.angular_velocity**2)
        )
    start = energies[0]
    gains = np.diff(energies)
    # the energy stored in the springs is far less than this share of the kinetic energy
    assert gains.max() < 1e-4 * start
    assert energies[-1] < start


def test_pose_converges_with_first_order_in_the_substep(world_with: WorldWith) -> None:
    def end(substep: float) -> np.ndarray:
        world = world_with(substep=substep)  # with the lag of the drive the tyres grip from the start
        for k in range(300):
            world.step({"V1": Command(throttle=0.8, steering=0.6 * math.sin(0.02 * k))})
        return world.frame.vehicles["V1"].pose.position[:2]

    fine = end(0.000125)
    errors = [float(np.linalg.norm(end(substep) - fine)) for substep in (0.0005, 0.001, 0.002)]
    assert errors[0] < 0.001  # after a drive of one metre
    for (h, smaller), (_, larger) in itertools.pairwise(zip((0.0005, 0.001, 0.002), errors, strict=True)):
        first_order = (2 * h - 0.000125) / (h - 0.000125)
        assert larger / smaller == pytest.approx(first_order, rel=0.1)  # the second order contributes


def test_wheels_on_a_body_apply_the_reaction_to_it(world_with: WorldWith) -> None:
    plate = BoxSpec(x=0.07, y=0.0, z=2.0, size=(1.0, 1.0, 0.1), mass=3.0)
    world = world_with(changes={**ROLLS_FREELY, **OBEYS_AT_ONCE}, boxes={"plate": plate})
    state, qpos = world.compiled.state, int(world.compiled.model.vehicles[0]["qpos"])
    state.qpos[qpos + 2] = 2.05 + 0.0325
    observe(world.compiled.model, state)
    car = drive(world, 0.05, throttle=0.5).vehicles["V1"]  # both fall freely, without other contacts
    com = car.velocity + np.cross(car.angular_velocity, (0.07077, 0.0, 0.0418))
    car_momentum = MASS * np.array(rotate(car.pose.orientation, com))
    plate_dof = world.compiled.engine.body("plate")[2]
    plate_momentum = 3.0 * state.qvel[plate_dof : plate_dof + 3]
    assert car_momentum[0] > 0.01  # it accelerates [N s]
    across = car_momentum[:2] + plate_momentum[:2]
    assert across == pytest.approx(0.0, abs=5e-6)  # Newton's third law; the engine integrates with first order
    fallen = -(MASS + 3.0) * G * 0.05
    assert car_momentum[2] + plate_momentum[2] == pytest.approx(fallen, rel=1e-5)


def test_car_on_a_body_has_the_wheel_loads_of_the_ground(world_with: WorldWith) -> None:
    plate = BoxSpec(x=3.0, y=0.0, size=(1.0, 1.0, 0.1), mass=3.0)
    world = world_with(boxes={"plate": plate})
    qpos = int(world.compiled.model.vehicles[0]["qpos"])
    world.compiled.state.qpos[qpos + 2] += 0.1
    world.compiled.state.qpos[world.compiled.objects["plate"]] = 0.07
    observe(world.compiled.model, world.compiled.state)
    car = drive(world, 2.0).vehicles["V1"]
    assert car.pose.position[2] == pytest.approx(0.1325, abs=2e-4)  # the contact of plate and floor is soft
    assert car.wheels.normal_load == pytest.approx(MASS * G / 4, rel=1e-3)


def test_wheels_roll_up_and_down_a_low_plate(world_with: WorldWith) -> None:
    world = world_with(boxes={"plate": BoxSpec(x=0.6, y=0.0, size=(0.4, 0.4, 0.004), mass=2.0)})
    heights = [drive(world, world.tick_duration, throttle=1.0).vehicles["V1"].pose.position[2] for _ in range(400)]
    assert 0.0365 < max(heights) < 0.0380  # 4 mm higher; the step lifts it by less than 1.5 mm more
    assert heights[-1] == pytest.approx(0.0325, abs=2e-4)
    assert x_of(world.frame) > 1.0


def test_a_diverged_state_is_an_error_and_a_reset_recovers(world_with: WorldWith) -> None:
    world = world_with()
    world.compiled.state.qvel[0] = math.nan
    with pytest.raises(EngineError, match="unstable"):
        world.step()
    world.reset()
    assert drive(world, 0.1).vehicles["V1"].pose.position[2] == pytest.approx(0.0325)


def test_an_unstable_engine_writes_no_file_and_prints_nothing(
    world_with: WorldWith, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    world = world_with("nigel_2023", engine="always")
    files = {*tmp_path.iterdir()}
    for in_thread in (False, True):
        world.reset()
        world.compiled.state.qvel[5] = 9e8
        with ThreadPoolExecutor(1) as threads, pytest.raises(EngineError, match="unstable"):
            threads.submit(world.step).result() if in_thread else world.step()
        assert world.compiled.views.warnings.any()  # MuJoCo's own
    assert {*tmp_path.iterdir()} == files
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("engine", ["auto", "always"])
def test_the_limit_of_the_angular_velocity_leaves_the_momentum(world_with: WorldWith, engine: str) -> None:
    world = world_with("roboracer_physical", changes={"body.drag_area": 0.0}, engine=engine)  # at most 7 rad/s
    state, centre = world.compiled.state, np.array([0.15532, 0.0, 0.01434])
    state.qpos[2], state.qvel[3:6] = 2.0, (3.0, -4.0, 12.0)
    place(world.compiled.model, state, world.compiled.views)

    def momentum() -> Floats:
        r = np.reshape(rotation_from_quaternion(tuple(state.qpos[3:7].tolist())), (3, 3))
        return state.qvel[:3] + r @ np.cross(state.qvel[3:6], centre)

    before = momentum()
    world.step()
    assert np.linalg.norm(state.qvel[3:6]) == pytest.approx(7.0)
    after = before - [0.0, 0.0, G * world.tick_duration]
    assert momentum() == pytest.approx(after, abs=0.002)  # steps of 1 ms: 0.0005 m/s


def test_car_climbs_a_plank_that_leans_on_a_box(world_with: WorldWith) -> None:
    pitch = -0.06  # nose up [rad]
    plank = BoxSpec(x=1.0, y=0.0, z=0.1, size=(1.0, 0.4, 0.004), mass=1.0)  # level, it would be in the post
    post = BoxSpec(x=1.40, y=0.0, size=(0.05, 0.4, 0.045), mass=5.0)
    world = world_with(changes=ROLLS_FREELY, boxes={"plank": plank, "post": post})
    qpos = world.compiled.objects["plank"]
    world.compiled.state.qpos[qpos + 2] -= 0.066
    world.compiled.state.qpos[qpos + 3 : qpos + 7] = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    observe(world.compiled.model, world.compiled.state)
    drive(world, 1.0)
    while x_of(world.frame) < 0.95:
        drive(world, 0.01, throttle=0.8)
        assert world.time < 10.0
    car = world.frame.vehicles["V1"]
    tilt = world.frame.objects["plank"].pose.orientation
    up_of_plank = np.array(rotate(tilt, (0.0, 0.0, 1.0)))
    up_of_car = np.array(rotate(car.pose.orientation, (0.0, 0.0, 1.0)))
    assert up_of_plank[0] < -0.03  # it is still tilted
    assert up_of_car == pytest.approx(up_of_plank, abs=0.02)  # 1 mm of spring travel over the wheelbase is 0.007 rad
    assert car.pose.position[2] > 0.0325 + 0.02
    drive(world, 1.0)
    stopped = x_of(world.frame)
    drive(world, 5.0)
    assert x_of(world.frame) == pytest.approx(stopped, abs=1e-3)  # contacts of the engine creep, at most 0.2 mm/s
