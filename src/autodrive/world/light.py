"""The light of a scene: day, night, or a time of day that passes."""

from __future__ import annotations

from typing import NamedTuple

from autodrive.base.errors import CommandError
from autodrive.graphics.render.look import DAY_LENGTH, is_day_at
from autodrive.protocol.commands import MAX_TIME_SCALE, is_number


class SceneLight(NamedTuple):
    """The light of a scene as a function of simulated time."""

    is_on: bool
    """Day or night, without a time of day."""
    start: float | None = None
    """Time of day at the simulated time `since` [s since midnight]; None if the light is fixed."""
    scale: float = 0.0
    """Seconds of the day per simulated second."""
    since: float = 0.0
    """Simulated time [s]."""

    def at(self, time: float) -> tuple[bool, float | None]:
        """At the simulated time [s]: day (True) or night, and the time since midnight [s], None if it is fixed."""
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
                f"a time of day and its scale must be finite numbers, the scale at most {MAX_TIME_SCALE:g}, "
                f"not {now} and {scale}"
            )
        return SceneLight(self.is_on, float(now) % DAY_LENGTH, float(scale), time)
