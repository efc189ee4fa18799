"""The server of the devkit against the devkit bridge, and against the messages of the original simulator."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import pytest
from websockets.sync.client import ClientConnection, connect

from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.engineio import Dialect
from autodrive.connect.devkit import Nigel, Server, drive
from tests.support.waiting import LIMIT, free_port, is_listening, wait_until

ADDRESS = "ws://127.0.0.1:{}/socket.io/?EIO=4&transport=websocket"


@pytest.fixture
def echo() -> Iterator[Server]:
    """Replies with the message that it received."""
    with Server(lambda data: {key: str(value) for key, value in data.items()}, port=0) as server:
        yield server


def bridge_message(**data: object) -> str:
    return "42" + json.dumps(["Bridge", data])


def test_our_simulator_is_driven(simulation: Simulation) -> None:
    nigel = Nigel("V1")

    def respond(data: Mapping[str, str]) -> dict[str, str]:
        nigel.parse_data(data)
        nigel.throttle_command, nigel.steering_command = 1, 0
        return nigel.generate_commands()

    with Server(respond, port=0) as server, DevkitBridge(simulation, port=server.port) as bridge:
        wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.2)
        assert bridge.counters.dialect is Dialect.ENGINE_IO_3
        assert bridge.counters.resends == 0
        wait_until(lambda: nigel.position is not None and nigel.position[0] > 0.1)


@pytest.mark.parametrize("host", ["::1", "[::1]"])
def test_a_script_listens_at_an_ipv6_address(simulation: Simulation, host: str) -> None:
    nigel = Nigel("V1")

    def step() -> None:
        nigel.throttle_command, nigel.steering_command = 1, 0
        if simulation.frame.vehicles["V1"].speed > 0.1:
            raise StopIteration

    port = free_port()
    with DevkitBridge(simulation, host, port) as bridge:
        assert bridge.address == f"[::1]:{port}"
        with pytest.raises(StopIteration):
            drive(step, nigel, host=host, port=port)


def test_the_original_simulator_is_understood(echo: Server) -> None:
    """It sends at once without waiting for the handshake, never sends 40, and pings (section 1.2 of its spec)."""
    with connect(ADDRESS.format(echo.port)) as original:
        original.send(bridge_message(a="1"))
        original.send("2")
        packets = [text(original) for _ in range(4)]
        assert json.loads(packets[0][1:])["pingInterval"] == 25000
        assert packets[0][0] == "0"
        assert packets[1:] == ["40", '42["Bridge",{"a":"1"}]', "3"]


def test_a_numbered_event_is_acknowledged_after_its_answer(echo: Server) -> None:
    with connect(ADDRESS.format(echo.port)) as simulator:
        simulator.send('4217["Bridge",{"a":"1"}]')
        assert [text(simulator) for _ in range(4)][2:] == ['42["Bridge",{"a":"1"}]', "4317[]"]


def text(connection: ClientConnection) -> str:
    packet = connection.recv(timeout=LIMIT)
    assert isinstance(packet, str)
    return packet


def test_two_simulators_get_their_own_answers(echo: Server) -> None:
    assert not echo.is_connected
    with connect(ADDRESS.format(echo.port)) as one, connect(ADDRESS.format(echo.port)) as other:
        for _ in range(2):
            text(one)
            text(other)
        one.send(bridge_message(a="1"))
        other.send(bridge_message(b="2"))
        assert text(one) == '42["Bridge",{"a":"1"}]'
        assert text(other) == '42["Bridge",{"b":"2"}]'
        one.close()
        assert echo.is_connected
    wait_until(lambda: not echo.is_connected)


@pytest.mark.parametrize(
    "invalid",
    ["42", "42[", '42["Bridge"]', '42["Other",{"a":1}]', '42["Bridge",[]]', "42" + "[" * 100_000, "x", "", "1"],
)
def test_an_invalid_packet_is_ignored_and_the_next_message_is_answered(echo: Server, invalid: str) -> None:
    with connect(ADDRESS.format(echo.port)) as simulator:
        simulator.send(invalid)
        simulator.send(bridge_message(a="1"))
        assert [text(simulator) for _ in range(3)][-1] == '42["Bridge",{"a":"1"}]'


def test_an_exception_of_the_script_ends_the_loop_and_is_raised() -> None:
    port = free_port()
    with ThreadPoolExecutor() as pool:
        loop = pool.submit(drive, lambda: 1 / 0, Nigel("V1"), port=port)
        wait_until(lambda: is_listening(port))
        with connect(ADDRESS.format(port)) as simulator:
            simulator.send(bridge_message(a="1"))
            with pytest.raises(ZeroDivisionError):
                loop.result(LIMIT)


def test_ctrl_c_ends_the_loop_without_a_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Server, "wait", Mock(side_effect=KeyboardInterrupt))
    drive(int, Nigel("V1"), port=0)


def test_a_browser_gets_an_explanation(echo: Server) -> None:
    with pytest.raises(urllib.error.HTTPError, match="404") as refused:
        urllib.request.urlopen(f"http://127.0.0.1:{echo.port}/", timeout=LIMIT)
    assert b"driving script" in refused.value.read()


def test_a_port_in_use_is_an_error_at_once(echo: Server) -> None:
    with pytest.raises(OSError, match="in use"):
        Server(lambda data: None, port=echo.port)
