"""The token bucket, with a simulated clock."""

from __future__ import annotations

from autodrive.base.token_bucket import TokenBucket


def test_a_burst_passes_and_then_the_rate() -> None:
    bucket = TokenBucket(0.5, 2.0, now=0.0)
    assert bucket.free_at == bucket.delay(0.0) == 0.0
    bucket.take(2.0)
    assert bucket.delay(0.0) == 0.0
    bucket.take(1.0)
    assert bucket.free_at == bucket.delay(0.0) == 2.0
    assert bucket.delay(2.0) == 0.0


def test_a_rest_saves_no_more_than_the_burst() -> None:
    bucket = TokenBucket(0.5, 2.0, now=0.0)
    bucket.take(2.0)
    assert bucket.tokens(1000.0) == 2.0
    bucket.take(3.0)
    assert bucket.free_at == 1002.0
