"""Socket.IO client that connects a running Simulation to a devkit script, which is the server.

Telemetry and commands alternate. The original simulator stops for ever if one message is lost; this bridge resends
telemetry after a timeout, ignores invalid messages, and reconnects while the simulation continues.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import ipaddress
import re
import socket
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, TypeAlias

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.frames import Frame as WebSocketFrame
from websockets.protocol import Event

from autodrive.base.errors import AutodriveError
from autodrive.base.tcp import address_text, drop_dead_peer, without_brackets
from autodrive.connect.bridge.detection import Detection
from autodrive.connect.bridge.engineio import ConnectionEnd, ServerClosed
from autodrive.connect.bridge.flow_control import RESEND_DELAY
from autodrive.connect.bridge.metrics import Counters, Metrics, printable
from autodrive.connect.bridge.read_limit import ReadLimit
from autodrive.connect.bridge.session import Session
from autodrive.protocol.devkit import Images, ImageSizes
from autodrive.protocol.devkit_profile import DevkitSettings
from autodrive.protocol.ports import DEVKIT_PORT

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.world.simulation.control import Control

RETRY, RETRY_MAX = 0.1, 2.0
"""Delay before a new attempt to connect [s]: it doubles from the first to the second value until a script answers."""
DEAD_PEER_TIMEOUT = 20.0
"""A connection whose data is not acknowledged for this time [s], as after a loss of radio contact, is closed."""
MESSAGE_LIMIT = 2**16
"""Longest message of the server [bytes]; a longer one closes the connection. Commands have a few hundred bytes."""

MAX_UNSENT = 2**23
"""Bytes that may wait for a script that does not read; more end the connection. A telemetry message has up to 1 MB."""

_HOST_NAME = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)(\.(?!-)[A-Za-z0-9_-]{1,63}(?<!-))*\.?")

Status: TypeAlias = Literal["closed", "connecting", "connected"]


class DevkitBridge:
    """Sends telemetry to a devkit script and its commands to a Simulation, in its own thread.

    `settings` holds what the user has chosen about the devkit generation of the script. `vehicle_profile()` gives the
    profile that the vehicles of the current world have, if they have one. The rest is detected from the keys of the
    commands. `images(frame, factor)` gives the JPEG images of a Frame; `factor` of their quality is 1
    unless a message would be too long. `image_sizes()` gives the sizes of all cameras; a camera without an image is
    black. At most one message is sent per tick, and one waits for a command at a time, so a slow script receives the
    latest state instead of a backlog. As in the original simulator, its last command is valid until the next one; it
    times out when the connection has ended. Telemetry that is not answered is resent after `resend_delay` [s]. Raises
    `AutodriveError` for an invalid address.
    """

    def __init__(
        self,
        simulation: Control,
        host: str = "127.0.0.1",
        port: int = DEVKIT_PORT,
        settings: DevkitSettings | None = None,
        *,
        images: Callable[[Frame, float], Images] | None = None,
        image_sizes: Callable[[], ImageSizes] | None = None,
        vehicle_profile: Callable[[], str | None] = lambda: None,
        resend_delay: float = RESEND_DELAY,
    ) -> None:
        self._simulation = simulation
        self._detection = Detection(settings or DevkitSettings(), vehicle_profile)
        self._images = images
        self._image_sizes = image_sizes
        self._resend_delay = resend_delay
        self._metrics = Metrics()
        self._traffic_lights: dict[int, int] = {}
        self._address = _checked_address(host, port)
        self._retry = RETRY
        self._is_closing = False
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._attempt: asyncio.Task[None] | None = None
        self._session: Session | None = None

    # -- thread-safe --------------------------------------------------------------------------------------------

    @property
    def address(self) -> str:
        """Address of the script, 'host:port'."""
        return self._address

    @property
    def status(self) -> Status:
        """'closed' if not started, 'connected' if a server accepts telemetry, otherwise 'connecting'."""
        session = self._session
        if self._thread is None or not self._thread.is_alive():
            return "closed"
        return "connected" if session and session.engineio.is_open else "connecting"

    @property
    def error(self) -> str:
        """Why the last attempt to connect failed; empty if connected or closed."""
        return self._metrics.error if self.status == "connecting" else ""

    @property
    def counters(self) -> Counters:
        """A copy of the current counters."""
        return self._metrics.snapshot()

    def start(self) -> None:
        """Connect to the script, and reconnect until `close`."""
        if self._thread is not None:
            raise RuntimeError("this DevkitBridge is already started")
        self._is_closing = False
        self._retry = RETRY
        self._metrics.error = self._ended = ""
        self._simulation.add_sink(self)
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._connect_loop()), name="autodrive-devkit", daemon=True
        )
        self._thread.start()

    def connect(self, host: str, port: int) -> None:
        """Disconnect and connect to another address. Raises `AutodriveError` if it is invalid."""
        self._address = _checked_address(host, port)
        self._metrics.error = self._ended = ""
        self._end_attempt()

    def close(self) -> None:
        """Disconnect and end the thread."""
        if self._thread is None:
            return
        self._simulation.remove_sink(self)
        self._is_closing = True
        self._end_attempt()
        self._thread.join()
        self._thread = None

    def publish(self, frame: Frame) -> None:
        """Process a new Frame; called in the thread of the simulation."""
        session, loop = self._session, self._loop
        if session is None or loop is None:
            return
        session.renew_commands()
        if session.awaits_frame:
            session.awaits_frame = False
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(session.wake.set)

    def __enter__(self) -> DevkitBridge:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- in the thread of the bridge ----------------------------------------------------------------------------

    def _end_attempt(self) -> None:
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(lambda: self._attempt and self._attempt.cancel())

    async def _connect_loop(self) -> None:
        """Connect repeatedly; `connect` and `close` cancel the current attempt."""
        self._loop = asyncio.get_running_loop()
        while not self._is_closing:
            self._attempt = asyncio.create_task(self._try(self._address))
            await asyncio.wait({self._attempt})
            if self._attempt.cancelled():
                self._retry = RETRY
        self._loop = None

    async def _try(self, address: str) -> None:
        """One attempt: a connection until it ends, then the retry delay."""
        try:
            async with _Connect(
                f"ws://{address}/socket.io/?EIO=4&transport=websocket",
                compression=None,
                proxy=None,
                user_agent_header=None,
                open_timeout=5.0,
                ping_interval=None,  # a missing pong is no error: the script may be stopped at a breakpoint
                close_timeout=0.5,
                max_size=MESSAGE_LIMIT,
                create_connection=_BoundedConnection,
            ) as connection:
                drop_dead_peer(connection.transport.get_extra_info("socket"), DEAD_PEER_TIMEOUT)
                await self._exchange(connection)
        except* (OSError, WebSocketException, ConnectionEnd, TimeoutError) as group:
            reason = group.exceptions[0]
            is_closed = isinstance(reason, ServerClosed) or (isinstance(reason, ConnectionClosed) and not _said(reason))
            if is_closed:
                self._ended = address
            elif not isinstance(reason, ConnectionRefusedError):
                self._ended = ""
            no_script = f"no script at {address} ({_text_of(reason)}); trying again"
            has_ended = f"the script at {address} has ended; the simulator connects again when it runs"
            self._metrics.error = printable(has_ended if self._ended == address else no_script)
            self._metrics.warn("connection", self._metrics.error)
        except* Exception as group:
            self._metrics.error = printable(f"internal error: {group.exceptions[0]}; trying again")
            self._metrics.report(group)
        await asyncio.sleep(self._retry)
        self._retry = min(2.0 * self._retry, RETRY_MAX)

    async def _exchange(self, connection: ClientConnection) -> None:
        _avoid_brackets_in_masks(connection)
        assert isinstance(connection, _BoundedConnection)
        session = Session(
            connection,
            self._simulation,
            self._metrics,
            detection=self._detection,
            traffic_lights=self._traffic_lights,
            images=self._images,
            image_sizes=self._image_sizes,
            on_telemetry=connection.read_limit.allow,
            resend_delay=self._resend_delay,
        )
        self._session = session
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(session.receive_loop())
                tasks.create_task(session.send_loop())
        finally:
            self._session = None
            if session.flow_control.has_command:
                self._retry = RETRY
            await session.close()


class _Connect(connect):
    """Connects to the address that the user has chosen and to no other."""

    def process_redirect(self, exc: Exception) -> Exception | str:
        """Follow no redirect: a script could send the simulator to any machine."""
        return exc


class _BoundedConnection(ClientConnection):
    """A WebSocket that is read at a bounded rate, and ends if its peer does not read the pongs that it asks for."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to read."""
        self.read_limit = ReadLimit(self.loop.time())
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """Process bytes of the peer."""
        super().data_received(data)
        if self.transport.get_write_buffer_size() > MAX_UNSENT:
            self.transport.abort()
        elif delay := self.read_limit.delay(self.loop.time()):
            self.transport.pause_reading()
            self.loop.call_later(delay, self._read_on)

    def process_event(self, event: Event) -> None:
        """Count a frame, also of a ping."""
        if isinstance(event, WebSocketFrame):
            self.read_limit.count(len(event.data))
        super().process_event(event)

    def _read_on(self) -> None:
        if not self.transport.is_closing() and not self.recv_messages.paused:
            self.transport.resume_reading()


