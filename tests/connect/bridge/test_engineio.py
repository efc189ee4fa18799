"""The Socket.IO client against recorded handshakes of three kinds of server, and against random packets."""

from __future__ import annotations

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.connect.bridge.engineio import (
    HANDSHAKE_TIME,
    LISTENING_TIME,
    Acknowledgement,
    ConnectionEnd,
    Dialect,
    EngineIoConnection,
    Event,
    PacketError,
    event_packet,
    padded,
)
from autodrive.protocol.devkit_profile import Handshake

# recorded: python-socketio 4.2 with engineio 3.13, and 5.18 with 4.15
HANDSHAKE_3 = '0{"sid":"5a685806efb54f7db7b54de74812bd54","upgrades":[],"pingTimeout":60000,"pingInterval":25000}'
HANDSHAKE_4 = (
    '0{"sid":"ND4XfVEQW_YA65MqAAAA","upgrades":[],"pingTimeout":20000,"pingInterval":25000,"maxPayload":1000000}'
)
ADMISSION_4 = '40{"sid":"Ux2sLKthMzrcNqqEAAAB"}'


def sent(connection: EngineIoConnection) -> list[str]:
    packets, connection.outbox = connection.outbox, []
    return packets


def test_an_engine_io_3_server_accepts_the_connection_and_is_pinged() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(HANDSHAKE_3, 0.01)
    connection.receive("40", 0.02)
    assert (connection.dialect, connection.is_open) == (Dialect.ENGINE_IO_3, True)
    connection.check_timers(0.02)
    assert sent(connection) == ["2"]
    assert connection.deadline == pytest.approx(25.02)  # the interval that it asked for
    connection.receive("3", 0.03)
    connection.check_timers(25.02)
    assert sent(connection) == ["2"]


def test_a_given_handshake_waits_for_a_slow_server() -> None:
    servers: list[tuple[Handshake, str, str]] = [
        ("engineio-3", HANDSHAKE_3, "40"),
        ("engineio-4", HANDSHAKE_4, ADMISSION_4),
    ]
    for handshake, first, rest in servers:
        connection = EngineIoConnection(0.0, handshake)
        connection.check_timers(10 * LISTENING_TIME)
        assert not connection.is_open
        connection.receive(first, 10 * LISTENING_TIME)
        connection.check_timers(20 * LISTENING_TIME)
        assert sent(connection) == (["40"] if handshake == "engineio-4" else [])
        connection.receive(rest, 20 * LISTENING_TIME)
        assert connection.is_open
        with pytest.raises(ConnectionEnd):
            EngineIoConnection(0.0, handshake).check_timers(HANDSHAKE_TIME)


def test_a_given_raw_server_gets_telemetry_at_once() -> None:
    connection = EngineIoConnection(0.0, "raw")
    connection.check_timers(0.0)
    assert (connection.dialect, connection.is_open) == (Dialect.RAW, True)


def test_an_event_is_padded_within_its_brackets() -> None:
    packet = event_packet("Bridge", {"V1 Throttle": "1"})
    longer = padded(packet, 1000)
    assert len(longer) == 1000
    assert longer.endswith("}]")
    assert json.loads(longer[2:]) == json.loads(packet[2:])
    assert padded(packet, 5) == packet


def test_an_engine_io_4_server_is_asked_to_connect_and_its_pings_are_answered() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(HANDSHAKE_4, 0.01)
    assert sent(connection) == ["40"]
    assert not connection.is_open
    connection.receive(ADMISSION_4, 0.02)
    assert (connection.dialect, connection.is_open) == (Dialect.ENGINE_IO_4, True)
    connection.receive("2", 25.0)
    connection.check_timers(1000.0)  # missing pings do not end the connection
    assert sent(connection) == ["3"]


def test_an_engine_io_4_server_without_max_payload_is_asked_after_a_timeout() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(HANDSHAKE_3, 0.0)
    connection.check_timers(LISTENING_TIME)
    assert sent(connection) == ["40"]
    assert not connection.is_open
    connection.receive(ADMISSION_4, 0.5)
    assert connection.dialect is Dialect.ENGINE_IO_4


@pytest.mark.parametrize("handshake", [HANDSHAKE_3, HANDSHAKE_4])
def test_a_server_that_never_admits_gets_telemetry_without_acknowledgements(handshake: str) -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(handshake, 0.0)
    connection.check_timers(LISTENING_TIME)
    connection.check_timers(2 * LISTENING_TIME)
    assert (connection.dialect, connection.is_open) == (Dialect.ENGINE_IO_3, True)
    assert sent(connection) == ["40"]  # no ping yet, which ends the connection to a server of Engine.IO 4
    assert not connection.acknowledges
    connection.receive(ADMISSION_4, 1.0)
    assert (connection.dialect, connection.acknowledges) == (Dialect.ENGINE_IO_4, True)


