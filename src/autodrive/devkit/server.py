"""The server that a driving script is: the simulator, ours or the original one, connects to it and asks for commands.

Socket.IO over WebSocket as the servers of the devkits' time speak it (Engine.IO 3), which every published simulator
understands; no framework is needed for it.
"""

from __future__ import annotations

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

from autodrive.protocol.ports import DEVKIT_PORT

EVENT = "Bridge"
"""The one event of both directions."""

PING_INTERVAL, PING_TIMEOUT = 25.0, 60.0
"""Signs of life [s], as the devkits' servers ask for them."""

MESSAGE_LIMIT = 2**24
"""[bytes]. Telemetry with two pictures has some hundred thousand."""

Telemetry: TypeAlias = Mapping[str, Any]
Respond: TypeAlias = Callable[[Telemetry], Mapping[str, str] | None]
"""Telemetry -> commands; None: say nothing now."""

_EVENT = re.compile(r"42(\d*)(.*)", re.DOTALL)
"""An event, numbered if it wants to be acknowledged."""

log = logging.getLogger(__name__)


class Driven(Protocol):
    """A vehicle or a traffic light."""

    def parse_data(self, data: Telemetry) -> None:
        """Take what is told about it."""
        ...

    def generate_commands(self) -> Mapping[str, str]:
        """What it is to do."""
        ...


def drive(step: Callable[[], object], *things: Driven, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> None:
    """Serve for ever: at each message, `things` (vehicles, traffic lights) take it, `step()` runs, their commands go.

    `host` '' listens to other machines too. What `step` raises ends it; Ctrl-C ends it.
    """

    def respond(data: Telemetry) -> dict[str, str]:
        for thing in things:
            thing.parse_data(data)
        step()
        return {key: text for thing in things for key, text in thing.generate_commands().items()}

    with Server(respond, host=host, port=port) as server:
        server.wait()


class Server:
    """Answers each telemetry message with `respond(telemetry)`, one at a time, from a thread of its own.

    Any number of simulators may connect, and each gets the answers to its own messages only. Raises `OSError` if the
    port is taken. `port` 0 takes a free one.
    """

    def __init__(self, respond: Respond, *, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> None:
        self._respond = respond
        self._one_at_a_time = threading.Lock()
        self._fault: BaseException | None = None
        self._ended = threading.Event()
        self._server = serve(
            self._converse,
            host,
            port,
            process_request=_refuse_strangers,
            compression=None,
            max_size=MESSAGE_LIMIT,
            ping_interval=None,
            server_header=None,
        )
        self.port: int = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever, name="autodrive-devkit-server", daemon=True)
        self._thread.start()

    def wait(self, timeout: float | None = None) -> None:
        """Until `close`, or for `timeout` [s]. Raises what `respond` raised."""
        self._ended.wait(timeout)
        if self._fault is not None:
            raise self._fault

    def close(self) -> None:
        """Say goodbye to all simulators."""
        self._ended.set()
        self._server.shutdown()
        self._thread.join()

    def __enter__(self) -> Server:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _converse(self, connection: ServerConnection) -> None:
        """With one simulator, until it leaves."""
        greeting = {
            "sid": secrets.token_hex(16),
            "upgrades": [],
            "pingTimeout": int(1e3 * PING_TIMEOUT),
            "pingInterval": int(1e3 * PING_INTERVAL),
        }
        pinged = time.monotonic()
        try:
            connection.send("0" + json.dumps(greeting))
            connection.send("40")
            while not self._ended.is_set():
                for packet in self._answers(_received(connection)):
                    connection.send(packet)
                if time.monotonic() - pinged > PING_INTERVAL:  # a client of Engine.IO 4 waits for it
                    connection.send("2")
                    pinged = time.monotonic()
        except ConnectionClosed:
            log.info("a simulator has left")

    def _answers(self, packet: str) -> list[str]:
        if event := _EVENT.match(packet):
            number, body = event.groups()
            commands = self._commands(body)
            said = [] if commands is None else ["42" + json.dumps([EVENT, commands], separators=(",", ":"))]
            return [*said, f"43{number}[]"] if number else said
        return ["3" + packet[1:]] if packet.startswith("2") else []

    def _commands(self, text: str) -> Mapping[str, str] | None:
        try:
            event, data = json.loads(text)
        except ValueError:
            log.warning("not understood: %.60r; a message is 42[%r, {...}]", text, EVENT)
            return None
        if event != EVENT or not isinstance(data, dict) or not data:
            return None
        try:
            with self._one_at_a_time:
                return self._respond(data)
        except BaseException as fault:  # handed to whoever waits
            self._fault = fault
            self._ended.set()
            return None


def _received(connection: ServerConnection) -> str:
    """The next packet; '' where none came for a while."""
    try:
        packet = connection.recv(timeout=1.0)
    except TimeoutError:
        return ""
    return packet if isinstance(packet, str) else ""


def _refuse_strangers(connection: ServerConnection, request: Request) -> Response | None:
    if request.path.startswith("/socket.io/"):
        return None
    return connection.respond(HTTPStatus.NOT_FOUND, "This is a driving script; a simulator connects to /socket.io/.\n")
