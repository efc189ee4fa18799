"""Settings of a curriculum: friction, mass, noise, latency and weather, drawn for each episode."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from numbers import Integral
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.protocol.messages import Weather
from autodrive.world.batch import BatchWorld
from autodrive.world.batch.batch_world import LIMITS

Range: TypeAlias = float | tuple[float, float]
"""One value, or the least and the greatest one."""
MOST_LATENCY = 0.5
"""Greatest time from an action until a car obeys it [s]."""
WEATHER = ("fog", "rain", "snow")
"""The amounts of a `Weather` that are drawn."""


class CarConditions(NamedTuple):
    """What is drawn for one car in one episode; see `Conditions`."""

    friction: float
    """Factor of the friction of the tyres."""
    mass: float
    """Factor of the mass and the inertia."""
    noise: float
    """Factor of the noise of the sensors."""
    latency: float
    """Time from an action until the car obeys it [s]."""
    drive: float
    """Factor of the torque of the motors."""
    trim: float
    """Angle that is added to that of the steered wheels [rad]."""


LATER = ("drive", "trim")
"""Conditions of a car for which no random number is drawn without a range: so that older settings draw the same."""


@dataclass(frozen=True)
class Conditions:
    """What the episodes of an environment draw, each from its range. Raises `SpecError` with all errors."""

    friction: Range = 1.0
    """Factor of the friction of the tyres, 0.01 to 10."""
    mass: Range = 1.0
    """Factor of the mass and the inertia, 0.1 to 10."""
    noise: Range = 0.0
    """Factor of the noise of the sensors, 0 to 100; 1: that of the data sheets."""
    latency: Range = 0.0
    """Time from an action until the car obeys it [s], 0 to 0.5; rounded to ticks."""
    drive: Range = 1.0
    """Factor of the torque of the motors, 0.1 to 10; see `VehiclePlacement.drive_factor`."""
    trim: Range = 0.0
    """Angle that is added to that of the steered wheels [rad], -0.2 to 0.2."""
    fog: Range = 0.0
    """Amount of fog, 0 to 1; see `Weather`. The weather is the same for all cars of a world."""
    rain: Range = 0.0
    """Amount of rain, 0 to 1; see `Weather`."""
    snow: Range = 0.0
    """Amount of snow, 0 to 1; see `Weather`."""

    def __post_init__(self) -> None:
        errors = range_errors(
            {
                "friction": (self.friction, *LIMITS["grip"]),
                "mass": (self.mass, *LIMITS["mass"]),
                "noise": (self.noise, *LIMITS["noise"]),
                "latency": (self.latency, 0.0, MOST_LATENCY),
                **{name: (getattr(self, name), *LIMITS[name]) for name in LATER},
                **{name: (getattr(self, name), 0.0, 1.0) for name in WEATHER},
            }
        )
        if errors:
            raise SpecError(errors)

    def draw(self, rng: np.random.Generator) -> CarConditions:
        """Draw the conditions of one car, each from its range with equal probability."""
        ranges = {name: getattr(self, name) for name in CarConditions._fields}
        return CarConditions(
            **{
                name: _drawn(limits, rng) if name not in LATER or isinstance(limits, tuple) else limits
                for name, limits in ranges.items()
            }
        )

    def draw_weather(self, rng: np.random.Generator) -> Weather | None:
        """Draw the weather of one world; None: no amount is set, so that the scenario decides it.

        Without a range of weather, no random number is drawn.
        """
        ranges = {name: getattr(self, name) for name in WEATHER}
        if not any(ranges.values()):
            return None
        return Weather(
            **{name: _drawn(amount, rng) if isinstance(amount, tuple) else amount for name, amount in ranges.items()}
        )


def checked_conditions(conditions: object, names: Collection[str]) -> Conditions:
    """Conditions of an environment that draws only these. Raises `SpecError`."""
    if not isinstance(conditions, Conditions):
        raise SpecError([f"conditions: must be Conditions(...), not {conditions!r}"])
    others = [
        condition.name
        for condition in fields(conditions)
        if condition.name not in names and getattr(conditions, condition.name) != condition.default
    ]
    if others:
        raise SpecError(
            [f"conditions: this environment does not draw {', '.join(others)}. It draws: {', '.join(names)}"]
        )
    return conditions


def _drawn(limits: Range, rng: np.random.Generator) -> float:
    least, most = limits if isinstance(limits, tuple) else (limits, limits)
    return least + (most - least) * float(rng.random())


def range_errors(settings: Mapping[str, tuple[object, float, float]]) -> list[str]:
    """An error for each setting that is no `Range`. `settings`: value, least and greatest value by name."""
    return [
        f"{name}: must be a number from {least:g} to {most:g}, or two such numbers, the smaller first, not {value!r}"
        for name, (value, least, most) in settings.items()
        if not _is_range(value, least, most)
    ]


def whole_number_errors(settings: Mapping[str, tuple[object, int, int]]) -> list[str]:
    """An error for each setting that is no whole number within its limits; `settings`: see `range_errors`."""
    return [
        f"{name}: must be a whole number from {least} to {most}, not {value!r}"
        for name, (value, least, most) in settings.items()
        if isinstance(value, bool) or not isinstance(value, Integral) or not least <= int(value) <= most
    ]


def _is_range(value: object, least: float, most: float) -> bool:
    ends: tuple[object, ...] = value if isinstance(value, tuple) else (value, value)
    numbers = [float(end) for end in ends if isinstance(end, int | float) and not isinstance(end, bool)]
    return len(numbers) == len(ends) == 2 and least <= numbers[0] <= numbers[1] <= most


class DelayedDrive:
    """Drives the cars of a batch: commands take effect after the latency of each car."""

    def __init__(self, batch: BatchWorld, frame_skip: int) -> None:
        self._batch = batch
        self._skip = frame_skip
        depth = 2 + math.ceil(round(MOST_LATENCY / batch.tick_duration) / frame_skip)
        shape = batch.n, len(batch.commanded_names)
        self._latency: Integers = np.zeros(shape, np.int64)
        """Latency of each car [ticks], shape (n, v)."""
        self._sent = np.zeros((depth, *shape, 2))
        """Latest commands, the last one first, shape (depth, n, v, 2)."""

    def reset(self, rows: NDArray[np.intp], latency: Floats) -> None:
        """Start episodes in the m worlds of the numbers `rows`; `latency` of their cars [s], shape (m, v)."""
        self._latency[rows] = np.rint(latency / self._batch.tick_duration)
        self._sent[:, rows] = 0.0

    def step(self, commands: Floats, worlds: NDArray[np.bool_] | None = None) -> None:
        """Run the ticks of one action, shape (n, v, 2). `worlds`: see `BatchWorld.step`."""
        if not self._latency.any():
            self._batch.step(commands, self._skip, worlds)
            return
        self._sent[1:] = self._sent[:-1].copy()
        self._sent[0] = commands
        ages = [-((tick - self._latency) // self._skip) for tick in range(self._skip)]
        first = 0
        for tick in range(1, self._skip + 1):
            if tick == self._skip or (ages[tick] != ages[first]).any():
                self._batch.step(self._due(np.maximum(ages[first], 0)), tick - first, worlds)
                first = tick

    def _due(self, ages: Integers) -> Floats:
        """The commands of each car that were sent `ages` steps ago, shape (n, v, 2); `ages`: shape (n, v)."""
        return np.take_along_axis(self._sent, ages[None, :, :, None], axis=0)[0]
