"""Limits how often messages of the same kind are logged or sent."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable


class LogThrottle:
    """Admits one message of each kind per `interval` [s] and counts those in between. `clock`: a steady clock [s]."""

    def __init__(self, interval: float, clock: Callable[[], float]) -> None:
        self._interval = interval
        self._clock = clock
        self._last: dict[Hashable, float] = {}
        self._suppressed: dict[Hashable, int] = {}

    def admits(self, kind: Hashable = "") -> bool:
        """Whether a message of that kind may be logged now."""
        now = self._clock()
        if now < self._last.get(kind, -math.inf) + self._interval:
            self._suppressed[kind] = self._suppressed.get(kind, 0) + 1
            return False
        self._last[kind] = now
        return True

    def take_suppressed(self, kind: Hashable = "") -> int:
        """The number of messages of that kind suppressed since the last call."""
        return self._suppressed.pop(kind, 0)

    def forget(self, kind: Hashable) -> None:
        """Admit the next message of that kind."""
        self._last.pop(kind, None)
        self._suppressed.pop(kind, None)
