"""Checks Commands and their values."""

from __future__ import annotations

import math
import reprlib
import sys
from collections.abc import Mapping
from numbers import Integral, Real

import numpy as np

from autodrive.errors import CommandError
from autodrive.protocol.messages import Command, Headlights, Indicators

MAX_DISTANCE = 1e4
"""A vehicle or an object is placed at most this far from the origin of the map, along each axis [m]."""
MAX_TIME_SCALE = 1e9
"""Greatest scale of a time of day [seconds of the day per simulated second]."""

_EXAMPLE = "such as {'V1': Command(throttle=0.5, steering=0.2)}"
_HEADLIGHTS, _INDICATORS = frozenset(Headlights), frozenset(Indicators)


def check_commands(commands: object) -> None:
    """Raises `CommandError` unless it is a dictionary of Commands, by name of the vehicle."""
    if not isinstance(commands, Mapping):
        raise CommandError(
            f"commands must be a dictionary with a Command for each vehicle, {_EXAMPLE}, not {reprlib.repr(commands)}"
        )
    for vehicle, command in commands.items():
        if not isinstance(command, Command):
            raise CommandError(
                f"the command of vehicle '{vehicle}' must be a Command, {_EXAMPLE}, not {reprlib.repr(command)}"
            )


def check_command(vehicle: str, command: Command) -> None:
    """Raises `CommandError` if the vehicle cannot obey: a value is not a finite number, or a lamp is not known."""
    if not _is_finite(command.throttle):
        raise CommandError(_not_finite(vehicle, "throttle", command.throttle))
    if not _is_finite(command.steering):
        raise CommandError(_not_finite(vehicle, "steering", command.steering))
    if command.headlights is not None and not _is_one_of(command.headlights, _HEADLIGHTS):
        raise CommandError(_not_known(vehicle, "headlights", command.headlights, Headlights))
    if command.indicators is not None and not _is_one_of(command.indicators, _INDICATORS):
        raise CommandError(_not_known(vehicle, "indicators", command.indicators, Indicators))


def check_flag(flag: object, subject: str) -> None:
    """Raises `CommandError` unless it is True or False."""
    if not isinstance(flag, bool | np.bool_):
        raise CommandError(f"{subject} must be True or False, not {reprlib.repr(flag)}")


def check_seed(seed: object) -> None:
    """Raises `CommandError` for a number that is not the seed of a random stream."""
    if not isinstance(seed, Integral) or not 0 <= int(seed) < 2**63:
        raise CommandError(f"a seed must be a whole number from 0 to 2^63 - 1, not {reprlib.repr(seed)}")


def is_number(value: object, limit: float = sys.float_info.max) -> bool:
    """Whether it is a real number, finite, and not above `limit` in size."""
    try:
        return isinstance(value, Real) and abs(float(value)) <= limit
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _is_finite(value: object) -> bool:
    return math.isfinite(value) if type(value) is float else isinstance(value, int | np.number) and is_number(value)


def _is_one_of(lamp: object, lamps: frozenset[Headlights] | frozenset[Indicators]) -> bool:
    return isinstance(lamp, Integral) and lamp in lamps


def _not_finite(vehicle: str, name: str, value: object) -> str:
    return f"{name} of vehicle '{vehicle}' must be a finite number in [-1, 1], not {value}"


def _not_known(vehicle: str, name: str, value: object, lamps: type[Headlights | Indicators]) -> str:
    known = ", ".join(f"{int(lamp)} {lamp.name.lower()}" for lamp in lamps)
    return f"{name} of vehicle '{vehicle}' must be one of {known}, not {value}"
