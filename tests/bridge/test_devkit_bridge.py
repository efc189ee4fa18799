"""The bridge, on a running simulation, against servers of every temper. Real sockets; bounds on wall time are wide."""

from __future__ import annotations

import base64
import contextlib
import itertools
import json
import socket
import threading
import time
from collections.abc import Iterator, Mapping

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection

from autodrive import AutodriveError, Frame, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.engineio import Dialect
from autodrive.protocol.devkit import no_picture
from autodrive.protocol.messages import Pause, SetDrivingMode
from tests.bridge.conftest import eventually, free_port, peer

FULL_THROTTLE = {"V1 Throttle": "1.000000", "V1 Steering": "0.000000", "V1 Headlights": "1", "V1 Indicators": "0"}
"""As the C++ devkit writes numbers."""


def packet(commands: Mapping[str, object]) -> str:
    return "42" + json.dumps(["Bridge", commands])


def telemetry_in(connection: ServerConnection) -> Iterator[dict[str, str]]:
    """What the client tells, read as strictly as the C++ devkit does; it passes over what is no event."""
    with contextlib.suppress(ConnectionClosed):
        for text in connection:
            if str(text).startswith("42"):
                yield checked(str(text))


def checked(text: str) -> dict[str, str]:
    assert text.endswith("}]")
    assert len(text) < 1_000_000
    assert "null" not in text
    name, data = json.loads(text[2:])
    assert name == "Bridge"
    assert all(isinstance(value, str) for value in data.values())
    return data


def cpp_devkit(connection: ServerConnection) -> None:
    """Says nothing on connect and answers each telemetry: no handshake, no pings."""
    for _ in telemetry_in(connection):
        connection.send(packet(FULL_THROTTLE))


def test_the_raw_dialect_drives_the_car(simulation: Simulation) -> None:
    with peer(cpp_devkit) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert bridge.status == "connected"
        assert bridge.counters.dialect is Dialect.RAW
        assert bridge.counters.profile == "2023"
        assert bridge.counters.resends == bridge.counters.bad_packets == 0
    assert bridge.status == "closed"


def test_a_fast_server_gets_one_telemetry_a_tick_and_no_more(simulation: Simulation) -> None:
    with peer(cpp_devkit) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.telemetry_sent > 10)
        sent, ticks = bridge.counters.telemetry_sent, simulation.ticks
        eventually(lambda: simulation.ticks >= ticks + 50)
        assert bridge.counters.telemetry_sent - sent <= simulation.ticks - ticks + 1  # read at slightly other times
        assert bridge.counters.telemetry_sent - sent > 10


def test_the_state_is_sent_again_to_a_silent_server_with_one_word_in_the_log(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    heard: list[dict[str, str]] = []

    def silent(connection: ServerConnection) -> None:
        heard.extend(telemetry_in(connection))

    with peer(silent) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.resends == 2)
    assert len([line for line in caplog.messages if "the script is silent" in line]) == 1
    # of unknown era: first without a scan, then as text, then compressed
    assert [text[:4] for text in (data["V1 LIDAR Range Array"] for data in heard)] == ["", "inf ", "H4sI"]


def test_while_the_simulation_is_paused_the_script_still_gets_the_state(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    with peer(cpp_devkit) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received > 3)
        simulation.request(Pause()).result(10.0)
        eventually(lambda: bridge.counters.resends >= 2)
    assert "silent" not in caplog.text


