"""The steering servo: its formula against closed forms, and the SG90 of the report in a world."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import autodrive
from autodrive.physics.actuators.steering import ackermann_angle, steered
from autodrive.protocol.messages import Command
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from tests.support.cars import OBEYS_AT_ONCE, car_file

LIMIT = math.radians(30.0)
angles = st.floats(-LIMIT, LIMIT)


def response(time_constant: float, dt: float) -> float:
    return 1.0 - math.exp(-dt / time_constant)


def test_a_servo_without_rate_limit_approaches_its_target_exponentially() -> None:
    angle, dt, time_constant = 0.0, 0.001, 0.02
    for k in range(1, 200):
        angle = steered(angle, 0.5, response(time_constant, dt), math.inf, False, dt)
        expected = 0.5 * (1.0 - math.exp(-k * dt / time_constant))
        assert angle == pytest.approx(expected, rel=1e-12)  # exact for a constant target, except for rounding


def test_a_servo_without_lag_moves_at_its_rate_limit_and_stops_at_its_target() -> None:
    angle, dt, rate = -0.3, 0.001, 2.0
    for k in range(1, 400):
        angle = steered(angle, 0.3, 1.0, rate, False, dt)
        assert angle == pytest.approx(min(0.3, -0.3 + rate * k * dt), abs=1e-12)  # rounding of 400 sums
    assert angle == 0.3


@given(angles, angles, st.floats(0.001, 1.0), st.floats(0.1, 50.0), st.sampled_from([0.0005, 0.001, 0.005]))
def test_a_servo_never_overshoots_or_exceeds_its_rate_limit(
    angle: float, target: float, share: float, rate: float, dt: float
) -> None:
    after = steered(angle, target, share, rate, False, dt)
    assert min(angle, target) - 1e-15 <= after <= max(angle, target) + 1e-15  # a rounding of 1 in 2^53
    assert abs(after - angle) <= rate * dt + 1e-15


@given(angles, angles, st.floats(0.001, 1.0), st.floats(0.1, 50.0))
def test_left_mirrors_right(angle: float, target: float, share: float, rate: float) -> None:
    mirrored = steered(-angle, -target, share, rate, False, 0.001)
    assert mirrored == -steered(angle, target, share, rate, False, 0.001)


@pytest.mark.parametrize(
    ("angle", "target", "after"),
    [
        (0.0, 0.5, 0.01),  # angles that grow to the same side are limited
        (0.2, 0.5, 0.21),
        (-0.2, -0.5, -0.21),
        (0.5, 0.2, 0.2),  # a smaller angle is reached at once, on either side
        (-0.5, -0.2, -0.2),
        (0.5, 0.0, 0.0),
        (0.5, -0.3, -0.3),
        (-0.5, 0.3, 0.3),
        (0.2, -0.5, 0.19),  # a greater angle on the other side is limited
        (-0.2, 0.5, -0.19),
        (LIMIT, -LIMIT, LIMIT - 0.01),  # from full left to full right: limited; the other way round: at once
        (-LIMIT, LIMIT, LIMIT),
    ],
)
def test_the_published_program_limits_only_greater_angles(angle: float, target: float, after: float) -> None:
    """Unity's angle s is right positive; it grows by the rate if command <= s / limit, up to -command limit."""
    assert steered(angle, target, 1.0, 10.0, True, 0.001) == pytest.approx(after, abs=1e-12)
    command, unity = target / LIMIT, -angle  # the lines of VehicleController.cs, in Unity's sign
    unity = max(unity - 0.01, -target) if command > unity / LIMIT else min(unity + 0.01, -target)
    assert -unity == pytest.approx(after, abs=1e-12)


def test_the_league_car_steers_as_the_published_program() -> None:
    """183.346 degrees/s, 30 degrees: 0.1636 s from straight on to full lock, and back within a step."""
    angles = steering_after_each_substep("roboracer", [1.0] * 170 + [0.0] * 2 + [-1.0] * 20 + [0.1] * 2)
    assert angles[162] < LIMIT
    assert angles[163] == pytest.approx(LIMIT, abs=1e-3)
    assert angles[170] == 0.0
    assert angles[191] == pytest.approx(-20 * 0.0032, abs=1e-9)
    assert angles[192] == pytest.approx(0.1 * LIMIT, abs=1e-12)


def steering_after_each_substep(vehicle: str, steering: list[float]) -> list[float]:
    """Steering angle [rad] after each tick of one substep (1 ms)."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, tick=0.001))
    return [world.step({"V1": Command(steering=value)}).vehicles["V1"].steering for value in steering]


def test_sg90_takes_a_tenth_of_a_second_for_sixty_degrees(tmp_path: Path) -> None:
    servo = car_file(tmp_path, OBEYS_AT_ONCE)
    angle = steering_after_each_substep(servo, [1.0] * 100 + [-1.0] * 105)
    assert angle[49] == pytest.approx(LIMIT, abs=1e-5)  # 30 degrees in 0.05 s; the file writes the rate with 5 digits
    assert angle[99] == LIMIT
    assert angle[149] == pytest.approx(0.0, abs=1e-5)
    assert angle[198] > -LIMIT + 0.009  # one substep earlier it is 0.010 rad away
    assert angle[199] == pytest.approx(-LIMIT, abs=1e-5)
    assert angle[204] == -LIMIT


@pytest.mark.parametrize("dead_time", [0.0, 0.003, 0.010, 0.017])
def test_each_command_of_a_stream_arrives_after_the_dead_time(tmp_path: Path, dead_time: float) -> None:
    servo = car_file(tmp_path, {**OBEYS_AT_ONCE, "steering.dead_time": dead_time, "steering.rate_limit": 1e9})
    waiting = round(dead_time / 0.001)
    sent = [math.sin(0.1 * k) for k in range(60)]
    got = steering_after_each_substep(servo, sent)
    arrived = [LIMIT * value for value in sent[: 60 - waiting]]
    assert got == pytest.approx([0.0] * waiting + arrived, abs=1e-15)  # rounding of one product


@pytest.mark.parametrize("steering", [1.0, -1.0, 7.0, -1e300])
def test_angle_is_limited_to_thirty_degrees(steering: float) -> None:
    angle = steering_after_each_substep("nigel", [steering] * 400)
    assert angle[-1] == pytest.approx(math.copysign(LIMIT, steering), abs=1e-6)  # e^(-300 ms / 20 ms) is 3e-7
    assert max(abs(value) for value in angle) <= LIMIT


@pytest.mark.parametrize("angle_deg", [1.0, 10.0, 30.0])
def test_axes_of_ackermann_wheels_meet_in_one_centre(angle_deg: float) -> None:
    wheelbase, half_track, delta = 0.14154, 0.0765, math.radians(angle_deg)
    radius = wheelbase / math.tan(delta)
    for y in (half_track, -half_track):
        assert ackermann_angle(delta, wheelbase, y) == pytest.approx(math.atan2(wheelbase, radius - y), abs=1e-12)


def test_ackermann_angles_at_the_limit_are_those_of_the_original() -> None:
    inner = math.degrees(ackermann_angle(math.radians(30), 0.14154, 0.0765))
    outer = math.degrees(ackermann_angle(math.radians(30), 0.14154, -0.0765))
    assert (inner, outer) == (pytest.approx(40.0, abs=0.05), pytest.approx(23.75, abs=0.05))  # known to 0.01 degree
