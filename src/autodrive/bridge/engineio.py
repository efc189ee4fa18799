"""Our end of a Socket.IO conversation over one WebSocket, without the socket: packets in, packets and events out.

Three kinds of server are met, told apart by what they send first, never by configuration:

- Engine.IO 3 (python-socketio 4): sends `0{...}` and at once `40`; we ping, it answers.
- Engine.IO 4 (python-socketio 5): sends `0{...}`, with a `maxPayload` if it is not very old, and waits for our `40`;
  it pings, we answer, or it hangs up.
- raw (the C++ devkit): sends nothing at all, answers no ping, understands nothing but events.
"""

from __future__ import annotations

import enum
import json
import math
import re
from dataclasses import dataclass
from typing import Any

LISTENING_TIME = 0.3
"""How long a server may take to begin to speak [s], before it is taken for one that speaks later or not at all."""
HANDSHAKE_TIME = 5.0
"""How long an Engine.IO server may take to let us in [s]."""
MAX_PAYLOAD = 1_000_000
"""Longest packet [characters] for a server that does not tell its own limit; python-socketio 5 has this one."""


class Dialect(enum.StrEnum):
    """What kind of server is at the other end."""

    ENGINE_IO_3 = "Engine.IO 3"
    ENGINE_IO_4 = "Engine.IO 4"
    RAW = "raw"


@dataclass(frozen=True)
class Event:
    """A named message of the server."""

    name: str
    arguments: list[Any]


@dataclass(frozen=True)
class Acknowledgement:
    """The server has done its work on the event that we sent with that number."""

    number: int


class PacketError(ValueError):
    """A packet that makes no sense; the conversation goes on."""


class ConversationEnd(Exception):  # noqa: N818  it is no fault to say goodbye
    """The server refused us or said goodbye."""


class Conversation:
    """What was said so far on one connection, and what follows from it.

    Times are those of any steady clock [s]. `outbox` collects the packets to send, in order.
    """

    def __init__(self, now: float) -> None:
        self.outbox: list[str] = []
        self.dialect: Dialect | None = None
        self.max_payload = MAX_PAYLOAD
        self._deadline = now + LISTENING_TIME
        self._ping_interval = 25.0
        self._has_greeting = False
        self._is_admitted = False

    @property
    def is_open(self) -> bool:
        """Whether events can be sent."""
        return self._is_admitted

    @property
    def deadline(self) -> float:
        """When `pass_time` has something to do again, if nothing is received before."""
        return self._deadline

    def receive(self, packet: str, now: float) -> Event | Acknowledgement | None:
        """Take a packet. Raises `PacketError` for nonsense, `ConversationEnd` if the server has finished with us."""
        match packet[:1], packet[1:2]:
            case "0", _:
                self._greet(packet[1:], now)
            case "1", _:
                raise ConversationEnd("the server closed the connection")
            case "2", _:
                self.outbox.append("3" + packet[1:])
            case (("3" | "6"), _):
                pass
            case "4", "0":
                self._enter(Dialect.ENGINE_IO_4 if "{" in packet else Dialect.ENGINE_IO_3, now)
            case "4", "1":
                raise ConversationEnd("the server ended the session")
            case "4", "4":
                raise ConversationEnd(f"the server refused us: {packet[2:200]}")
            case "4", ("2" | "3"):
                return self._content(packet)
            case _:
                raise PacketError(f"not a packet of Socket.IO: {packet[:40]!r}")
        return None

    def pass_time(self, now: float) -> None:
        """Do what is due: judge a silent server, ping one that wants to be pinged. Raises `ConversationEnd`."""
        if now < self._deadline:
            return
        if self._is_admitted:
            self.outbox.append("2")
            self._deadline = now + self._ping_interval
        elif not self._has_greeting:
            self.dialect, self._is_admitted, self._deadline = Dialect.RAW, True, math.inf
        elif self.dialect is None:
            self._ask_to_enter(now)
        else:
            raise ConversationEnd(f"the server did not let us in for {HANDSHAKE_TIME:g} s")

    def _greet(self, text: str, now: float) -> None:
        greeting = _parsed(text)
        if not isinstance(greeting, dict):
            raise PacketError(f"not a greeting of Engine.IO: {text[:40]!r}")
        self._has_greeting, self._is_admitted = True, False  # also if it comes after we took the server for a raw one
        self.dialect = None
        self._ping_interval = min(max(_milliseconds(greeting.get("pingInterval"), 25.0), 1.0), 25.0)
        limit = greeting.get("maxPayload")
        if isinstance(limit, int) and limit > 0:
            self.max_payload = limit
            self._ask_to_enter(now)
        else:
            self._deadline = now + LISTENING_TIME

    def _ask_to_enter(self, now: float) -> None:
        self.dialect = Dialect.ENGINE_IO_4
        self.outbox.append("40")
        self._deadline = now + HANDSHAKE_TIME

    def _enter(self, dialect: Dialect, now: float) -> None:
        """The server says that we are in."""
        self.dialect = dialect
        self._is_admitted = True
        self._deadline = now if dialect is Dialect.ENGINE_IO_3 else math.inf

    def _content(self, packet: str) -> Event | Acknowledgement | None:
        parts = _CONTENT.fullmatch(packet)
        content = _parsed(parts[2]) if parts else None
        if not parts or not isinstance(content, list):
            raise PacketError(f"not an event of Socket.IO: {packet[:40]!r}")
        if packet[1] == "3":
            return Acknowledgement(int(parts[1] or -1))
        if not content or not isinstance(content[0], str):
            raise PacketError(f"an event without a name: {packet[:40]!r}")
        if parts[1]:
            self.outbox.append(f"43{parts[1]}[]")
        return Event(content[0], content[1:])


FAREWELL = ("41", "1")
"""Packets that end a conversation politely."""


def event_packet(name: str, argument: dict[str, str], acknowledge: int | None = None) -> str:
    """The packet of an event. With a number the server is asked to say when it has done its work on it."""
    number = "" if acknowledge is None else str(acknowledge)
    return f"42{number}{json.dumps([name, argument], separators=(',', ':'))}"


_CONTENT = re.compile(r"4[23](\d{0,9})(\[.*)", re.DOTALL)


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _milliseconds(value: Any, default: float) -> float:
    """[ms] of the wire in [s]."""
    is_sensible = isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e7
    return value / 1000.0 if is_sensible else default
