"""The RoboRacer cars at up to 15 m/s against closed forms and against a single-track model that is integrated here."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.base.transforms import euler_from_quaternion
from autodrive.physics.state import State
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.cars import car_file
from tests.support.physics import magic_formula

G = 9.81
PHYSICAL, GYM = "roboracer_physical", "roboracer_f1tenth"
TOP_SPEED = {PHYSICAL: 22.88, GYM: 20.0}
LOCK = {PHYSICAL: math.radians(30.0), GYM: math.radians(24.0012)}
MASS, INERTIA, FRONT, REAR, HEIGHT = 3.74, 0.04712, 0.15875, 0.17145, 0.074  # f1tenth_gym: m, I, lf, lr, h
STIFFNESS = 1.0489 * 4.718, 1.0489 * 5.4562  # mu C_Sf, mu C_Sr
LINEAR = {  # the tyres keep the stiffness of the gym at any load and slip
    "wheels.magic_formula.peak_stiffness_load": None,
    "wheels.magic_formula.forward.load_sensitivity": 0.0,
    "wheels.magic_formula.sideways.load_sensitivity": 0.0,
    "wheels.magic_formula.relaxation_length": [0.001, 0.001],
}
BOTH = pytest.mark.parametrize("car", [PHYSICAL, GYM])


class Drive:
    """A car on the plane."""

    def __init__(self, car: str, changes: dict[str, Any] | None = None, folder: Path | None = None) -> None:
        file = car if folder is None else car_file(folder, changes or {}, car)
        self.world: World = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=file)}))
        self.car = car

    @property
    def state(self) -> State:
        return self.world.compiled.state

    def step(self, speed: float, angle: float = 0.0, seconds: float = 0.01) -> None:
        """Drives at a speed [m/s] of the wheels with a steering angle [rad]."""
        command = Command(throttle=speed / TOP_SPEED[self.car], steering=angle / LOCK[self.car])
        for _ in range(round(seconds / 0.01)):
            self.world.step({"V1": command})

    @property
    def velocity(self) -> np.ndarray:
        """Of the rear axle [m/s]."""
        return self.state.vehicle_velocity[0]

    @property
    def yaw_rate(self) -> float:
        return float(self.state.vehicle_angular_velocity[0, 2])


# -- straight on ------------------------------------------------------------------------------------------------


def test_top_speed_is_where_the_motor_balances_the_resistances() -> None:
    """Air drag, rolling resistance and slip of the league's car; the gym's car has none and reaches its limit."""
    drive = Drive(PHYSICAL)
    drive.step(TOP_SPEED[PHYSICAL], seconds=20.0)
    speed, spin = drive.velocity[0], drive.state.wheel_angular_velocity.mean()
    rpm = spin * 60.0 / (2.0 * math.pi)
    motor = 0.40 * (5600.0 - rpm) / (5600.0 - 1200.0)
    servo = 0.05 * (TOP_SPEED[PHYSICAL] / 0.059 - spin)
    resistance = 0.25 * 0.5 * 1.2 * 0.032 * speed**2 * 0.059 + 1e-4 * spin
    assert min(motor, servo) == pytest.approx(resistance, rel=0.01)  # of the last 0.02 m/s
    assert 0.94 * TOP_SPEED[PHYSICAL] < speed < TOP_SPEED[PHYSICAL]
    drive = Drive(GYM)
    drive.step(TOP_SPEED[GYM], seconds=8.0)
    assert drive.velocity[0] == pytest.approx(20.0, rel=1e-4)


@pytest.mark.parametrize(
    ("car", "mass", "torque", "radius", "air", "damping"),
    [(PHYSICAL, 3.906, 0.40, 0.059, 0.5 * 1.2 * 0.032, 1e-4), (GYM, 3.74, 0.478, 0.0508, 0.0, 0.0)],
)
def test_time_from_0_to_5_metres_per_second_is_that_of_the_motor_torque(
    car: str, mass: float, torque: float, radius: float, air: float, damping: float
) -> None:
    """The motor has its whole torque up to 7.3 m/s; it also spins up the wheels, which slip."""
    drive = Drive(car)
    ticks = 0
    while drive.velocity[0] < 5.0:
        drive.step(TOP_SPEED[car])
        ticks += 1
    treads = 1.0 / (1.0 - float(drive.state.wheel_slip_ratio.mean()))
    speed, time, dt = 0.0, 0.0, 1e-4
    while speed < 5.0:
        force = 4.0 * (torque / radius - damping * treads * speed / radius**2) - air * speed**2
        speed += dt * force / (mass + 4 * 0.5 * 0.109 * treads)
        time += dt
    assert 0.01 * ticks == pytest.approx(time, abs=0.03)  # a tick, and the time until the tyres slip
    assert 6.0 < 5.0 / time < 9.51  # the physical car: 6 to 9 m/s^2; the limit of the gym


@pytest.mark.parametrize(("car", "friction"), [(PHYSICAL, 0.464), (GYM, None)])
def test_braking_distance_of_locked_wheels_is_that_of_sliding_friction(
    tmp_path: Path, car: str, friction: float | None
) -> None:
    """v^2 / (2 mu g) with the friction at slip 1: asymptote of the curve, or the magic formula at the wheels' loads."""
    drive = Drive(car, {"drivetrain.brake_torque": 50.0, "body.drag_area": 0.0}, tmp_path)
    drive.step(8.0, seconds=4.0)
    speed, start = drive.velocity[0], drive.state.vehicle_position[0, 0]
    drive.step(0.0, seconds=0.3)
    load = drive.state.wheel_normal_load
    if friction is None:
        peaks = [1.1739 * (1.0 - 0.14 * (one / 9.172 - 1.0)) for one in load.tolist()]
        forces = [
            magic_formula(1.0, peak, 22.303, 1.6411, 0.46403) * one for peak, one in zip(peaks, load, strict=True)
        ]
        friction = sum(forces) / float(load.sum())
    drive.step(0.0, seconds=3.0)
    assert drive.velocity[0] == pytest.approx(0.0, abs=1e-4)
    distance = drive.state.vehicle_position[0, 0] - start
    # 2 %: the wheels need some hundredths of a second to lock, and pass the peak of the friction on the way
    assert distance == pytest.approx(speed**2 / (2.0 * friction * G), rel=0.02)