def test_a_server_that_sends_an_event_before_it_admits_gets_telemetry_at_once() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(HANDSHAKE_3, 0.0)
    assert isinstance(connection.receive('42["Bridge",{}]', 0.01), Event)
    assert (connection.dialect, connection.is_open, connection.acknowledges) == (Dialect.ENGINE_IO_3, True, False)


def test_an_engine_io_3_server_that_accepts_late_is_still_pinged() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive(HANDSHAKE_3, 0.0)
    connection.check_timers(LISTENING_TIME)
    connection.receive("40", 2.0)
    connection.check_timers(2.0)
    assert sent(connection) == ["40", "2"]


def test_a_server_that_sends_nothing_is_classified_as_raw() -> None:
    connection = EngineIoConnection(0.0)
    connection.check_timers(0.9 * LISTENING_TIME)
    assert not connection.is_open
    connection.check_timers(LISTENING_TIME)
    assert (connection.dialect, connection.is_open) == (Dialect.RAW, True)
    assert sent(connection) == []


def test_a_server_that_sends_its_handshake_late_is_reclassified() -> None:
    connection = EngineIoConnection(0.0)
    connection.check_timers(LISTENING_TIME)
    connection.receive(HANDSHAKE_4, 1.0)
    assert not connection.is_open
    connection.receive(ADMISSION_4, 1.1)
    assert (connection.dialect, connection.is_open) == (Dialect.ENGINE_IO_4, True)


def test_a_handshake_timeout_ends_the_connection() -> None:
    connection = EngineIoConnection(0.0, "engineio-4")
    connection.receive(HANDSHAKE_4, 0.0)
    with pytest.raises(ConnectionEnd, match="no handshake"):
        connection.check_timers(HANDSHAKE_TIME)


def test_the_payload_limit_of_the_server_is_used() -> None:
    connection = EngineIoConnection(0.0)
    connection.receive('0{"maxPayload":5000}', 0.0)
    assert connection.max_payload == 5000


@pytest.mark.parametrize("packet", ["1", "41", '44{"message":"not for you"}'])
def test_close_packets_end_the_connection(packet: str) -> None:
    with pytest.raises(ConnectionEnd):
        EngineIoConnection(0.0).receive(packet, 0.0)


def test_events_and_acknowledgements_are_parsed() -> None:
    connection = EngineIoConnection(0.0)
    assert connection.receive('42["Bridge",{"V1 Throttle":"1"}]', 0.0) == Event("Bridge", [{"V1 Throttle": "1"}])
    assert connection.receive("4317[]", 0.0) == Acknowledgement(17)
    assert connection.receive('425["Bridge",{}]', 0.0) == Event("Bridge", [{}])
    assert sent(connection) == ["435[]"]  # the server requested an acknowledgement


def test_an_event_is_encoded_as_by_the_original() -> None:
    assert event_packet("Bridge", {"V1 Throttle": "0.000"}) == '42["Bridge",{"V1 Throttle":"0.000"}]'
    assert event_packet("Bridge", {}, 12) == '4212["Bridge",{}]'


@pytest.mark.parametrize(
    "packet", ["", "9", "hello", "42", "42{}", "42[", "42[1]", "42[]", "42[" * 20000, "0[]", "451-[]"]
)
def test_invalid_packets_raise_packet_error(packet: str) -> None:
    with pytest.raises(PacketError):
        EngineIoConnection(0.0).receive(packet, 0.0)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3),
    max_leaves=6,
).map(json.dumps)
HEADS = st.sampled_from(["0", "1", "2", "3", "4", "40", "41", "42", "43", "42/x,", "4217", "44", "45", "6", ""])
HANDSHAKES = st.fixed_dictionaries(
    {}, optional={key: st.integers() | st.floats() | st.text() for key in ("pingInterval", "pingTimeout", "maxPayload")}
).map(lambda fields: "0" + json.dumps(fields))
PACKETS = st.one_of(st.text(max_size=30), HANDSHAKES, st.builds(str.__add__, HEADS, JSON))


@pytest.mark.slow
@given(st.lists(st.tuples(PACKETS, st.floats(0.0, 30.0)), max_size=12))
def test_random_packets_raise_only_the_two_known_errors(packets: list[tuple[str, float]]) -> None:
    now = 0.0
    connection = EngineIoConnection(now)
    for packet, delay in packets:
        now += delay
        with contextlib.suppress(PacketError, ConnectionEnd):
            connection.receive(packet, now)
        with contextlib.suppress(ConnectionEnd):
            connection.check_timers(now)
        assert connection.max_payload > 0
        assert len(sent(connection)) <= 3
