"""Driver leases, with a simulated clock."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from autodrive.connect.server.driver_lease import LEASE_TIME, DriverLeases


def test_the_first_client_drives_and_others_get_its_name() -> None:
    leases = DriverLeases()
    assert leases.acquire("V1", "ann", "person", "person", 0.0) is None
    assert leases.acquire("V1", "bob", "person", "person", 1.0) == "ann"
    assert leases.acquire("V2", "bob", "person", "person", 1.0) is None
    assert leases.drivers(1.0) == {"V1": "ann", "V2": "bob"}


def test_a_lease_expires_without_commands() -> None:
    leases = DriverLeases()
    leases.acquire("V1", "ann", "person", "person", 0.0)
    leases.acquire("V1", "ann", "person", "person", 1.0)
    assert leases.acquire("V1", "bob", "person", "person", 0.99 + LEASE_TIME) == "ann"
    assert leases.drivers(1.0 + LEASE_TIME) == {}
    assert leases.acquire("V1", "bob", "person", "person", 1.0 + LEASE_TIME) is None


def test_only_the_driver_can_release() -> None:
    leases = DriverLeases()
    leases.acquire("V1", "ann", "person", "person", 0.0)
    leases.release("V1", "bob")
    assert leases.drivers(0.0) == {"V1": "ann"}
    leases.release("V1", "ann")
    leases.release("V1", "ann")
    assert leases.drivers(0.0) == {}


def test_a_client_that_leaves_releases_all_vehicles() -> None:
    leases = DriverLeases()
    for vehicle in ("V1", "V2"):
        leases.acquire(vehicle, "ann", "script", "script", 0.0)
    leases.acquire("V3", "bob", "script", "script", 0.0)
    leases.release_all("ann")
    assert leases.drivers(0.0) == {"V3": "bob"}


def test_a_change_of_mode_ends_the_lease_of_the_other_source() -> None:
    leases = DriverLeases()
    leases.acquire("V1", "ann", "person", "person", 0.0)
    assert leases.acquire("V1", "robot", "script", "script", 0.1) is None
    assert leases.drivers(0.1) == {"V1": "robot"}


@given(st.lists(st.tuples(st.sampled_from("abc"), st.floats(0.0, 1.0), st.booleans()), max_size=50))
def test_the_driver_is_the_client_whose_command_was_accepted_last(moves: list[tuple[str, float, bool]]) -> None:
    leases, now, holder, until = DriverLeases(), 0.0, None, 0.0
    for who, pause, lets_go in moves:
        now += pause
        if lets_go:
            leases.release("V1", who)
            holder = None if who == holder else holder
            continue
        free = holder in (None, who) or now >= until
        assert (leases.acquire("V1", who, "person", "person", now) is None) == free
        if free:
            holder, until = who, now + LEASE_TIME
    assert leases.drivers(now).get("V1") == (holder if now < until else None)
