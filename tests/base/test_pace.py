"""The pace with times given as numbers."""

import pytest

from autodrive.base.pace import MAX_LAG, WARNING_INTERVAL, TickPace

TICK = 0.01


def drive(pace: TickPace, seconds: float, cost: float, begin: float = 100.0) -> tuple[float, int]:
    """Run ticks that cost `cost` of wall time each; returns the time after them and the number of warnings."""
    now, warnings = begin, 0
    pace.restart(now)
    while now - begin < seconds:
        now += max(pace.delay(now), 0.0) + cost
        warnings += pace.count(now)
    return now, warnings


@pytest.mark.parametrize("speed", [0.25, 1.0, 3.0, None])
def test_ticks_have_the_requested_speed_or_that_of_the_machine(speed: float | None) -> None:
    pace = TickPace(TICK, speed)
    drive(pace, 20.0, cost=0.001)
    speed = speed or TICK / 0.001
    assert pace.ticks * TICK == pytest.approx(20.0 * speed, abs=2 * TICK * max(speed, 1.0))  # a tick at either end
    assert pace.real_time_factor == pytest.approx(speed, rel=0.05)  # a second holds a whole number of ticks only
    assert pace.late_ticks == 0


def test_a_short_lag_is_caught_up() -> None:
    pace = TickPace(TICK, 1.0)
    now, _ = drive(pace, 1.0, cost=0.001)
    before = now + max(pace.delay(now), 0.0)  # the next tick was due then
    now = before + 0.8 * MAX_LAG
    ticks = pace.ticks
    while pace.delay(now) <= 0:
        now += 0.001
        pace.count(now)
    assert pace.late_ticks > 0
    # every due time of the span was served: one tick each TICK, to the tick under way
    assert pace.ticks - ticks == pytest.approx((now - before) / TICK, abs=1.0)


def test_a_machine_that_is_too_slow_slows_simulated_time_and_falls_no_further_behind() -> None:
    pace = TickPace(TICK, 1.0)
    now, warnings = drive(pace, 4 * WARNING_INTERVAL, cost=2 * TICK)
    assert pace.real_time_factor == pytest.approx(0.5, rel=0.02)  # each tick costs two
    assert -pace.delay(now) <= MAX_LAG + 2 * TICK  # the lag is bounded by the limit and one tick
    assert warnings in {4, 5}  # one each interval, one at the beginning
    # nearly all are late: only those after a dropped lag are not
    assert pace.late_ticks > 0.7 * pace.ticks


def test_a_rest_is_neither_running_time_nor_lag() -> None:
    pace = TickPace(TICK, 1.0)
    now, _ = drive(pace, 1.0, cost=0.001)
    pace.rest(now)
    assert pace.running_time(now + 60.0) == pytest.approx(now - 100.0)
    pace.restart(now + 60.0)
    assert pace.delay(now + 60.0) == 0.0
    assert pace.late_ticks == 0


def test_ticks_counted_at_rest_are_not_late() -> None:
    pace = TickPace(TICK, 1.0)
    assert not pace.count(1e6)
    assert (pace.ticks, pace.late_ticks) == (1, 0)


def test_simulated_time_counts_ticks_at_the_length_that_they_had() -> None:
    pace = TickPace(0.01, 1.0)
    pace.restart(0.0)
    for _ in range(10):
        pace.count(0.0)
    pace.set_tick_duration(0.02, 0.1)
    for _ in range(10):
        pace.count(0.1)
    assert pace.simulated_time == pytest.approx(10 * 0.01 + 10 * 0.02)
    assert pace.delay(0.1) == pytest.approx(0.2)


def test_steps_during_a_rest_have_a_speed() -> None:
    """As in a race in lock-step: 200 ticks in 4 s of wall time are half of real time."""
    pace = TickPace(TICK, 1.0)
    for k in range(201):
        assert not pace.count(50.0 + 0.02 * k)
    assert pace.real_time_factor == pytest.approx(0.5, rel=0.01)
    assert (pace.late_ticks, pace.running_time(60.0)) == (0, 0.0)
