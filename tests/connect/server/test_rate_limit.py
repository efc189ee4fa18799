"""Rate limit of a client, with a simulated clock."""

from __future__ import annotations

from autodrive.connect.server.rate_limit import MOST_DROPPED, RATE, RateLimit


def test_a_burst_is_accepted_and_then_the_rate() -> None:
    limit = RateLimit(0.0)
    assert sum(limit.allows(0.0) for _ in range(3 * int(RATE))) == RATE
    assert sum(limit.allows(0.5) for _ in range(3 * int(RATE))) == RATE / 2
    assert sum(limit.allows(100.0) for _ in range(3 * int(RATE))) == RATE  # no more than a burst after a rest
    assert not limit.is_exhausted


def test_a_client_is_disconnected_after_too_many_dropped_messages() -> None:
    limit = RateLimit(0.0)
    for _ in range(int(RATE) + MOST_DROPPED):
        limit.allows(0.0)
    assert not limit.is_exhausted
    assert not limit.allows(0.0)
    assert limit.is_exhausted
