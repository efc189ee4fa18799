"""Limits how fast a devkit script is read: one that floods the simulator waits, and takes no time from the ticks."""

from __future__ import annotations

from autodrive.base.token_bucket import TokenBucket

RATE, BURST = 2000.0, 2000.0
"""Messages per second [Hz], and the most at once."""
PER_TELEMETRY = 4.0
"""More messages for each telemetry message: a command and an acknowledgement, also of another simulator."""
FREE_SIZE, SIZE = 1000, 100
"""A message of more bytes than the first counts as one more message for each so many bytes of the second."""


class ReadLimit(TokenBucket):
    """A token for each short message. `now` is the time of any steady clock [s]."""

    def __init__(self, now: float) -> None:
        super().__init__(RATE, BURST, now)

    def count(self, size: int) -> None:
        """Count a message of that size [bytes] that was read."""
        self.take(1.0 + max(size - FREE_SIZE, 0) / SIZE)

    def allow(self) -> None:
        """Allow the answers to a telemetry message."""
        self.take(-PER_TELEMETRY)
