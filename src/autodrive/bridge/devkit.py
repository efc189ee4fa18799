"""Connects a running Simulation to a user's devkit script, which is a Socket.IO server: we are its client.

A telemetry message asks for commands, a command message asks for telemetry. That alone would stop for ever at the first
lost message; here the state is sent again when the script is silent, nothing that the script does raises, and a lost
connection is taken up again while the simulation runs on.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from autodrive.bridge.engineio import ConversationEnd
from autodrive.bridge.ledger import Counters, Ledger
from autodrive.bridge.session import Driven, Session
from autodrive.descriptions import suggest
from autodrive.errors import AutodriveError
from autodrive.protocol.devkit import PROFILES, Images, Profile
from autodrive.protocol.ports import DEVKIT_PORT

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame

log = logging.getLogger(__name__)

RETRY, RETRY_MAX = 0.1, 2.0
"""Wait before a new attempt to connect [s]: doubled from the first to the second, until a script answers."""
MESSAGE_LIMIT = 2**20
"""A longer message of the server [bytes] ends the connection; commands have some hundred."""

Status: TypeAlias = Literal["closed", "connecting", "connected"]


class Published(Driven, Protocol):
    """What the bridge needs of a Simulation."""

    def add_sink(self, sink: DevkitBridge) -> None:
        """Call `sink.publish(frame)` after each tick."""
        ...

    def remove_sink(self, sink: DevkitBridge) -> None:
        """Do so no more."""
        ...


class DevkitBridge:
    """Sends telemetry to a devkit script and its commands to a Simulation, from a thread of its own.

    `profile` is the era of the script ('2020', '2022', '2023', '2025'); None recognises it by the keys of its commands.
    `images` gives the JPEG pictures that belong to a Frame, at a share of their usual quality (1 unless a message would
    be too long). At most one message a tick is sent, and one is under way at a time: a slow script gets the latest
    state, not a backlog.
    """

    def __init__(
        self,
        simulation: Published,
        host: str = "127.0.0.1",
        port: int = DEVKIT_PORT,
        profile: str | None = None,
        *,
        images: Callable[[Frame, float], Images] | None = None,
    ) -> None:
        self._simulation = simulation
        self._profile = _checked_profile(profile)
        self._images = images
        self._ledger = Ledger()
        self._traffic_lights: dict[int, int] = {}
        self._address = _checked_address(host, port)
        self._retry = RETRY
        self._is_closing = False
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._attempt: asyncio.Task[None] | None = None
        self._session: Session | None = None

    # -- for everyone, from any thread --------------------------------------------------------------------------

    @property
    def address(self) -> str:
        """Where the script is looked for, 'host:port'."""
        return self._address

    @property
    def status(self) -> Status:
        """'closed' if not started, 'connected' if there is a server that takes our telemetry."""
        session = self._session
        if self._thread is None or not self._thread.is_alive():
            return "closed"
        return "connected" if session and session.conversation.is_open else "connecting"

    @property
    def fault(self) -> str:
        """Why there is no connection, after an attempt that failed; empty if there is one, or nobody looks for one."""
        return self._ledger.fault if self.status == "connecting" else ""

    @property
    def counters(self) -> Counters:
        """A copy of the counters as they are now."""
        return self._ledger.snapshot()

    def start(self) -> None:
        """Look for the script, now and for as long as it takes."""
        if self._thread is not None:
            raise RuntimeError("this DevkitBridge is started already")
        self._is_closing = False
        self._retry = RETRY
        self._ledger.fault = ""
        self._simulation.add_sink(self)
        self._thread = threading.Thread(target=lambda: asyncio.run(self._stay()), name="autodrive-devkit", daemon=True)
        self._thread.start()

    def connect(self, host: str, port: int) -> None:
        """Leave the server, if there is one, and turn to that one. Raises `AutodriveError`."""
        self._address = _checked_address(host, port)
        self._ledger.fault = ""
        self._end_attempt()

    def close(self) -> None:
        """Say goodbye to the server and end the thread."""
        if self._thread is None:
            return
        self._simulation.remove_sink(self)
        self._is_closing = True
        self._end_attempt()
        self._thread.join()
        self._thread = None

    def publish(self, frame: Frame) -> None:
        """A new Frame is there (called in the thread of the simulation)."""
        session, loop = self._session, self._loop
        if session is not None and loop is not None and session.awaits_frame:
            session.awaits_frame = False
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                loop.call_soon_threadsafe(session.wake.set)

    def __enter__(self) -> DevkitBridge:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- in the bridge's thread ---------------------------------------------------------------------------------

    def _end_attempt(self) -> None:
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                self._loop.call_soon_threadsafe(lambda: self._attempt and self._attempt.cancel())

    async def _stay(self) -> None:
        """Try again and again; `connect` and `close` cut an attempt short."""
        self._loop = asyncio.get_running_loop()
        while not self._is_closing:
            self._attempt = asyncio.create_task(self._try(self._address))
            await asyncio.wait({self._attempt})
            if self._attempt.cancelled():
                self._retry = RETRY
            elif fault := self._attempt.exception():
                log.error("devkit bridge: an attempt failed by a fault of the simulator", exc_info=fault)
        self._loop = None

    async def _try(self, address: str) -> None:
        """One attempt: a connection until it ends, then a pause."""
        try:
            async with connect(
                f"ws://{address}/socket.io/?EIO=4&transport=websocket",
                compression=None,
                proxy=None,
                user_agent_header=None,
                open_timeout=5.0,
                ping_interval=None,  # a missing pong proves nothing: the C++ devkit may stand at a breakpoint
                close_timeout=0.5,
                max_size=MESSAGE_LIMIT,
            ) as connection:
                _give_up_dead_peers(connection)
                await self._converse(connection)
        except* (OSError, WebSocketException, ConversationEnd, TimeoutError) as group:
            reason = group.exceptions[0]
            self._ledger.fault = f"no script at {address} ({_in_words(reason)}); trying again"
            self._ledger.complain("connection", self._ledger.fault)
        await asyncio.sleep(self._retry)
        self._retry = min(2.0 * self._retry, RETRY_MAX)

    async def _converse(self, connection: ClientConnection) -> None:
        session = Session(
            connection,
            self._simulation,
            self._ledger,
            profile=self._profile,
            traffic_lights=self._traffic_lights,
            images=self._images,
        )
        self._session = session
        try:
            async with asyncio.TaskGroup() as both:
                both.create_task(session.listen())
                both.create_task(session.speak())
        finally:
            self._session = None
            if session.turns.has_answer:
                self._retry = RETRY
            await session.say_goodbye()


def _in_words(reason: Exception) -> str:
    """What the system says, without its numbers and the address, which is told already."""
    if isinstance(reason, ConnectionRefusedError) or f"[Errno {errno.ECONNREFUSED}]" in str(reason):
        return "connection refused"
    if isinstance(reason, socket.gaierror):
        return "no such host"
    return str(reason) or "timed out"


def _give_up_dead_peers(connection: ClientConnection) -> None:
    """Who went out of radio range says no goodbye: end the connection when TCP is not acknowledged for 20 s."""
    tcp = connection.transport.get_extra_info("socket")
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 20_000)


def _checked_profile(name: str | None) -> Profile | None:
    if name is None:
        return None
    if name not in PROFILES:
        raise AutodriveError(f"devkit profile '{name}' is not known. {suggest(name, list(PROFILES))}")
    return PROFILES[name]


def _checked_address(host: str, port: int) -> str:
    try:
        is_host = bool(host) and bool(host.encode("idna")) and not any(c in host for c in " /?#@[]")
    except UnicodeError:
        is_host = False
    if not is_host:
        raise AutodriveError(f"devkit host {host!r} is not a name or an IP address, for example '127.0.0.1'")
    if not 0 < port < 65536:
        raise AutodriveError(f"devkit port {port} is not from 1 to 65535; the devkits listen on {DEVKIT_PORT}")
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
