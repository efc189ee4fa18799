"""The rate at which a script is read, with a simulated clock."""

from __future__ import annotations

from autodrive.connect.bridge.read_limit import BURST, ReadLimit


def test_a_long_message_counts_as_many() -> None:
    limit = ReadLimit(0.0)
    for _ in range(5):
        limit.count(60_000)
    assert limit.delay(0.0) > 0.4


def test_who_answers_telemetry_never_waits() -> None:
    limit = ReadLimit(0.0)
    for _ in range(10 * int(BURST)):
        limit.allow()
        for _ in range(4):
            limit.count(300)
        assert limit.delay(0.0) == 0.0
