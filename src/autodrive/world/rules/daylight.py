"""Daylight: the light of a scene is day, night, or follows a time of day that passes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import CommandError
from autodrive.base.jit import jit_uncounted
from autodrive.graphics.render.look import DAY_LENGTH, is_day_at
from autodrive.protocol.commands import MAX_TIME_SCALE, is_number
from autodrive.world.compile import CompiledScenario


class SceneLight(NamedTuple):
    """The light of a scene as a function of simulated time."""

    is_on: bool
    """Whether it is day, if there is no time of day."""
    start: float | None = None
    """Time of day at the simulated time `since` [s since midnight]; None if the light is fixed."""
    scale: float = 0.0
    """Seconds of the day per simulated second."""
    since: float = 0.0
    """Simulated time [s]."""

    def at(self, time: float) -> tuple[bool, float | None]:
        """Whether it is day at the simulated time [s], and the time since midnight [s]; None if the light is fixed."""
        if self.start is None:
            return self.is_on, None
        time_of_day = (self.start + self.scale * (time - self.since)) % DAY_LENGTH
        return is_day_at(time_of_day), time_of_day

    def following(self, time_of_day: float | None, scale: float, time: float) -> SceneLight:
        """The light that follows a time of day from that simulated time [s] on; see `World.set_time_of_day`."""
        now = self.at(time)[1] if time_of_day is None else time_of_day
        now = 0.5 * DAY_LENGTH if now is None else now
        if not (is_number(now) and is_number(scale, MAX_TIME_SCALE)):
            raise CommandError(
                f"a time of day and its scale must be finite numbers, and the scale at most {MAX_TIME_SCALE:g}, "
                f"not {now} and {scale}"
            )
        return SceneLight(self.is_on, float(now) % DAY_LENGTH, float(scale), time)


class DaylightColumns(NamedTuple):
    """`SceneLight` of n worlds: columns with its fields, shape (n,) each."""

    is_on: Floats
    """1: day, 0: night, without a time of day."""
    start: Floats
    """`SceneLight.start` [s since midnight]; not a number: the light is fixed."""
    scale: Floats
    since: Floats


def columns(c: CompiledScenario, n: int) -> DaylightColumns:
    """Columns of n worlds of the scenario."""
    filled = DaylightColumns(*(np.zeros(n) for _ in DaylightColumns._fields))
    begin(c, filled, np.arange(n))
    return filled


def begin(c: CompiledScenario, columns: DaylightColumns, chosen: Integers) -> None:
    """Set the light of the `chosen` worlds to that of the scenario."""
    write(columns, chosen, SceneLight(c.spec.scene_light, c.spec.time_of_day))


def write(columns: DaylightColumns, chosen: Integers | int, light: SceneLight) -> None:
    """Set the light of the `chosen` worlds."""
    for column, value in zip(columns, light, strict=True):
        column[chosen] = np.nan if value is None else value


def light_of(columns: DaylightColumns, k: int = 0) -> SceneLight:
    """The light of world k."""
    is_on, start, scale, since = (float(column[k]) for column in columns)
    return SceneLight(is_on == 1.0, None if np.isnan(start) else start, scale, since)


@jit_uncounted
def time_of_day(k: int, time: float, columns: DaylightColumns) -> float:
    """`SceneLight.at` in world k: time since midnight [s]; not a number if the light is fixed."""
    if np.isnan(columns.start[k]):
        return np.nan
    return (columns.start[k] + columns.scale[k] * (time - columns.since[k])) % DAY_LENGTH
