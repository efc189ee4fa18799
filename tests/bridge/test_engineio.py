"""The conversation against recorded handshakes of the three kinds of server, and against anything at all."""

from __future__ import annotations

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.bridge.engineio import (
    HANDSHAKE_TIME,
    LISTENING_TIME,
    Acknowledgement,
    Conversation,
    ConversationEnd,
    Dialect,
    Event,
    PacketError,
    event_packet,
)

# recorded: python-socketio 4.2 with engineio 3.13, and 5.18 with 4.15
GREETING_3 = '0{"sid":"5a685806efb54f7db7b54de74812bd54","upgrades":[],"pingTimeout":60000,"pingInterval":25000}'
GREETING_4 = (
    '0{"sid":"ND4XfVEQW_YA65MqAAAA","upgrades":[],"pingTimeout":20000,"pingInterval":25000,"maxPayload":1000000}'
)
ADMISSION_4 = '40{"sid":"Ux2sLKthMzrcNqqEAAAB"}'


def sent(conversation: Conversation) -> list[str]:
    packets, conversation.outbox = conversation.outbox, []
    return packets


def test_an_old_server_lets_us_in_unasked_and_is_pinged() -> None:
    conversation = Conversation(0.0)
    conversation.receive(GREETING_3, 0.01)
    conversation.receive("40", 0.02)
    assert (conversation.dialect, conversation.is_open) == (Dialect.ENGINE_IO_3, True)
    conversation.pass_time(0.02)
    assert sent(conversation) == ["2"]
    assert conversation.deadline == pytest.approx(25.02)  # the interval that it asked for
    conversation.receive("3", 0.03)
    conversation.pass_time(25.02)
    assert sent(conversation) == ["2"]


def test_a_new_server_is_asked_to_let_us_in_and_its_pings_are_answered() -> None:
    conversation = Conversation(0.0)
    conversation.receive(GREETING_4, 0.01)
    assert sent(conversation) == ["40"]
    assert not conversation.is_open
    conversation.receive(ADMISSION_4, 0.02)
    assert (conversation.dialect, conversation.is_open) == (Dialect.ENGINE_IO_4, True)
    conversation.receive("2", 25.0)
    conversation.pass_time(1000.0)  # its missing pings are no reason to go
    assert sent(conversation) == ["3"]


def test_a_new_server_that_tells_no_limit_is_asked_after_a_while() -> None:
    conversation = Conversation(0.0)
    conversation.receive(GREETING_3, 0.0)
    conversation.pass_time(LISTENING_TIME)
    assert sent(conversation) == ["40"]
    conversation.receive(ADMISSION_4, 0.5)
    assert conversation.dialect is Dialect.ENGINE_IO_4


def test_an_old_server_that_is_slow_to_let_us_in_is_still_pinged() -> None:
    conversation = Conversation(0.0)
    conversation.receive(GREETING_3, 0.0)
    conversation.pass_time(LISTENING_TIME)
    conversation.receive("40", 2.0)
    conversation.pass_time(2.0)
    assert sent(conversation) == ["40", "2"]


def test_a_server_that_says_nothing_is_taken_for_a_raw_one() -> None:
    conversation = Conversation(0.0)
    conversation.pass_time(0.9 * LISTENING_TIME)
    assert not conversation.is_open
    conversation.pass_time(LISTENING_TIME)
    assert (conversation.dialect, conversation.is_open) == (Dialect.RAW, True)
    assert sent(conversation) == []


def test_a_server_that_speaks_late_is_no_raw_one_after_all() -> None:
    conversation = Conversation(0.0)
    conversation.pass_time(LISTENING_TIME)
    conversation.receive(GREETING_4, 1.0)
    assert not conversation.is_open
    conversation.receive(ADMISSION_4, 1.1)
    assert (conversation.dialect, conversation.is_open) == (Dialect.ENGINE_IO_4, True)


def test_a_server_that_does_not_let_us_in_is_left() -> None:
    conversation = Conversation(0.0)
    conversation.receive(GREETING_4, 0.0)
    with pytest.raises(ConversationEnd, match="did not let us in"):
        conversation.pass_time(HANDSHAKE_TIME)


def test_the_limit_of_the_server_is_heeded() -> None:
    conversation = Conversation(0.0)
    conversation.receive('0{"maxPayload":5000}', 0.0)
    assert conversation.max_payload == 5000


@pytest.mark.parametrize("packet", ["1", "41", '44{"message":"not for you"}'])
def test_a_goodbye_ends_the_conversation(packet: str) -> None:
    with pytest.raises(ConversationEnd):
        Conversation(0.0).receive(packet, 0.0)


def test_events_and_acknowledgements_are_understood() -> None:
    conversation = Conversation(0.0)
    assert conversation.receive('42["Bridge",{"V1 Throttle":"1"}]', 0.0) == Event("Bridge", [{"V1 Throttle": "1"}])
    assert conversation.receive("4317[]", 0.0) == Acknowledgement(17)
    assert conversation.receive('425["Bridge",{}]', 0.0) == Event("Bridge", [{}])
    assert sent(conversation) == ["435[]"]  # it asked for an acknowledgement


def test_an_event_is_written_as_the_original_writes_it() -> None:
    assert event_packet("Bridge", {"V1 Throttle": "0.000"}) == '42["Bridge",{"V1 Throttle":"0.000"}]'
    assert event_packet("Bridge", {}, 12) == '4212["Bridge",{}]'


@pytest.mark.parametrize(
    "packet", ["", "9", "hello", "42", "42{}", "42[", "42[1]", "42[]", "42[" * 20000, "0[]", "451-[]"]
)
def test_nonsense_is_called_so(packet: str) -> None:
    with pytest.raises(PacketError):
        Conversation(0.0).receive(packet, 0.0)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3),
    max_leaves=6,
).map(json.dumps)
HEADS = st.sampled_from(["0", "1", "2", "3", "4", "40", "41", "42", "43", "42/x,", "4217", "44", "45", "6", ""])
GREETINGS = st.fixed_dictionaries(
    {}, optional={key: st.integers() | st.floats() | st.text() for key in ("pingInterval", "pingTimeout", "maxPayload")}
).map(lambda fields: "0" + json.dumps(fields))
PACKETS = st.one_of(st.text(max_size=30), GREETINGS, st.builds(str.__add__, HEADS, JSON))


@given(st.lists(st.tuples(PACKETS, st.floats(0.0, 30.0)), max_size=12))
def test_whatever_comes_only_the_two_known_errors_do(packets: list[tuple[str, float]]) -> None:
    now = 0.0
    conversation = Conversation(now)
    for packet, delay in packets:
        now += delay
        with contextlib.suppress(PacketError, ConversationEnd):
            conversation.receive(packet, now)
        with contextlib.suppress(ConversationEnd):
            conversation.pass_time(now)
        assert conversation.max_payload > 0
        assert len(sent(conversation)) <= 3
