"""The formulas of the drivetrain against closed forms, and its dead time and lag in a world."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import autodrive
from autodrive.physics.actuators.drivetrain import drive_level, drive_target, drive_torque_limit
from autodrive.protocol.messages import Command
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from tests.support.cars import OBEYS_AT_ONCE, car_file

levels = st.floats(-1.0, 1.0)


def test_level_approaches_the_throttle_exponentially() -> None:
    level, dt, time_constant = 0.0, 0.001, 0.04
    for k in range(1, 400):
        level = drive_level(level, -0.7, 1.0 - math.exp(-dt / time_constant), math.inf, False, dt)
        assert level == pytest.approx(-0.7 * (1.0 - math.exp(-k * dt / time_constant)), rel=1e-12)  # rounding


@given(levels, st.floats(0.001, 1.0))
def test_zero_throttle_resets_the_drive_level(level: float, response: float) -> None:
    assert drive_level(level, 0.0, response, 1.0, False, 0.001) == 0.0
    coasting = drive_level(level, 0.0, response, 1.0, True, 0.001)  # it follows the throttle with its lag and ramp
    assert coasting == pytest.approx(level - math.copysign(min(abs(level) * response, 0.001), level), abs=1e-15)


@given(levels, levels.filter(bool), st.floats(0.001, 1.0))
def test_level_stays_between_its_last_value_and_the_throttle(level: float, throttle: float, response: float) -> None:
    after = drive_level(level, throttle, response, math.inf, False, 0.001)
    assert min(level, throttle) - 1e-15 <= after <= max(level, throttle) + 1e-15  # a rounding of 1 in 2^53


@given(levels)
def test_speed_control_sets_the_speed_and_not_the_torque(level: float) -> None:
    assert drive_target(level, True, 13.6, 1.0, 0.0) == level * 13.6
    assert drive_torque_limit(level, True, 2.352) == 2.352


@given(levels.filter(bool))
def test_torque_control_sets_the_torque_and_not_the_speed_limit(level: float) -> None:
    assert drive_target(level, False, 13.6, 1.0, 0.0) == math.copysign(13.6, level)
    assert drive_torque_limit(abs(level), False, 2.352) == abs(level) * 2.352


def drive_after_each_substep(vehicle: str, throttle: list[float]) -> list[tuple[float, float]]:
    """Delayed throttle and drive level after each tick of one substep (1 ms)."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, tick=0.001))
    view = world.vehicle("V1")
    return [
        (world.step({"V1": Command(throttle=value)}).vehicles["V1"].throttle, view.drive_level) for value in throttle
    ]


@pytest.mark.parametrize("dead_time", [0.0, 0.003, 0.010, 0.017])
def test_dead_time_is_exact_to_the_substep(tmp_path: Path, dead_time: float) -> None:
    car = car_file(tmp_path, {**OBEYS_AT_ONCE, "drivetrain.dead_time": dead_time, "steering.dead_time": 0.005})
    drive = drive_after_each_substep(car, [0.5] * 30)
    waiting = round(dead_time / 0.001)
    assert drive == [(0.0, 0.0)] * waiting + [(0.5, 0.5)] * (30 - waiting)


def test_nigel_has_the_lag_of_its_time_constant_and_stops_at_once() -> None:
    drive = drive_after_each_substep("nigel", [1.0] * 200 + [0.0] * 20)
    for k in range(10, 210):  # 10 ms of dead time, then 40 ms of lag
        assert drive[k][1] == pytest.approx(1.0 - math.exp(-(k - 9) / 40.0), rel=1e-12)  # rounding
    assert drive[210:] == [(0.0, 0.0)] * 10


def test_brakes_apply_after_the_dead_time() -> None:
    world = autodrive.make(ScenarioSpec(tick=0.001))
    for _ in range(1000):
        world.step({"V1": Command(throttle=1.0)})
    spins = [world.step({"V1": Command()}).vehicles["V1"].wheels.angular_velocity for _ in range(11)]
    for spin in spins[:10]:
        assert spin[2:] == pytest.approx(spins[0][2:], rel=0.01)  # still driven, at the end of a 40 ms lag
    assert spins[10] == pytest.approx(0.0)  # 2.352 N m stop a wheel of 1.8e-5 kg m^2 within 1 ms