def _said(closed: ConnectionClosed) -> str:
    """The reason that the script gave when it closed the connection; empty if it gave none."""
    return closed.rcvd.reason if closed.rcvd else ""


def _text_of(reason: Exception) -> str:
    """The error text without error number and address."""
    if isinstance(reason, ConnectionRefusedError) or f"[Errno {errno.ECONNREFUSED}]" in str(reason):
        return "connection refused"
    if isinstance(reason, socket.gaierror):
        return "no such host"
    return str(reason) or "timed out"


def _avoid_brackets_in_masks(connection: ClientConnection) -> None:
    """Let no frame have a mask with the characters `}]`, which end a message.

    The WebSocket library of the C++ devkit leaves the mask of a frame behind its text, and the devkit reads it as text.
    """
    protocol = connection.protocol

    def send_frame(frame: WebSocketFrame) -> None:
        header = 2 if len(frame.data) < 126 else 4 if len(frame.data) < 65536 else 10  # RFC 6455, section 5.2
        data = frame.serialize(mask=True)
        while b"}]" in data[header : header + 4]:
            data = frame.serialize(mask=True)
        protocol.writes.append(data)

    protocol.send_frame = send_frame


def _checked_address(host: str, port: int) -> str:
    host = without_brackets(host)
    if not _is_host(host):
        raise AutodriveError(f"devkit host {host[:80]!r} is not a host name or IP address, for example '127.0.0.1'")
    if not 0 < port < 65536:
        raise AutodriveError(f"devkit port {port} is not between 1 and 65535; the default is {DEVKIT_PORT}")
    return address_text(host, port)


def _is_host(host: str) -> bool:
    """Whether it is an IP address or a host name (RFC 1123, international names in Unicode)."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        pass
    else:
        return True
    try:
        name = host.encode("idna").decode()
    except UnicodeError:
        return False
    return len(name) < 254 and _HOST_NAME.fullmatch(name) is not None
