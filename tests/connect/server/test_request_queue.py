"""The time that requests of clients may use while time runs."""

from __future__ import annotations

import time

import pytest

import autodrive
from autodrive import Simulation
from autodrive.connect.server.operations import KINDS, SHORT
from autodrive.connect.server.request_queue import EDIT_BURST, SHARE, Limits, RequestKind
from autodrive.protocol.messages import (
    AddBox,
    EditMap,
    LoadScenario,
    RemoveBox,
    Reset,
    SetWeather,
    Teleport,
    Undo,
)

EDIT, RESET = KINDS[EditMap], KINDS[Reset]


def test_somebody_who_edits_a_map_twice_a_second_does_not_wait() -> None:
    limits, now = Limits(0.0), time.perf_counter()
    for _ in range(40):
        assert limits.free_at(EDIT) <= now
        limits.pay(EDIT, 0.3, now + 0.3)
        now += 0.5


@pytest.mark.parametrize(("kind", "burst"), [(EDIT, EDIT_BURST), (RESET, 0.0)])
def test_a_client_that_never_stops_gets_its_share(kind: RequestKind, burst: float) -> None:
    limits, work = Limits(0.0), 0.3
    start = now = time.perf_counter()
    spent = 0.0
    while now < start + 1000.0:
        now = max(now, limits.free_at(kind)) + work
        limits.pay(kind, work, now)
        spent += work
    most = SHARE * (now - start) + burst + work
    assert 0.8 * most < spent <= most  # without a burst, the share of the time of a request itself is lost


def test_edits_of_a_map_and_other_requests_do_not_wait_for_each_other() -> None:
    limits, now = Limits(0.0), time.perf_counter()
    limits.pay(EDIT, EDIT_BURST + 10.0, now)
    assert limits.free_at(RESET) <= now < limits.free_at(EDIT)
    limits.pay(RESET, 1.0, now)
    assert limits.free_at(RESET) == pytest.approx(now + 1.0 / SHARE)


@pytest.mark.parametrize("short", [Reset, Teleport, SetWeather])
@pytest.mark.parametrize("build", [AddBox, RemoveBox, LoadScenario, EditMap, Undo])
def test_short_requests_do_not_wait_until_builds_are_paid(build: type, short: type) -> None:
    limits, now = Limits(0.0), time.perf_counter()
    limits.pay(KINDS[build], EDIT_BURST + 10.0, now)
    assert limits.free_at(KINDS.get(short, SHORT)) <= now < limits.free_at(KINDS[build])


def test_a_short_request_that_waits_for_a_build_pays_only_for_its_own_work() -> None:
    simulation = Simulation(autodrive.make("plane"))
    done = simulation.request(Teleport("V1", 1.0, 0.0))
    before = time.perf_counter()
    simulation.execute_requests()
    assert before <= done.began <= time.perf_counter()