def test_nonsense_is_counted_and_told_once(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    def mad(connection: ServerConnection) -> None:
        for nonsense in [
            "hello",
            b"\x00\xff",
            "42[",
            '42["Bridge"]',
            '42["Other",{}]',
            '42["Bridge",[]]',
            "0",
            "9" * 5000,
        ]:
            connection.send(nonsense)
        cpp_devkit(connection)

    with peer(mad) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert bridge.counters.bad_packets == 8
        assert bridge.counters.connections == 1
    assert len(caplog.messages) == 1


def test_refused_values_are_counted_and_told_once(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    def careless(connection: ServerConnection) -> None:
        for _ in telemetry_in(connection):
            connection.send(packet(FULL_THROTTLE | {"V1 Steering": "nan", "V7 Throttle": "1"}))

    with peer(careless) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.refused_values >= 20)
        eventually(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
    assert len(caplog.messages) == 1
    assert "V1 Steering: must be a finite number, not 'nan'" in caplog.text


def test_a_flood_of_commands_neither_stops_the_simulation_nor_is_answered_in_full(simulation: Simulation) -> None:
    def flood(connection: ServerConnection) -> None:
        reading = threading.Thread(target=lambda: list(telemetry_in(connection)), daemon=True)
        reading.start()
        for i in itertools.count():
            connection.send(packet(FULL_THROTTLE | {"V1 Throttle": f"{(i % 100) / 100}"}))

    with peer(flood) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received > 10)
        ticks = simulation.ticks
        eventually(lambda: bridge.counters.commands_received > 5000)
        eventually(lambda: simulation.ticks > ticks + 20)
        assert bridge.counters.telemetry_sent <= simulation.ticks + 2


def test_a_connection_that_breaks_in_the_middle_of_a_frame_is_taken_up_again(simulation: Simulation) -> None:
    visits: list[int] = []

    def breaking(connection: ServerConnection) -> None:
        visits.append(1)
        if len(visits) < 3:
            connection.recv()
            connection.socket.sendall(
                b"\x81\x7e\x04\x00only a few of 1024 bytes"
            )  # RFC 6455: text frame, 16-bit length
            connection.socket.shutdown(socket.SHUT_RDWR)
        else:
            cpp_devkit(connection)

    with peer(breaking) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert bridge.counters.reconnects == 2


def test_what_is_no_websocket_server_is_tried_again_with_one_word_in_the_log(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as listener,
        DevkitBridge(simulation, port=listener.getsockname()[1]) as bridge,
    ):
        for _ in range(3):
            connection, _ = listener.accept()
            connection.recv(1000)
            connection.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            connection.close()
        assert bridge.status == "connecting"
    assert len(caplog.messages) == 1
    assert "HTTP 404" in caplog.text


def test_a_server_that_comes_up_late_is_found(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()
    with DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: "trying again" in caplog.text)
        with peer(cpp_devkit, port):
            eventually(lambda: bridge.counters.commands_received > 3)
        assert bridge.counters.reconnects == 0


def test_host_and_port_can_be_changed_while_running(simulation: Simulation) -> None:
    with peer(cpp_devkit) as first, peer(cpp_devkit) as second, DevkitBridge(simulation, port=first) as bridge:
        eventually(lambda: bridge.counters.commands_received > 3)
        bridge.connect("localhost", second)
        assert bridge.address == f"localhost:{second}"
        eventually(lambda: bridge.counters.reconnects == 1 and bridge.counters.commands_received > 10)


def test_at_the_end_we_say_goodbye(simulation: Simulation) -> None:
    last: list[str] = []

    def listening(connection: ServerConnection) -> None:
        for text in connection:
            last.append(str(text)[:5])
            if str(text).startswith("42"):  # after the goodbye nobody listens
                connection.send(packet(FULL_THROTTLE))

    with peer(listening) as port:
        with DevkitBridge(simulation, port=port) as bridge:
            eventually(lambda: bridge.counters.commands_received > 3)
        eventually(lambda: last[-2:] == ["41", "1"])


def test_in_manual_mode_telemetry_goes_out_and_commands_do_not_come_in(simulation: Simulation) -> None:
    simulation.request(SetDrivingMode("V1", is_autonomous=False)).result(10.0)
    with peer(cpp_devkit) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received > 30)
        assert simulation.frame.vehicles["V1"].throttle == 0.0


def test_a_held_reset_resets_once(simulation: Simulation) -> None:
    steps = itertools.count()

    def resetting(connection: ServerConnection) -> None:
        for _ in telemetry_in(connection):
            is_held = 50 <= next(steps) < 60
            connection.send(packet({"V1 Throttle": "1", "V1 Reset": str(is_held)}))

    resets: list[float] = []

    class Watch:
        before = -1.0

        def publish(self, frame: Frame) -> None:
            if frame.time < self.before:
                resets.append(self.before)
            self.before = frame.time

    simulation.add_sink(Watch())
    with peer(resetting) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received > 80)
        assert bridge.counters.profile == "2025"
    assert len(resets) == 1


