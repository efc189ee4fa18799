"""Hostile devkit scripts: time continues, memory is bounded, and a signal ends the run."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from websockets.frames import Frame, Opcode
from websockets.server import ServerProtocol
from websockets.sync.server import ServerConnection

from autodrive import Simulation
from autodrive.connect.bridge import devkit
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.engineio import ConnectionEnd, EngineIoConnection, PacketError
from tests.connect.bridge.conftest import peer
from tests.support.command_line import Started
from tests.support.waiting import LIMIT, wait_until


def reset_packet(*, is_held: bool) -> str:
    return "42" + json.dumps(["Bridge", {"V1 Throttle": "1", "V1 Steering": "0", "V1 Reset": str(is_held)}])


def toggles_reset(connection: ServerConnection) -> None:
    """Presses and releases the reset key with every two messages, as fast as it can."""
    while True:
        connection.send(reset_packet(is_held=True))
        connection.send(reset_packet(is_held=False))


def pings_without_reading(connection: ServerConnection) -> None:
    connection.send('0{"sid":"x","upgrades":[],"pingTimeout":20000,"pingInterval":25000}')
    connection.send("40")
    while True:
        connection.send("2" + 900_000 * "x")


def test_answers_to_a_server_that_does_not_read_are_bounded() -> None:
    connection = EngineIoConnection(0.0)
    with pytest.raises(PacketError, match="a ping of 900001 characters"):
        connection.receive("2" + 900_000 * "x", 0.0)
    for _ in range(1000):
        connection.receive("2probe", 0.0)
    with pytest.raises(ConnectionEnd, match="does not read messages"):
        connection.receive("2probe", 0.0)
    assert connection.outbox == 1000 * ["3probe"]
    with pytest.raises(ConnectionEnd, match="does not read messages"):
        connection.receive('427["Bridge",{}]', 0.0)
    with pytest.raises(ConnectionEnd, match="does not read messages"):
        connection.receive('0{"sid":"x","maxPayload":1000000}', 0.0)


def test_time_continues_while_a_script_toggles_reset(simulation: Simulation) -> None:
    with peer(toggles_reset) as port, DevkitBridge(simulation, port=port) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 100)
        for _ in range(2):
            wait_until(lambda: simulation.frame.tick < 10)
            wait_until(lambda: simulation.frame.tick > 40)


def test_a_script_that_toggles_reset_resets_after_the_interval(simulation: Simulation) -> None:
    """A request that comes too early is carried out later, not forgotten."""

    def presses_twice(connection: ServerConnection) -> None:
        connection.send(reset_packet(is_held=True))
        connection.send(reset_packet(is_held=False))
        connection.send(reset_packet(is_held=True))
        for _ in connection:
            connection.send(reset_packet(is_held=True))

    resets = []
    request = simulation.request
    simulation.request = lambda operation, **more: (resets.append(operation), request(operation, **more))[1]  # type: ignore[method-assign,assignment]
    with peer(presses_twice) as port, DevkitBridge(simulation, port=port):
        wait_until(lambda: len(resets) == 2)
        wait_until(lambda: simulation.frame.tick > 60)
    assert len(resets) == 2


@contextlib.contextmanager
def raw_peer(talk: Callable[[socket.socket], None]) -> Iterator[int]:
    """A WebSocket server over a plain socket, which calls `talk` after the handshake of one client; its port."""

    def serve() -> None:
        client, _ = listener.accept()
        with client:
            protocol = ServerProtocol()
            while not (requests := protocol.events_received()):
                protocol.receive_data(client.recv(65536))
            protocol.send_response(protocol.accept(requests[0]))  # type: ignore[arg-type]
            client.sendall(b"".join(protocol.data_to_send()))
            talk(client)

    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)  # what is not read soon fills it
        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield listener.getsockname()[1]
        thread.join(LIMIT)
        assert not thread.is_alive()


def test_websocket_pings_without_reading_end_the_connection(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(devkit, "MAX_UNSENT", 2**20)
    ends: list[OSError] = []

    def flood(client: socket.socket) -> None:
        pings = 1000 * Frame(Opcode.PING, bytes(125)).serialize(mask=False)
        try:
            for _ in range(2000):
                client.sendall(pings)
        except OSError as error:
            ends.append(error)

    with raw_peer(flood) as port, DevkitBridge(simulation, port=port):
        wait_until(lambda: ends)


@pytest.mark.process
@pytest.mark.parametrize(("talk", "number"), [(toggles_reset, signal.SIGINT), (pings_without_reading, signal.SIGTERM)])
def test_a_signal_ends_a_run_with_a_hostile_script(
    tmp_path: Path, talk: Callable[[ServerConnection], None], number: signal.Signals
) -> None:
    with peer(talk) as port:
        arguments = ("--devkit", f"127.0.0.1:{port}", "--mode", "autonomous", "--summary", str(tmp_path / "s.json"))
        run = Started(tmp_path, "run", "plane", "--headless", *arguments)
        run.wait_for("connected to a script")
        assert run.end(number) == 0
    assert json.loads((tmp_path / "s.json").read_text())["ended_by"] == number.name
    assert "Traceback" not in run.messages.read_text()


def test_a_redirect_is_not_followed(simulation: Simulation) -> None:
    """A script could send the simulator to any machine."""
    connections: list[socket.socket] = []
    with socket.create_server(("127.0.0.1", 0)) as elsewhere, socket.create_server(("127.0.0.1", 0)) as listener:

        def redirect() -> None:
            client, _ = listener.accept()
            with client:
                client.recv(65536)
                address = f"ws://127.0.0.1:{elsewhere.getsockname()[1]}/".encode()
                client.sendall(b"HTTP/1.1 302 Found\r\nContent-Length: 0\r\nLocation: " + address + b"\r\n\r\n")

        def accept() -> None:
            with contextlib.suppress(OSError):
                connections.append(elsewhere.accept()[0])

        threads = [threading.Thread(target=target, daemon=True) for target in (redirect, accept)]
        for thread in threads:
            thread.start()
        with DevkitBridge(simulation, port=listener.getsockname()[1]) as bridge:
            wait_until(lambda: "HTTP 302" in bridge.error or connections)
        assert not connections
        elsewhere.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join(LIMIT)


@pytest.mark.parametrize("is_reason", [False, True])
def test_what_a_script_says_cannot_write_to_the_terminal(
    simulation: Simulation, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, *, is_reason: bool
) -> None:
    # No other warning suppresses this one.
    monkeypatch.setattr("autodrive.connect.bridge.metrics.WARNING_INTERVAL", 0.0)
    text = "\x1b[2J\x1b]0;title\x07\nautodrive: all is well\r" + 30 * "x"

    def refuse(connection: ServerConnection) -> None:
        if is_reason:
            connection.close(1011, text)
        else:
            connection.send("44" + 100 * text)

    with peer(refuse) as port, DevkitBridge(simulation, port=port) as bridge:
        wait_until(lambda: "all is well" in bridge.error)
        assert bridge.error.isprintable()
    lines = [record.getMessage() for record in caplog.records if record.name.startswith("autodrive.connect.bridge")]
    assert [line for line in lines if "all is well" in line]
    assert all(line.isprintable() and len(line) < 600 for line in lines)


STUCK = """
import sys, time
from autodrive.cli import main
from autodrive.world.simulation import Simulation
Simulation.stop = lambda self: time.sleep(1000)
sys.argv = ["autodrive", "run", "plane", "--headless", "--summary", sys.argv[1]]
main()
"""
"""A run whose simulation never stops."""


@pytest.mark.process
def test_a_run_that_hangs_ends_after_the_deadline_with_its_summary(tmp_path: Path) -> None:
    run = Started(tmp_path, str(tmp_path / "s.json"), program=[sys.executable, "-c", STUCK])
    run.wait_for("press Ctrl-C to stop")
    assert run.end(signal.SIGTERM) == 0
    assert json.loads((tmp_path / "s.json").read_text())["ended_by"] == "SIGTERM"


@pytest.mark.process
def test_a_second_signal_ends_a_run_at_once(tmp_path: Path) -> None:
    run = Started(tmp_path, str(tmp_path / "s.json"), program=[sys.executable, "-c", STUCK])
    run.wait_for("press Ctrl-C to stop")
    os.kill(run.process.pid, signal.SIGSTOP)  # both signals are delivered at once when it continues
    run.process.send_signal(signal.SIGTERM)
    run.process.send_signal(signal.SIGINT)
    os.kill(run.process.pid, signal.SIGCONT)
    assert run.process.wait(LIMIT) in {128 + signal.SIGTERM, 128 + signal.SIGINT}