# -- curves -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [1.0, 2.0, 3.0, 5.0])
def test_steady_circle_has_the_understeer_gradient_of_the_single_track_model(tmp_path: Path, speed: float) -> None:
    """delta = L / R + K_us a_y, K_us = 1 / C_f - 1 / C_r with the stiffnesses per load (Rajamani (3.14))."""
    drive = Drive(GYM, LINEAR, tmp_path)
    angle = 0.3 * 0.33 / max(1.0, 0.4 * speed**2)  # a_y up to 1.9 m/s^2
    drive.step(speed, seconds=2.0)
    drive.step(speed, angle, seconds=4.0)
    curvature = drive.yaw_rate / float(np.hypot(*drive.velocity[:2]))
    lateral = drive.yaw_rate * drive.velocity[0]
    gradient = (1.0 / STIFFNESS[0] - 1.0 / STIFFNESS[1]) / G
    assert curvature * 0.3302 + gradient * lateral == pytest.approx(angle, rel=0.03)


@BOTH
def test_lateral_acceleration_has_the_limit_of_the_tyres(car: str) -> None:
    """A slowly growing angle at 6 m/s: the greatest acceleration is near mu g, and never above it."""
    drive = Drive(car)
    drive.step(6.0, seconds=2.0)
    most = 0.0
    for k in range(300):
        drive.step(6.0, LOCK[car] * k / 300)
        most = max(most, drive.yaw_rate * float(np.hypot(*drive.velocity[:2])))
    friction = {PHYSICAL: 1.0, GYM: 1.0489}[car]
    assert 0.82 * friction * G < most < 1.02 * friction * G  # part of the grip goes into driving and load transfer