def test_pictures_that_make_a_message_too_long_are_left_out(simulation: Simulation) -> None:
    heard: list[dict[str, str]] = []

    def listening(connection: ServerConnection) -> None:
        for data in telemetry_in(connection):
            heard.append(data)
            connection.send(packet(FULL_THROTTLE))

    too_large = {("V1", "front"): b"\xff\xd8" + bytes(10**6)}
    with peer(listening) as port, DevkitBridge(simulation, port=port, images=lambda *_: too_large) as bridge:
        eventually(lambda: len(heard) > 10)
        assert bridge.counters.oversized == 0
    assert all(data["V1 Front Camera Image"] == data["V1 Rear Camera Image"] == no_picture() for data in heard)


def test_pictures_become_coarser_until_the_message_fits(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    heard: list[dict[str, str]] = []

    def listening(connection: ServerConnection) -> None:
        for data in telemetry_in(connection):
            heard.append(data)
            connection.send(packet(FULL_THROTTLE))

    def images(_: Frame, share: float) -> dict[tuple[str, str], bytes]:
        return {("V1", "front"): b"\xff\xd8" + bytes(round(1.5e6 * share))}  # base64: 2 MB at full quality

    with peer(listening) as port, DevkitBridge(simulation, port=port, profile="2025", images=images) as bridge:
        eventually(lambda: len(heard) > 10)
        assert bridge.counters.oversized == 0
    sizes = {len(base64.b64decode(data["V1 Front Camera Image"])) for data in heard}
    assert sizes == {2 + round(1.5e6 * 0.45)}  # 0.9 MB in base64; 0.7 would be 1.4
    assert len([line for line in caplog.messages if "pictures are sent at 45% of their quality" in line]) == 1


def test_a_message_longer_than_the_server_takes_is_never_sent(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    heard: list[str] = []

    def small(connection: ServerConnection) -> None:
        connection.send('0{"sid":"x","upgrades":[],"pingTimeout":20000,"pingInterval":25000,"maxPayload":2000}')
        for text in connection:
            heard.append(str(text))
            if text == "40":
                connection.send('40{"sid":"y"}')

    with peer(small) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.oversized >= 2)
        assert bridge.counters.telemetry_sent == 0
    assert heard == ["40", "41", "1"]
    assert len([line for line in caplog.messages if "longer than 2000" in line]) == 1


def test_a_profile_that_is_given_is_used_from_the_first_message(simulation: Simulation) -> None:
    heard: list[dict[str, str]] = []

    def listening(connection: ServerConnection) -> None:
        for data in telemetry_in(connection):
            heard.append(data)
            connection.send(packet({"V1 Throttle": "1", "V1 Reset": "False"}))

    with peer(listening) as port, DevkitBridge(simulation, port=port, profile="2020") as bridge:
        eventually(lambda: len(heard) > 3)
        assert bridge.counters.profile == "2020"
    assert all("Throttle" in data and "V1 Throttle" not in data for data in heard)


def test_publishing_a_frame_costs_the_simulation_next_to_nothing(simulation: Simulation) -> None:
    with peer(cpp_devkit) as port, DevkitBridge(simulation, port=port) as bridge:
        eventually(lambda: bridge.counters.commands_received > 10)
        frame, took = simulation.frame, []
        for _ in range(200):
            began = time.perf_counter()
            bridge.publish(frame)
            took.append(time.perf_counter() - began)
    assert sorted(took)[100] < 0.5e-3  # a twentieth of a tick; measured: some microseconds


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"profile": "2021"}, "devkit profile '2021' is not known. Known: 2020, 2022, 2023, 2025."),
        ({"port": 0}, "devkit port 0 is not from 1 to 65535"),
        ({"host": ""}, "devkit host '' is not a name or an IP address"),
        ({"host": "ws://robot"}, "devkit host 'ws://robot' is not"),
    ],
)
def test_wrong_options_are_told_at_once(simulation: Simulation, options: dict[str, object], words: str) -> None:
    with pytest.raises(AutodriveError) as told:
        DevkitBridge(simulation, **options)  # pyright: ignore[reportArgumentType]
    assert words in str(told.value)
