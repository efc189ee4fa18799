"""Rate limit for the messages of one client: a token bucket."""

from __future__ import annotations

from typing import Literal

RATE = 1000.0
"""Messages per second [Hz], and the largest burst. Requests do not count: one at a time is executed."""
BYTES = 2.0**22
"""Bytes per second, and the largest burst, of all messages."""
MOST_DROPPED = 10_000
"""A client is disconnected after this number of dropped messages."""


class RateLimit:
    """The limit of one client. Times are those of any steady clock [s]."""

    def __init__(self, now: float) -> None:
        self._tokens = RATE
        self._bytes = BYTES
        self._refilled = now
        self._dropped = 0

    def allows_size(self, size: int, now: float) -> bool:
        """Whether one more message of that size [bytes] is read now; one that is read is counted."""
        self._refill(now)
        if self._bytes < size:
            return self.drop()
        self._bytes -= size
        return True

    def allows(self, now: float) -> bool:
        """Whether one more message is accepted now; an accepted one is counted."""
        self._refill(now)
        if self._tokens < 1.0:
            return self.drop()
        self._tokens -= 1.0
        return True

    def drop(self) -> Literal[False]:
        """Count a dropped message."""
        self._dropped += 1
        return False

    def _refill(self, now: float) -> None:
        elapsed, self._refilled = now - self._refilled, now
        self._tokens = min(self._tokens + RATE * elapsed, RATE)
        self._bytes = min(self._bytes + BYTES * elapsed, BYTES)

    @property
    def is_exhausted(self) -> bool:
        """Whether the client exceeded the limit so often that it is disconnected."""
        return self._dropped > MOST_DROPPED
