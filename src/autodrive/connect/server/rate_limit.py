"""Rate limit for the messages of one client."""

from __future__ import annotations

from typing import Literal

from autodrive.base.token_bucket import TokenBucket

RATE = 1000.0
"""Messages per second [Hz], and the largest burst. Requests do not count: one at a time is executed."""
BYTES = 2.0**22
"""Bytes per second, and the largest burst, of all messages."""
MOST_DROPPED = 10_000
"""A client is disconnected after this number of dropped messages."""


class RateLimit:
    """The limit of one client. Times are those of any steady clock [s]."""

    def __init__(self, now: float) -> None:
        self._messages = TokenBucket(RATE, RATE, now)
        self._bytes = TokenBucket(BYTES, BYTES, now)
        self._dropped = 0

    def allows_size(self, size: int, now: float) -> bool:
        """Whether one more message of that size [bytes] is read now; one that is read is counted."""
        return self._take(self._bytes, size, now)

    def allows(self, now: float) -> bool:
        """Whether one more message is accepted now; an accepted one is counted."""
        return self._take(self._messages, 1.0, now)

    def drop(self) -> Literal[False]:
        """Count a dropped message."""
        self._dropped += 1
        return False

    def _take(self, bucket: TokenBucket, tokens: float, now: float) -> bool:
        if bucket.tokens(now) < tokens:
            return self.drop()
        bucket.take(tokens)
        return True

    @property
    def is_exhausted(self) -> bool:
        """Whether the client exceeded the limit so often that it is disconnected."""
        return self._dropped > MOST_DROPPED
