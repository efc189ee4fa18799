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
"""[s]."""
WEATHER = ("fog", "rain", "snow")
"""The amounts of a `Weather` that are drawn."""


class Drawn(NamedTuple):
    """The conditions of one car in one episode."""

    friction: float
    mass: float
    noise: float
    latency: float


@dataclass(frozen=True)
class Conditions:
    """Raises `SpecError` with all errors."""

    friction: Range = 1.0
    """Factor of the friction of the tyres, 0.01 to 10."""
    mass: Range = 1.0
    """Factor of the mass and the inertia, 0.1 to 10."""
    noise: Range = 0.0
    """Factor of the noise of the sensors, 0 to 100; 1: that of the data sheets."""
    latency: Range = 0.0
    """Time from an action until the car obeys it [s], 0 to 0.5; rounded to ticks."""
    fog: Range = 0.0
    """Amount, 0 to 1; see `Weather`. The weather is the same for all cars of a world."""
    rain: Range = 0.0
    """Likewise."""
    snow: Range = 0.0
    """Likewise."""

    def __post_init__(self) -> None:
        errors = range_errors(
            {
                "friction": (self.friction, *LIMITS["grip"]),
                "mass": (self.mass, *LIMITS["mass"]),
                "noise": (self.noise, *LIMITS["noise"]),
                "latency": (self.latency, 0.0, MOST_LATENCY),
                **{name: (getattr(self, name), 0.0, 1.0) for name in WEATHER},
            }
        )
        if errors:
            raise SpecError(errors)

    def draw(self, rng: np.random.Generator) -> Drawn:
        """Of one car, each from its range with equal probability."""
        return Drawn(*(_drawn(getattr(self, name), rng) for name in Drawn._fields))

    def draw_weather(self, rng: np.random.Generator) -> Weather | None:
        """Of one world, likewise; None: no amount is given, so that it is that of the scenario.

        Without a range of weather, no random number is drawn.
        """
        ranges = {name: getattr(self, name) for name in WEATHER}
        if not any(ranges.values()):
            return None
        return Weather(**{name: _drawn(one, rng) if isinstance(one, tuple) else one for name, one in ranges.items()})


def checked_conditions(given: object, names: Collection[str]) -> Conditions:
    """Conditions of an environment that draws only these. Raises `SpecError`."""
    if not isinstance(given, Conditions):
        raise SpecError([f"conditions: must be Conditions(...), not {given!r}"])
    others = [one.name for one in fields(given) if one.name not in names and getattr(given, one.name) != one.default]
    if others:
        raise SpecError(
            [f"conditions: this environment does not draw {', '.join(others)}. It draws: {', '.join(names)}"]
        )
    return given


def _drawn(given: Range, rng: np.random.Generator) -> float:
    least, most = given if isinstance(given, tuple) else (given, given)
    return least + (most - least) * float(rng.random())


def range_errors(given: Mapping[str, tuple[object, float, float]]) -> list[str]:
    """What is no `Range`; by name: a setting, and its least and greatest value."""
    return [
        f"{name}: must be a number from {least:g} to {most:g}, or two of them, the lesser one first, not {one!r}"
        for name, (one, least, most) in given.items()
        if not _is_range(one, least, most)
    ]


def whole_number_errors(given: Mapping[str, tuple[object, int, int]]) -> list[str]:
    """What is no whole number, likewise."""
    return [
        f"{name}: must be a whole number from {least} to {most}, not {one!r}"
        for name, (one, least, most) in given.items()
        if isinstance(one, bool) or not isinstance(one, Integral) or not least <= int(one) <= most
    ]


def _is_range(given: object, least: float, most: float) -> bool:
    ends: tuple[object, ...] = given if isinstance(given, tuple) else (given, given)
    numbers = [float(end) for end in ends if isinstance(end, int | float) and not isinstance(end, bool)]
    return len(numbers) == len(ends) == 2 and least <= numbers[0] <= numbers[1] <= most


class Drive:
    """Drives the cars of a batch: commands take effect after the latency of each car."""

    def __init__(self, batch: BatchWorld, frame_skip: int) -> None:
        self._batch = batch
        self._skip = frame_skip
        depth = 2 + math.ceil(round(MOST_LATENCY / batch.tick_duration) / frame_skip)
        shape = batch.n, len(batch.commanded_names)
        self._latency: Integers = np.zeros(shape, np.int64)
        """[ticks]."""
        self._sent = np.zeros((depth, *shape, 2))
        """Latest commands, the last one first."""

    def reset(self, rows: NDArray[np.intp], latency: Floats) -> None:
        """New episodes in these worlds; `latency` [s], shape (m, v)."""
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
        """The commands that were sent so many steps ago, for each car."""
        return np.take_along_axis(self._sent, ages[None, :, :, None], axis=0)[0]
