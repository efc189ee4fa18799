"""Checks Commands and their values."""

from __future__ import annotations

import functools
import math
import reprlib
import sys
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any, get_args, get_type_hints

import msgspec
import numpy as np
from msgspec import structs

from autodrive.base.errors import CommandError
from autodrive.protocol.messages import Command, Headlights, Indicators, Operation, Weather

MAX_DISTANCE = 1e4
"""A vehicle or an object is placed at most this far from the origin of the map, along each axis [m]."""
MAX_TIME_SCALE = 1e9
"""Greatest scale of a time of day [seconds of the day per simulated second]."""

_EXAMPLE = "such as {'V1': Command(throttle=0.5, steering=0.2)}"
_HEADLIGHTS, _INDICATORS = frozenset(Headlights), frozenset(Indicators)


def check_commands(commands: object) -> None:
    """Raises `CommandError` unless it is a dictionary of Commands that vehicles can obey, by name of the vehicle."""
    if not isinstance(commands, (dict, Mapping)):  # a dictionary is recognised faster
        raise CommandError(
            f"commands must be a dictionary with a Command for each vehicle, {_EXAMPLE}, not {reprlib.repr(commands)}"
        )
    for vehicle, command in commands.items():
        if not isinstance(command, Command):
            raise CommandError(
                f"the command of vehicle '{vehicle}' must be a Command, {_EXAMPLE}, not {reprlib.repr(command)}"
            )
        _check_values(vehicle, command)


def _check_values(vehicle: str, command: Command) -> None:
    if not _is_finite(command.throttle):
        raise CommandError(_not_finite(vehicle, "throttle", command.throttle))
    if not _is_finite(command.steering):
        raise CommandError(_not_finite(vehicle, "steering", command.steering))
    if command.headlights is not None and not _is_one_of(command.headlights, _HEADLIGHTS):
        raise CommandError(_not_known(vehicle, "headlights", command.headlights, Headlights))
    if command.indicators is not None and not _is_one_of(command.indicators, _INDICATORS):
        raise CommandError(_not_known(vehicle, "indicators", command.indicators, Indicators))


def check_operation(request: object) -> None:
    """Raises `CommandError` unless it is an Operation whose values have the types of its fields."""
    kind = type(request)
    if kind not in _OPERATIONS:
        raise CommandError(f"a request must be an Operation, such as Reset(), not {reprlib.repr(request)}")
    try:
        checked = msgspec.convert(msgspec.to_builtins(request, enc_hook=_number), _without_limits(kind))
    except msgspec.ValidationError as error:
        problem, _, place = str(error).partition(" - at `$.")
        problem = problem.replace("`", "")
        raise CommandError(f"{place.rstrip('`')} of {kind.__name__}: {problem[0].lower()}{problem[1:]}") from None
    except (TypeError, ValueError, OverflowError, RecursionError) as error:  # a value that no message can hold
        raise CommandError(f"a {kind.__name__} has a value of a wrong type: {error}") from None
    for field in checked.__struct_fields__:  # msgspec turns bytes, times and other values into texts
        value = getattr(request, field)
        if isinstance(getattr(checked, field), str) and not isinstance(value, str):
            raise CommandError(f"{field} of {kind.__name__}: expected str, got {type(value).__name__}")


def check_flag(flag: object, subject: str) -> None:
    """Raises `CommandError` unless it is True or False."""
    if not isinstance(flag, bool | np.bool_):
        raise CommandError(f"{subject} must be True or False, not {reprlib.repr(flag)}")


def check_seed(seed: object) -> None:
    """Raises `CommandError` for a number that is not the seed of a random stream."""
    if isinstance(seed, bool) or not isinstance(seed, Integral) or not 0 <= int(seed) < 2**63:
        raise CommandError(f"a seed must be a whole number from 0 to 2^63 - 1, not {reprlib.repr(seed)}")


def check_weather(weather: object) -> None:
    """Raises `CommandError` unless it is a `Weather` whose amounts are numbers from 0 to 1."""
    if not isinstance(weather, Weather):
        raise CommandError(f"the weather must be a Weather, such as Weather(rain=0.6), not {reprlib.repr(weather)}")
    for name, amount in structs.asdict(weather).items():
        is_held = name in ("wetness", "snow_cover")
        is_share = amount is not None and is_number(amount) and 0.0 <= amount <= 1.0
        if not (is_share or (amount is None and is_held)):
            raise CommandError(
                f"{name} of the weather must be a number from 0 to 1{' or None' * is_held}, not {reprlib.repr(amount)}"
            )


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


_OPERATIONS = frozenset(get_args(Operation))


@functools.cache
def _without_limits(operation: type) -> type[msgspec.Struct]:
    """A message with the same fields. Limits of values are checked where they are used, with a better message."""
    return msgspec.defstruct(operation.__name__, list(get_type_hints(operation).items()))


def _number(value: object) -> Any:
    """A number of numpy as one of Python."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not supported")