class SingleTrack:
    """The linear single-track model of f1tenth_gym (CommonRoad, section 7) at constant speed, in body axes.

    m (dv/dt + u r) = F_f cos d + F_r, I dr/dt = l_f F_f cos d - l_r F_r, F = -C F_z alpha. Integrated by Runge-Kutta.
    """

    def __init__(self, speed: float) -> None:
        self.speed = speed
        self.x = np.zeros(2)  # lateral velocity of the centre of mass, yaw rate
        self.angle = 0.0
        share = G * MASS / (FRONT + REAR)
        self.stiffness = STIFFNESS[0] * share * REAR, STIFFNESS[1] * share * FRONT

        # a yaw acceleration also spins up the wheels of one side: 0.109 kg / 2 each, at half the track
        self.inertia = INERTIA + 4 * 0.5 * 0.109 * (0.265 / 2) ** 2

    def rate(self, x: np.ndarray, angle: float) -> np.ndarray:
        v, r = x
        front = self.stiffness[0] * (angle - (v + FRONT * r) / self.speed)
        rear = self.stiffness[1] * -(v - REAR * r) / self.speed
        return np.array([(front + rear) / MASS - self.speed * r, (FRONT * front - REAR * rear) / self.inertia])

    def step(self, target: float, dt: float = 0.001) -> None:
        """A tick of 10 ms; the servo turns to the target angle with 3.2 rad/s."""
        for _ in range(10):
            self.angle += max(-3.2 * dt, min(3.2 * dt, target - self.angle))
            k1 = self.rate(self.x, self.angle)
            k2 = self.rate(self.x + 0.5 * dt * k1, self.angle)
            k3 = self.rate(self.x + 0.5 * dt * k2, self.angle)
            k4 = self.rate(self.x + dt * k3, self.angle)
            self.x = self.x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def step_steer(t: float) -> float:
    return 1.0 if t >= 0.1 else 0.0


def lane_change(t: float) -> float:
    return math.sin(2.0 * math.pi * (t - 0.1)) if 0.1 < t < 1.1 else 0.0


@pytest.mark.parametrize("speed", [5.0, 10.0, 15.0])
@pytest.mark.parametrize("manoeuvre", [step_steer, lane_change])
def test_yaw_rate_follows_the_single_track_model_at_small_slip(tmp_path: Path, manoeuvre: Any, speed: float) -> None:
    drive = Drive(GYM, LINEAR, tmp_path)
    drive.step(speed, seconds=5.0)
    model = SingleTrack(float(drive.velocity[0]))
    found, expected = [], []
    for k in range(200):
        angle = 0.06 / speed * manoeuvre(0.01 * k)  # slip angles up to 0.02 rad, where the tyre is linear within 0.3 %
        drive.step(speed, angle)
        model.step(angle)
        found.append(drive.yaw_rate)
        expected.append(float(model.x[1]))
    assert max(expected) > 0.05
    deviation = np.abs(np.subtract(found, expected)).max() / np.abs(expected).max()
    assert deviation < 0.01


# -- the body ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [2.0, 3.0])
def test_yaw_rate_overshoots_as_much_as_with_the_relaxation_length_alone(speed: float) -> None:
    """A linear single-track model whose slip angles follow over 0.05 m."""
    drive = Drive(GYM)
    drive.step(speed, seconds=3.0)
    rates = []
    for _ in range(150):
        drive.step(speed, 0.05)
        rates.append(drive.yaw_rate)
    load, dt = MASS * G / (FRONT + REAR), 1e-4
    front_stiffness, rear_stiffness = STIFFNESS[0] * load * REAR, STIFFNESS[1] * load * FRONT
    sideways, yaw_rate, front_slip, rear_slip, expected = 0.0, 0.0, 0.0, 0.0, []
    for k in range(round(1.5 / dt)):
        angle = min(0.05, 3.2 * k * dt)  # the limit of the servo
        front_slip += dt * speed / 0.05 * (angle - (sideways + FRONT * yaw_rate) / speed - front_slip)
        rear_slip += dt * speed / 0.05 * ((REAR * yaw_rate - sideways) / speed - rear_slip)
        front, rear = front_stiffness * front_slip, rear_stiffness * rear_slip
        sideways += dt * ((front + rear) / MASS - speed * yaw_rate)
        yaw_rate += dt * (FRONT * front - REAR * rear) / (1.08 * INERTIA)  # with that of the spinning wheels
        expected.append(yaw_rate)
    overshoot = max(rates) / float(np.mean(rates[-20:])) - 1.0
    assert overshoot == pytest.approx(max(expected) / expected[-1] - 1.0, abs=0.012)  # the formula bends
    assert overshoot == pytest.approx({2.0: 0.18, 3.0: 0.076}[speed], abs=0.005)  # docs/race_car.md


