"""Computes when the next tick is due and how well the pace is kept. Wall time is a number [s] from any clock."""

from __future__ import annotations

MIN_SPEED, MAX_SPEED = 1e-6, 1e6
"""Simulated seconds per wall second. At the least speed a tick of 10 ms comes every three hours."""

MAX_LAG = 0.1
"""A lag of up to this much wall time [s] is caught up. A greater lag is dropped: on a machine that is too slow,
simulated time slows down instead of falling further behind."""

WARNING_INTERVAL = 10.0
"""Least wall time [s] between two warnings."""

MEASURING_TIME = 1.0
"""The real-time factor is the mean over about this much wall time [s]."""


class TickPace:
    """Keeps ticks of `tick_duration` [s] at `speed` simulated seconds per wall second (None: as fast as possible)."""

    def __init__(self, tick_duration: float, speed: float | None) -> None:
        self.speed = speed
        self.ticks = 0
        self.late_ticks = 0
        self.real_time_factor = 0.0
        self._tick_duration = tick_duration
        self._simulated_before = (0.0, 0)
        self._due = 0.0
        self._started: float | None = None
        self._time_before = 0.0
        self._measured_from: tuple[float, int] | None = None
        self._quiet_until = float("-inf")

    @property
    def simulated_time(self) -> float:
        """Simulated time that all ticks took [s]."""
        time, ticks = self._simulated_before
        return time + (self.ticks - ticks) * self._tick_duration

    def set_tick_duration(self, tick_duration: float, now: float) -> None:
        """Continue with ticks of another length [s], as after a rest."""
        self._simulated_before = (self.simulated_time, self.ticks)
        self._tick_duration = tick_duration
        if self._started is not None:
            self.restart(now)

    def restart(self, now: float) -> None:
        """Start, or continue after a rest: the next tick is due now."""
        self.rest(now)
        self._started = self._due = now
        self._measured_from = (now, self.ticks)

    def rest(self, now: float) -> None:
        """Nothing is due until `restart`."""
        self._time_before = self.running_time(now)
        self._started = None
        self._measured_from = (now, self.ticks)

    def set_speed(self, speed: float | None, now: float) -> None:
        """Change the speed, running or resting; a lag of the old speed is dropped."""
        self.speed = speed
        if self._started is not None:
            self.restart(now)

    def running_time(self, now: float) -> float:
        """Wall time spent running, without rests [s]."""
        started = self._started  # read once: other threads read while the thread of the simulation writes
        return self._time_before + (now - started if started is not None else 0.0)

    def delay(self, now: float) -> float:
        """Wall time until the next tick is due [s], 0 or negative when it is."""
        return 0.0 if self.speed is None else self._due - now

    def count(self, now: float) -> bool:
        """Count a tick, also one of a step during a rest. Returns True if a warning is due that it is too slow."""
        self.ticks += 1
        self._measure(now)
        if self._started is None or self.speed is None:
            return False
        period = self._tick_duration / self.speed
        self._due += period
        lag = now - self._due
        if lag > period:
            self.late_ticks += 1
        if lag <= max(MAX_LAG, 2 * period):
            return False
        self._due = now
        return self._is_warning_due(now)

    def _measure(self, now: float) -> None:
        began, ticks = self._measured_from = self._measured_from or (now, self.ticks)
        if now - began >= MEASURING_TIME:
            self.real_time_factor = (self.ticks - ticks) * self._tick_duration / (now - began)
            self._measured_from = (now, self.ticks)

    def _is_warning_due(self, now: float) -> bool:
        if now < self._quiet_until:
            return False
        self._quiet_until = now + WARNING_INTERVAL
        return True
