"""What is said on the topics becomes the Command that drives as was said."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from autodrive.protocol.messages import Command, Headlights, Indicators
from autodrive.ros import Config
from autodrive.ros.update import Car
from autodrive.ros.wheel import Wheel

CAR = Car(1, "nigel", (), wheelbase=0.14, speed_limit=0.5, steering_limit=0.5)


def number(value: float) -> SimpleNamespace:
    return SimpleNamespace(data=value)


def twist(speed: float, turn: float) -> SimpleNamespace:
    return SimpleNamespace(linear=SimpleNamespace(x=speed), angular=SimpleNamespace(z=turn))


def wheel(profile: str = "2025", timeout: float = 0.5) -> Wheel:
    return Wheel(Config(profile=profile, command_timeout=timeout), CAR)


def test_nobody_drives_before_something_was_said() -> None:
    assert wheel().command(1.0) is None


@pytest.mark.parametrize(("profile", "sign"), [("2020", -1), ("2022", -1), ("2023", -1), ("2025", 1)])
def test_steering_turns_to_the_side_that_its_era_says(profile: str, sign: int) -> None:
    one = wheel(profile)
    one.throttle(number(0.25))
    one.steering(number(0.5))
    assert one.command(0.0) == Command(0.25, sign * 0.5)


def test_each_topic_changes_what_it_is_about_and_nothing_else() -> None:
    one = wheel()
    one.throttle(number(0.5))
    one.headlights(number(2))
    one.indicators(number(3))
    assert one.command(0.0) == Command(0.5, 0.0, Headlights.HIGH, Indicators.HAZARD)


def test_an_ackermann_drive_asks_for_a_speed_and_an_angle() -> None:
    one = wheel()
    one.ackermann(SimpleNamespace(drive=SimpleNamespace(speed=-0.25, steering_angle=0.1)))
    assert one.command(0.0) == Command(-0.5, 0.2)


@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_a_twist_turns_at_the_rate_that_it_says(speed: float) -> None:
    one, turn = wheel(), 0.4
    one.twist(twist(speed, turn))
    command = one.command(0.0)
    assert command is not None
    angle = CAR.steering_limit * command.steering
    assert CAR.speed_limit * command.throttle * math.tan(angle) / CAR.wheelbase == pytest.approx(turn)


def test_a_twist_on_the_spot_turns_the_wheels_all_the_way() -> None:
    one = wheel()
    one.twist_stamped(SimpleNamespace(twist=twist(0.0, -1.0)))
    assert one.command(0.0) == Command(0.0, -1.0)


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_a_stop(nonsense: float) -> None:
    one = wheel()
    one.throttle(number(nonsense))
    assert one.command(0.0) == Command(0.0)


def test_too_much_is_clamped() -> None:
    one = wheel()
    one.throttle(number(7.0))
    one.headlights(number(9))
    assert one.command(0.0) == Command(1.0, 0.0, Headlights.HIGH)


def test_silence_stops_the_car_and_a_new_word_drives_it_on() -> None:
    one = wheel()
    one.command(10.0)
    one.throttle(number(0.8))
    assert one.command(10.5) == Command(0.8)
    assert one.is_fresh
    assert one.command(10.51) == Command(0.0)
    assert not one.is_fresh
    one.throttle(number(0.4))
    assert one.command(10.52) == Command(0.4)


def test_without_a_time_out_the_last_word_stands() -> None:
    one = wheel(timeout=0.0)
    one.throttle(number(0.8))
    assert one.command(1e6) == Command(0.8)


def test_after_a_reset_of_the_world_nobody_drives() -> None:
    one = wheel()
    one.command(10.0)
    one.throttle(number(0.8))
    assert one.command(0.01) is None
