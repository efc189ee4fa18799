"""Limits how fast a devkit script is read: one that floods the simulator waits, and takes no time from the ticks."""

from __future__ import annotations

RATE, BURST = 2000.0, 2000.0
"""Messages per second [Hz], and the most at once."""
PER_TELEMETRY = 4.0
"""More messages for each telemetry message: a command and an acknowledgement, also of another simulator."""
FREE_SIZE, SIZE = 1000, 100
"""A message of more bytes than the first counts as one more message for each so many bytes of the second."""


class ReadLimit:
    """A token bucket. `now` is the time of any steady clock [s]."""

    def __init__(self, now: float) -> None:
        self._left = BURST
        self._updated = now

    def count(self, size: int) -> None:
        """Count a message of that size [bytes] that was read."""
        self._left -= 1.0 + max(size - FREE_SIZE, 0) / SIZE

    def allow(self) -> None:
        """Allow the answers to a telemetry message."""
        self._left += PER_TELEMETRY

    def delay(self, now: float) -> float:
        """Time to wait before more is read [s]; 0: none."""
        self._left = min(self._left + RATE * (now - self._updated), BURST)
        self._updated = now
        return max(-self._left, 0.0) / RATE