def test_roll_and_load_transfer_are_those_of_springs_and_lever_arms() -> None:
    """In a steady circle of the league's car: m a h = sum of the load differences times half the track, k T^2 roll."""
    drive = Drive(PHYSICAL)
    drive.step(3.0, seconds=2.0)
    drive.step(3.0, math.radians(6.0), seconds=4.0)
    state, track, stiffness = drive.state, 0.236, 500.0
    force = state.wheel_force
    angles = state.wheel_steering_angle
    lateral = float(np.sum(force[:, 0] * np.sin(angles) + force[:, 1] * np.cos(angles)))
    loads = state.wheel_normal_load
    transfer = float(loads[1] + loads[3] - loads[0] - loads[2]) / 2.0
    height = 0.059 + 0.01434
    roll, _, _ = euler_from_quaternion(state.vehicle_orientation[0])
    # the roll axis is on the ground, so that the centre of mass moves outwards by h times the roll angle
    weight = 3.906 * G
    assert transfer == pytest.approx((lateral + weight * abs(roll)) * height / track, rel=0.02)
    # m a h = (k T^2 - m g h) roll, with k (T/2)^2 of each of the four springs
    expected = lateral * height / (stiffness * track**2 - weight * height)
    assert abs(roll) == pytest.approx(expected, rel=0.03)
    assert 0.02 < abs(roll) < 0.06


def test_load_moves_to_the_rear_when_the_car_accelerates() -> None:
    """m a h / L, and the pitch of two springs at each end."""
    drive = Drive(PHYSICAL)
    drive.step(TOP_SPEED[PHYSICAL], seconds=1.0)
    state = drive.state
    loads, force = state.wheel_normal_load, float(state.wheel_force[:, 0].sum())
    weight, pitch = 3.906 * G, -2.0 * math.asin(float(state.vehicle_orientation[0, 2]))
    moved = float(loads[2] + loads[3]) - weight * (1.0 - 0.15532 / 0.324)
    expected = (force + weight * pitch) * (0.059 + 0.01434) / 0.324
    # the pitch axis is on the ground, too; the springs still move
    assert moved == pytest.approx(expected, rel=0.03)


# -- fast, and over the limit -----------------------------------------------------------------------------------


@BOTH
def test_a_slalom_at_15_metres_per_second_stays_on_the_ground_and_ends_straight(car: str) -> None:
    drive = Drive(car)
    drive.step(15.0, seconds=5.0)
    angle = 0.03 if car == GYM else 0.015
    for k in range(8):
        drive.step(15.0, angle * (-1) ** k, seconds=0.3)
        assert np.all(drive.state.wheel_normal_load > 0.5)
        assert 0.3 < abs(drive.yaw_rate) < 2.0
    drive.step(15.0, seconds=1.5)
    assert abs(drive.yaw_rate) < 0.01
    assert abs(drive.velocity[1]) < 0.02
    assert drive.velocity[0] == pytest.approx(15.0, rel=0.05)


@BOTH
def test_full_lock_at_15_metres_per_second_slides_without_falling_over(car: str) -> None:
    drive = Drive(car)
    drive.step(15.0, seconds=4.0)
    for _ in range(150):
        drive.step(15.0, LOCK[car])
        _, x, y, _ = drive.state.vehicle_orientation[0].tolist()
        assert 1.0 - 2.0 * (x * x + y * y) > math.cos(0.2)  # upright
        assert abs(drive.yaw_rate) < 15.0
    drive.step(0.0, seconds=5.0)
    assert float(np.abs(drive.velocity).max()) < 1e-4


@cache
def ends(substep: float) -> tuple[float, float]:
    """Where the gym's car is after a lane change of 2 s at 10 m/s."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=GYM)}, substep=substep))
    for k in range(400):
        angle = 0.2 * math.sin(math.pi * (0.01 * k - 2.0)) if k >= 200 else 0.0
        world.step({"V1": Command(throttle=0.5, steering=angle)})
    x, y, _ = world.compiled.state.vehicle_position[0].tolist()
    return x, y


def test_the_path_converges_with_shorter_substeps() -> None:
    error = [math.dist(ends(dt), ends(0.000125)) for dt in (0.0005, 0.001, 0.002)]
    assert error[1] < 0.05  # m, of 33 m
    assert 2.0 < error[2] / error[1] < 3.2  # first order, or better
