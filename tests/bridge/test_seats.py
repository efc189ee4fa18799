"""Who holds the wheel, by an invented clock."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from autodrive.bridge.seats import SILENCE, Seats


def test_the_first_holds_the_wheel_and_others_are_told_who() -> None:
    seats = Seats()
    assert seats.take("V1", "ann", "person", "person", 0.0) is None
    assert seats.take("V1", "bob", "person", "person", 1.0) == "ann"
    assert seats.take("V2", "bob", "person", "person", 1.0) is None
    assert seats.drivers(1.0) == {"V1": "ann", "V2": "bob"}


def test_a_silent_driver_has_let_go() -> None:
    seats = Seats()
    seats.take("V1", "ann", "person", "person", 0.0)
    seats.take("V1", "ann", "person", "person", 1.0)
    assert seats.take("V1", "bob", "person", "person", 0.99 + SILENCE) == "ann"
    assert seats.drivers(1.0 + SILENCE) == {}
    assert seats.take("V1", "bob", "person", "person", 1.0 + SILENCE) is None


def test_only_the_holder_can_release() -> None:
    seats = Seats()
    seats.take("V1", "ann", "person", "person", 0.0)
    seats.release("V1", "bob")
    assert seats.drivers(0.0) == {"V1": "ann"}
    seats.release("V1", "ann")
    seats.release("V1", "ann")
    assert seats.drivers(0.0) == {}


def test_who_leaves_lets_go_of_everything() -> None:
    seats = Seats()
    for vehicle in ("V1", "V2"):
        seats.take(vehicle, "ann", "script", "script", 0.0)
    seats.take("V3", "bob", "script", "script", 0.0)
    seats.leave("ann")
    assert seats.drivers(0.0) == {"V3": "bob"}


def test_a_change_of_mode_ends_the_hold_of_the_other_kind() -> None:
    seats = Seats()
    seats.take("V1", "ann", "person", "person", 0.0)
    assert seats.take("V1", "robot", "script", "script", 0.1) is None
    assert seats.drivers(0.1) == {"V1": "robot"}


@given(st.lists(st.tuples(st.sampled_from("abc"), st.floats(0.0, 1.0), st.booleans()), max_size=50))
def test_whoever_holds_it_is_the_one_whose_command_was_last_taken(moves: list[tuple[str, float, bool]]) -> None:
    seats, now, holder, until = Seats(), 0.0, None, 0.0
    for who, pause, lets_go in moves:
        now += pause
        if lets_go:
            seats.release("V1", who)
            holder = None if who == holder else holder
            continue
        free = holder in (None, who) or now >= until
        assert (seats.take("V1", who, "person", "person", now) is None) == free
        if free:
            holder, until = who, now + SILENCE
    assert seats.drivers(now).get("V1") == (holder if now < until else None)
