"""Socket.IO client protocol over one WebSocket, without I/O: packets in, packets and events out.

Three kinds of server are distinguished by the first packets that they send, without configuration:

- Engine.IO 3 (python-socketio 4): sends `0{...}` and then `40`; the client pings.
- Engine.IO 4 (python-socketio 5): sends `0{...}`, with `maxPayload` except in very old versions, and waits for `40`
  from the client; the server pings, and disconnects a client that does not answer. A server that does not answer `40`
  either, or sends an event before that, was written by hand: it is taken for one of Engine.IO 3.
- raw (the C++ devkit): sends nothing on connect, answers no ping, and accepts events only.
"""

from __future__ import annotations

import enum
import json
import math
import re
from dataclasses import dataclass
from typing import Any

from autodrive.protocol.devkit_profile import Handshake

LISTENING_TIME = 0.3
"""Time to wait for the first packet of the server [s]; after that the server is treated as raw."""
HANDSHAKE_TIME = 5.0
"""Timeout of the handshake with an Engine.IO server [s]."""
MAX_PING, MAX_WAITING = 128, 1000
"""Longest content of a ping [characters], which is sent back, and most answers that wait for a server that does not
read; both are far more than any server needs."""
MAX_PAYLOAD = 1_000_000
"""Longest packet [characters] for a server that announces no limit; the default of python-socketio 5."""


class Dialect(enum.StrEnum):
    """Protocol dialect of the server."""

    ENGINE_IO_3 = "Engine.IO 3"
    ENGINE_IO_4 = "Engine.IO 4"
    RAW = "raw"


@dataclass(frozen=True)
class Event:
    """A named event from the server."""

    name: str
    arguments: list[Any]


@dataclass(frozen=True)
class Acknowledgement:
    """The server has processed the event that was sent with that number."""

    number: int


class PacketError(ValueError):
    """An invalid packet; the connection continues."""


class ConnectionEnd(Exception):  # noqa: N818  a normal close is not an error
    """The server refused or closed the connection."""


class ServerClosed(ConnectionEnd):
    """The server closed the connection, as at the end of a script."""


