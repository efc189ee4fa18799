"""Server of a driving script: this simulator or the original one connects to it and requests commands.

Socket.IO over WebSocket in the dialect of the original devkits (Engine.IO 3), which every published simulator supports.
"""

from __future__ import annotations

import contextlib
import json
import logging
import re
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from http import HTTPStatus
from types import TracebackType
from typing import Any, Protocol, TypeAlias

from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from autodrive.base.tcp import listener, without_brackets
from autodrive.protocol.ports import DEVKIT_PORT

EVENT = "Bridge"
"""Event name of both directions."""

SIGNAL_DELAY = 0.2
"""A signal that arrives in another thread is handled within that time [s]; in a wait without a limit it is not."""

PING_INTERVAL, PING_TIMEOUT = 25.0, 60.0
"""Heartbeat settings [s], those of the original devkits."""

MESSAGE_LIMIT = 2**24
"""Longest message [bytes]; telemetry with two images has a few hundred thousand."""

Telemetry: TypeAlias = Mapping[str, Any]
Respond: TypeAlias = Callable[[Telemetry], Mapping[str, str] | None]
"""Telemetry -> commands; None: send no commands."""

_EVENT = re.compile(r"42(\d*)(.*)", re.DOTALL)
"""An event; with a number if an acknowledgement is requested."""

log = logging.getLogger(__name__)


class Device(Protocol):
    """A vehicle or a traffic light."""

    def parse_data(self, data: Telemetry) -> None:
        """Read its values from telemetry."""
        ...

    def generate_commands(self) -> Mapping[str, str]:
        """The commands of the vehicle or traffic light, by the keys of the devkit."""
        ...


def drive(step: Callable[[], object], *devices: Device, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> None:
    """Serve until `step` raises or Ctrl-C: for each message, update `devices`, call `step()`, send their commands.

    `devices`: vehicles and traffic lights. `host`: an address, IPv4 or IPv6, or a name; '' listens on all interfaces.
    Raises what `step` raises, and `OSError` if the port is in use.
    """

    def respond(data: Telemetry) -> dict[str, str]:
        for device in devices:
            device.parse_data(data)
        step()
        return {key: text for device in devices for key, text in device.generate_commands().items()}

    with Server(respond, host=host, port=port) as server, contextlib.suppress(KeyboardInterrupt):
        server.wait()


class Server:
    """Answers each telemetry message with `respond(telemetry)`, one at a time, in its own thread.

    Any number of simulators may connect; each receives only the answers to its own messages. `port` 0 selects a free
    port. Raises `OSError` if the port is in use.
    """

    def __init__(self, respond: Respond, *, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> None:
        self._respond = respond
        self._one_at_a_time = threading.Lock()
        self._error: BaseException | None = None
        self._ended = threading.Event()
        self._connections: set[ServerConnection] = set()
        self._server = serve(
            self._serve_simulator,
            sock=listener(without_brackets(host), port),
            process_request=_reject_other_paths,
            compression=None,
            max_size=MESSAGE_LIMIT,
            ping_interval=None,
            server_header=None,
        )
        self.port: int = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, name="autodrive-devkit-server", daemon=True)
        self._thread.start()

    @property
    def is_connected(self) -> bool:
        """Whether a simulator is connected."""
        return bool(self._connections)

    def wait(self, timeout: float | None = None) -> None:
        """Wait until `close`, or for `timeout` [s]. Raises what `respond` raised."""
        while not self._ended.wait(SIGNAL_DELAY if timeout is None else timeout) and timeout is None:
            pass
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Close all connections and end the thread."""
        self._ended.set()
        self._server.shutdown()
        self._thread.join()

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _serve_simulator(self, connection: ServerConnection) -> None:
        """Serve one simulator until it disconnects."""
        handshake = {
            "sid": secrets.token_hex(16),
            "upgrades": [],
            "pingTimeout": int(1e3 * PING_TIMEOUT),
            "pingInterval": int(1e3 * PING_INTERVAL),
        }
        pinged = time.monotonic()
        self._connections.add(connection)
        try:
            connection.send("0" + json.dumps(handshake))
            connection.send("40")
            while not self._ended.is_set():
                for packet in self._answers(_received(connection)):
                    connection.send(packet)
                if time.monotonic() - pinged > PING_INTERVAL:  # clients of Engine.IO 4 expect it
                    connection.send("2")
                    pinged = time.monotonic()
        except ConnectionClosed:
            log.info("a simulator disconnected")
        finally:
            self._connections.discard(connection)

    def _answers(self, packet: str) -> list[str]:
        if event := _EVENT.match(packet):
            number, body = event.groups()
            commands = self._commands(body)
            packets = [] if commands is None else ["42" + json.dumps([EVENT, commands], separators=(",", ":"))]
            return [*packets, f"43{number}[]"] if number else packets
        return ["3" + packet[1:]] if packet.startswith("2") else []

    def _commands(self, text: str) -> Mapping[str, str] | None:
        try:
            event, data = json.loads(text)
        except (ValueError, RecursionError):
            log.warning("invalid message: %.60r; expected 42[%r, {...}]", text, EVENT)
            return None
        if event != EVENT or not isinstance(data, dict) or not data:
            return None
        try:
            with self._one_at_a_time:
                return self._respond(data)
        except BaseException as error:  # raised by `wait`
            self._error = error
            self._ended.set()
            return None


def _received(connection: ServerConnection) -> str:
    """The next packet; '' after a timeout."""
    try:
        packet = connection.recv(timeout=1.0)
    except TimeoutError:
        return ""
    return packet if isinstance(packet, str) else ""


def _reject_other_paths(connection: ServerConnection, request: Request) -> Response | None:
    if request.path.startswith("/socket.io/"):
        return None
    return connection.respond(HTTPStatus.NOT_FOUND, "This is a driving script; a simulator connects to /socket.io/.\n")
