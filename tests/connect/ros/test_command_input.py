"""Messages on the command topics become the Command of the vehicle."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from autodrive.connect.ros import Config
from autodrive.connect.ros.command_input import CommandInput
from autodrive.connect.ros.source import VehicleInfo
from autodrive.protocol.messages import Command, Headlights, Indicators

CAR = VehicleInfo(1, "nigel", (), wheelbase=0.14, wheel_radius=0.03, speed_limit=0.5, steering_limit=0.5)


def number(value: float) -> SimpleNamespace:
    return SimpleNamespace(data=value)


def twist(speed: float, turn: float) -> SimpleNamespace:
    return SimpleNamespace(linear=SimpleNamespace(x=speed), angular=SimpleNamespace(z=turn))


def command_input(profile: str = "2025", timeout: float = 0.5) -> CommandInput:
    return CommandInput(Config(profile=profile, command_timeout=timeout), CAR)


def test_there_is_no_command_before_the_first_message() -> None:
    assert command_input().command(1.0) is None


@pytest.mark.parametrize(("profile", "sign"), [("2020", -1), ("2022", -1), ("2023", 1), ("2025", 1), ("roboracer", 1)])
def test_the_sign_of_steering_is_that_of_the_profile(profile: str, sign: int) -> None:
    one = command_input(profile)
    one.on_throttle(number(0.25))
    one.on_steering(number(0.5))
    assert one.command(0.0) == Command(0.25, sign * 0.5)


def test_each_topic_changes_only_its_value() -> None:
    one = command_input()
    one.on_throttle(number(0.5))
    one.on_headlights(number(2))
    one.on_indicators(number(3))
    assert one.command(0.0) == Command(0.5, 0.0, Headlights.HIGH, Indicators.HAZARD)


def test_an_ackermann_message_sets_speed_and_steering_angle() -> None:
    one = command_input()
    one.on_ackermann(SimpleNamespace(drive=SimpleNamespace(speed=-0.25, steering_angle=0.1)))
    assert one.command(0.0) == Command(-0.5, 0.2)


@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_a_twist_sets_the_yaw_rate(speed: float) -> None:
    one, turn = command_input(), 0.4
    one.on_twist(twist(speed, turn))
    command = one.command(0.0)
    assert command is not None
    angle = CAR.steering_limit * command.steering
    assert CAR.speed_limit * command.throttle * math.tan(angle) / CAR.wheelbase == pytest.approx(turn)


def test_a_twist_at_standstill_steers_fully() -> None:
    one = command_input()
    one.on_twist_stamped(SimpleNamespace(twist=twist(0.0, -1.0)))
    assert one.command(0.0) == Command(0.0, -1.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_stops(value: float) -> None:
    one = command_input()
    one.on_throttle(number(value))
    assert one.command(0.0) == Command(0.0)


def test_values_are_clamped() -> None:
    one = command_input()
    one.on_throttle(number(7.0))
    one.on_headlights(number(9))
    assert one.command(0.0) == Command(1.0, 0.0, Headlights.HIGH)


def test_the_timeout_stops_and_the_next_message_drives_again() -> None:
    one = command_input()
    one.command(10.0)
    one.on_throttle(number(0.8))
    assert one.command(10.49) == Command(0.8)
    assert one.is_active
    assert one.command(10.5) == Command(0.0)
    assert not one.is_active
    one.on_throttle(number(0.4))
    assert one.command(10.52) == Command(0.4)


def test_without_a_timeout_the_last_command_stays() -> None:
    one = command_input(timeout=0.0)
    one.on_throttle(number(0.8))
    assert one.command(1e6) == Command(0.8)


def test_after_a_reset_there_is_no_command() -> None:
    one = command_input()
    one.command(10.0)
    one.on_throttle(number(0.8))
    assert one.command(0.01) is None