class EngineIoConnection:
    """Protocol state of one connection.

    `now` is the time of any monotonic clock [s]. `handshake` is that of the server; None: by its first packets.
    `outbox` collects the packets to send, in order.
    """

    def __init__(self, now: float, handshake: Handshake | None = None) -> None:
        self.outbox: list[str] = []
        self.dialect: Dialect | None = None
        self.max_payload = MAX_PAYLOAD
        self._handshake = handshake
        self._deadline = now + {None: LISTENING_TIME, "raw": 0.0}.get(handshake, HANDSHAKE_TIME)
        self._ping_interval = 25.0
        self._has_handshake = False
        self._is_accepted = False
        self.acknowledges = False
        """Whether the server has sent `40`, so that it can acknowledge events."""

    @property
    def is_open(self) -> bool:
        """Whether events can be sent."""
        return self._is_accepted

    @property
    def deadline(self) -> float:
        """Time at which `check_timers` must be called, unless a packet is received before."""
        return self._deadline

    def receive(self, packet: str, now: float) -> Event | Acknowledgement | None:
        """Process a packet. Raises `PacketError` if it is invalid, `ConnectionEnd` if the server disconnects."""
        match packet[:1], packet[1:2]:
            case "0", _:
                self._read_handshake(packet[1:], now)
            case "1", _:
                raise ServerClosed("the server closed the connection")
            case "2", _:
                if len(packet) > MAX_PING:
                    raise PacketError(f"a ping of {len(packet)} characters; at most {MAX_PING} are accepted")
                self._answer("3" + packet[1:])
            case (("3" | "6"), _):
                pass
            case "4", "0":
                self._accept(Dialect.ENGINE_IO_4 if "{" in packet else Dialect.ENGINE_IO_3, now)
            case "4", "1":
                raise ServerClosed("the server ended the session")
            case "4", "4":
                raise ConnectionEnd(f"the server refused the connection: {packet[2:200]}")
            case "4", ("2" | "3"):
                content = self._content(packet)
                if self._has_handshake and not self._is_accepted:
                    self._assume_acceptance(now)
                return content
            case _:
                raise PacketError(f"not a Socket.IO packet: {packet[:40]!r}")
        return None

    def check_timers(self, now: float) -> None:
        """Classify a server that has sent nothing; ping if due. Raises `ConnectionEnd` on a handshake timeout."""
        if now < self._deadline:
            return
        if self._is_accepted:
            self.outbox.append("2")
            self._deadline = now + self._ping_interval
        elif not self._has_handshake and self._handshake in (None, "raw"):
            self.dialect, self._is_accepted, self._deadline = Dialect.RAW, True, math.inf
        elif self.dialect is None and self._handshake is None:
            self._request_connection(now)
        elif self._handshake is None:
            self._assume_acceptance(now)
        else:
            raise ConnectionEnd(f"no handshake from the server within {HANDSHAKE_TIME:g} s")

    def _read_handshake(self, text: str, now: float) -> None:
        handshake = _parsed(text)
        if not isinstance(handshake, dict):
            raise PacketError(f"not an Engine.IO handshake: {text[:40]!r}")
        self._has_handshake, self._is_accepted = True, False  # also if the server was already classified as raw
        self.acknowledges = False
        self.dialect = None
        self._ping_interval = min(max(_milliseconds(handshake.get("pingInterval"), 25.0), 1.0), 25.0)
        limit = handshake.get("maxPayload")
        is_newest = self._handshake == "engineio-4"
        if isinstance(limit, int) and limit > 0:
            self.max_payload = limit
            is_newest = is_newest or self._handshake is None
        if is_newest:
            self._request_connection(now)
        else:
            self._deadline = now + self._patience

    @property
    def _patience(self) -> float:
        """Time in which the server answers [s]."""
        return LISTENING_TIME if self._handshake is None else HANDSHAKE_TIME

    def _request_connection(self, now: float) -> None:
        self.dialect = Dialect.ENGINE_IO_4
        self._answer("40")
        self._deadline = now + self._patience

    def _assume_acceptance(self, now: float) -> None:
        """Send events without `40` of the server; the first ping waits, in case that it only is slow."""
        self._is_accepted, self.dialect = True, Dialect.ENGINE_IO_3
        self._deadline = now + self._ping_interval

    def _accept(self, dialect: Dialect, now: float) -> None:
        """The server accepted the connection."""
        self.dialect = dialect
        self._is_accepted = self.acknowledges = True
        self._deadline = now if dialect is Dialect.ENGINE_IO_3 else math.inf

    def _answer(self, packet: str) -> None:
        if len(self.outbox) >= MAX_WAITING:
            raise ConnectionEnd("the server sends messages, but does not read messages")
        self.outbox.append(packet)

    def _content(self, packet: str) -> Event | Acknowledgement | None:
        parts = _CONTENT.fullmatch(packet)
        content = _parsed(parts[2]) if parts else None
        if not parts or not isinstance(content, list):
            raise PacketError(f"not a Socket.IO event: {packet[:40]!r}")
        if packet[1] == "3":
            return Acknowledgement(int(parts[1] or -1))
        if not content or not isinstance(content[0], str):
            raise PacketError(f"an event without a name: {packet[:40]!r}")
        if parts[1]:
            self._answer(f"43{parts[1]}[]")
        return Event(content[0], content[1:])


CLOSE_PACKETS = ("41", "1")
"""Packets that close a connection."""


def event_packet(name: str, argument: dict[str, str], acknowledge: int | None = None) -> str:
    """The packet of an event; with a number, the server acknowledges the event after processing it."""
    number = "" if acknowledge is None else str(acknowledge)
    return f"42{number}{json.dumps([name, argument], separators=(',', ':'))}"


def padded(packet: str, size: int) -> str:
    """The packet of an event with blanks before its closing brackets, so that it has `size` characters or more."""
    return packet[:-2] + " " * (size - len(packet)) + packet[-2:]


_CONTENT = re.compile(r"4[23](\d{0,9})(\[.*)", re.DOTALL)


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _milliseconds(value: Any, default: float) -> float:
    """Convert [ms] of the protocol to [s]."""
    is_sensible = isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e7
    return value / 1000.0 if is_sensible else default
