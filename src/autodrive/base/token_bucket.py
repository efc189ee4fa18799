"""A token bucket: limits a rate and lets bursts pass."""

from __future__ import annotations


class TokenBucket:
    """Gets `rate` tokens per second and holds `burst` at most. Who takes more than there are waits until it is paid.

    Times are those of any steady clock [s].
    """

    def __init__(self, rate: float, burst: float, now: float) -> None:
        self._rate = rate
        self._burst = burst
        self._tokens = burst
        self._filled_at = now

    def tokens(self, now: float) -> float:
        """The tokens that it holds now; less than 0: what is still to be paid."""
        self._tokens = min(self._tokens + self._rate * (now - self._filled_at), self._burst)
        self._filled_at = now
        return self._tokens

    def take(self, tokens: float) -> None:
        """Take tokens, also more than there are; less than 0: add some."""
        self._tokens -= tokens

    @property
    def free_at(self) -> float:
        """Time at which all that was taken is paid."""
        return self._filled_at + max(-self._tokens, 0.0) / self._rate

    def delay(self, now: float) -> float:
        """Time until all that was taken is paid [s]; 0: it is."""
        return max(-self.tokens(now), 0.0) / self._rate
