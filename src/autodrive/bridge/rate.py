"""How many messages a client may send: a bucket that fills with time."""

from __future__ import annotations

import math

RATE = 1000.0
"""Messages a second [Hz], and so many at once."""
HOPELESS = 10_000
"""A client of which so many messages were dropped is sent away."""


class Allowance:
    """Of one client; times are those of any steady clock [s]."""

    rate = RATE

    def __init__(self, now: float) -> None:
        self._room = RATE
        self._then = now
        self._complained = -math.inf
        self._dropped = 0

    def has_room(self, now: float) -> bool:
        """Whether one more message may come now; it then counts."""
        self._room = min(self._room + RATE * (now - self._then), RATE)
        self._then = now
        if self._room < 1.0:
            self._dropped += 1
            return False
        self._room -= 1.0
        return True

    def may_complain(self, now: float) -> bool:
        """Once a second."""
        if now < self._complained + 1.0:
            return False
        self._complained = now
        return True

    @property
    def is_hopeless(self) -> bool:
        """Whether it does not learn."""
        return self._dropped > HOPELESS
