"""The time that requests of clients may use while time runs."""

from __future__ import annotations

import time

import pytest

import autodrive
from autodrive import Simulation
from autodrive.connect.server.request_queue import EDIT_BURST, SHARE, Limits
from autodrive.protocol.messages import (
    AddBox,
    EditMap,
    LoadScenario,
    Operation,
    RemoveBox,
    Reset,
    SetWeather,
    Teleport,
    Undo,
    Weather,
)


def test_somebody_who_edits_a_map_twice_a_second_does_not_wait() -> None:
    limits, now = Limits(0.0), time.perf_counter()
    for _ in range(40):
        assert limits.of(EditMap({})).free_at <= now
        limits.pay(EditMap({}), 0.3, now + 0.3)
        now += 0.5


@pytest.mark.parametrize(("operation", "burst"), [(EditMap({}), EDIT_BURST), (Reset(), 0.0)])
def test_a_client_that_never_stops_gets_its_share(operation: EditMap | Reset, burst: float) -> None:
    limits, work = Limits(0.0), 0.3
    start = now = time.perf_counter()
    spent = 0.0
    while now < start + 1000.0:
        now = max(now, limits.of(operation).free_at) + work
        limits.pay(operation, work, now)
        spent += work
    most = SHARE * (now - start) + burst + work
    assert 0.8 * most < spent <= most  # without a burst, the share of the time of a request itself is lost


def test_edits_of_a_map_and_other_requests_do_not_wait_for_each_other() -> None:
    limits, now = Limits(0.0), time.perf_counter()
    limits.pay(EditMap({}), EDIT_BURST + 10.0, now)
    assert limits.of(Reset()).free_at <= now < limits.of(EditMap({})).free_at
    limits.pay(Reset(), 1.0, now)
    assert limits.of(Reset()).free_at == pytest.approx(now + 1.0 / SHARE)


@pytest.mark.parametrize("short", [Reset(), Teleport("V1", 0.0, 0.0), SetWeather(Weather(rain=0.5))])
@pytest.mark.parametrize("build", [AddBox("a", 0.0, 0.0), RemoveBox("a"), LoadScenario("plane"), EditMap({}), Undo()])
def test_short_requests_do_not_wait_until_builds_are_paid(build: Operation, short: Operation) -> None:
    limits, now = Limits(0.0), time.perf_counter()
    limits.pay(build, EDIT_BURST + 10.0, now)
    assert limits.of(short).free_at <= now < limits.of(build).free_at


def test_a_short_request_that_waits_for_a_build_pays_only_for_its_own_work() -> None:
    simulation = Simulation(autodrive.make("plane"))
    done = simulation.request(Teleport("V1", 1.0, 0.0))
    before = time.perf_counter()
    simulation.execute_requests()
    assert before <= done.began <= time.perf_counter()
