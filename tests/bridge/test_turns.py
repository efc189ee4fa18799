"""Turns against the ways in which scripts answer, in made-up time."""

from __future__ import annotations

import pytest

from autodrive.bridge.turns import SILENCE, SILENCE_MAX, Turns
from autodrive.protocol.messages import Frame


def new_frame() -> Frame:
    return Frame(time=0.0, tick=0, vehicles={}, objects={}, events=(), scene_light=True)


def answered_turns(now: float = 0.0) -> tuple[Turns, Frame]:
    """After one telemetry that was answered and acknowledged at once."""
    turns, frame = Turns(), new_frame()
    number = turns.begin(frame, now, may_ask=True)
    assert number is not None
    turns.answered(now)
    turns.acknowledged(number)
    return turns, frame


def test_the_first_turn_is_ours() -> None:
    assert Turns().is_ours(new_frame(), 0.0)


def test_without_an_answer_nothing_is_sent_until_the_silence_is_too_long() -> None:
    turns, frame = Turns(), new_frame()
    turns.begin(frame, 0.0, may_ask=True)
    assert not turns.is_ours(new_frame(), 0.99 * SILENCE)
    assert turns.is_ours(frame, SILENCE)


def test_an_answer_asks_for_one_telemetry_of_a_newer_frame() -> None:
    turns, frame = answered_turns()
    assert not turns.is_ours(frame, 0.01)
    assert turns.awaits_frame
    newer = new_frame()
    assert turns.is_ours(newer, 0.01)
    turns.begin(newer, 0.01, may_ask=True)
    assert not turns.is_repeat
    assert not turns.is_ours(new_frame(), 0.02)


def test_silences_grow_longer_but_not_without_end() -> None:
    turns = Turns()
    now, pauses = 0.0, []
    for _ in range(5):
        turns.begin(new_frame(), now, may_ask=False)
        pauses.append(turns.deadline - now)
        now = turns.deadline
    assert pauses == [SILENCE, 2 * SILENCE, SILENCE_MAX, SILENCE_MAX, SILENCE_MAX]
    assert turns.silences == 4
    turns.answered(now)
    assert turns.silences == 0


def test_a_slow_script_is_given_twice_the_time_it_took_last() -> None:
    turns = Turns()
    turns.begin(new_frame(), 0.0, may_ask=False)
    turns.begin(new_frame(), 1.0, may_ask=False)
    assert turns.answered(1.5) == 1.5  # since it was first asked, not since the repetition
    turns.begin(new_frame(), 2.0, may_ask=False)
    assert turns.deadline == 5.0


def test_while_time_stands_still_the_state_is_told_again_but_nobody_is_called_silent() -> None:
    turns, frame = answered_turns()
    assert turns.is_ours(frame, SILENCE)
    turns.begin(frame, SILENCE, may_ask=True)
    assert (turns.is_repeat, turns.silences) == (True, 0)


def test_answers_to_another_simulator_do_not_pile_up_telemetry() -> None:
    """Two simulators at one server, whose replies go to both: of ours, no more than two are ever unprocessed."""
    turns, _ = answered_turns()
    waiting: list[int] = []
    for step in range(100):  # a command every 10 ms; the server gets to ours only every fifth time
        now = 0.01 * (step + 1)
        if step % 5 == 0 and waiting:
            turns.acknowledged(waiting.pop(0))
        turns.answered(now)
        if turns.is_ours(new_frame(), now):
            number = turns.begin(new_frame(), now, may_ask=True)
            assert number is not None
            waiting.append(number)
        assert len(waiting) <= 2


def test_a_server_that_never_acknowledges_is_soon_no_longer_asked() -> None:
    turns, now, asked = Turns(), 0.0, []
    for _ in range(50):
        now = now if turns.is_ours(new_frame(), now) else turns.deadline
        asked.append(turns.begin(new_frame(), now, may_ask=True) is not None)
        turns.answered(now)
    assert sum(asked) == 4
    assert not any(asked[10:])
    assert now == pytest.approx(2 * SILENCE)  # all that it cost


def test_a_server_that_ignores_what_asks_for_acknowledgement_is_soon_no_longer_asked() -> None:
    turns, now = Turns(), 0.0
    for _ in range(50):
        now = now if turns.is_ours(new_frame(), now) else turns.deadline
        if turns.begin(new_frame(), now, may_ask=True) is None:
            turns.answered(now)
    assert now == pytest.approx(3 * SILENCE)  # all that it cost: after the first it might have been a slow script
