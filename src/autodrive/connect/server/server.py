"""The web server: the page, scene files and the native protocol on one port, in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import secrets
import socket
import threading
import time
from collections import deque
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from msgspec.structs import replace

from autodrive.base.cache import user_name
from autodrive.base.errors import AutodriveError
from autodrive.base.log_throttle import LogThrottle
from autodrive.base.tcp import address_text, is_every_interface, listener, without_brackets
from autodrive.connect.client.target import port_of_environment
from autodrive.connect.server.access import AccessPolicy, checked_token, is_loopback
from autodrive.connect.server.connections import HttpProtocol, WebSocketProtocol
from autodrive.connect.server.files import ServedFile, immutable_files, page_files
from autodrive.connect.server.hub import Hub
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.web import Receive, Scope, Send, WebApplication
from autodrive.protocol.codec import encode, streamed
from autodrive.protocol.messages import MAX_TEXT
from autodrive.protocol.native import SUBPROTOCOL, RunOrigin, Starting
from autodrive.protocol.ports import PORT

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import Scene
    from autodrive.world.views.scene_files import SceneFiles

log = logging.getLogger(__name__)

PORTS = 20
"""Number of ports that are tried, from the default one on."""
LOG_INTERVAL = 10.0
"""Errors of the same kind are logged once in this time [s]."""
STARTING_INTERVAL = 0.2
"""Time between two messages to a client that waits for the simulation [s]."""
MAX_EARLY, MAX_EARLY_BYTES = 100, 2**20
"""Messages that such a client may send; the first one beyond this number of bytes is the last one."""
MESSAGE_LIMIT = MAX_TEXT + 2**16
"""A client that sends a longer message [bytes] is disconnected."""


class SimulationServer:
    """Serves a Simulation to browsers and programs: `start`, then `url` is the link to open; `close` stops it.

    `served` None: clients are told what `starting` says until `serve` is called. `page`: folder of the built page;
    None: only the WebSocket and the scene files. Raises `AutodriveError` for a token that is not allowed.
    """

    def __init__(self, served: Served | None, options: PageOptions | None = None, *, page: Path | None = None) -> None:
        options = options or PageOptions()
        self.host = without_brackets(options.host)
        if options.token is not None:
            checked_token(options.token)
        self.token = options.token or (None if is_loopback(self.host) else secrets.token_urlsafe(16))
        self._page = page
        self._wanted_port = port_of_environment() if options.port is None else options.port
        self._port = 0
        self._policy = AccessPolicy(self.token, options.allowed_origins)
        self.origin = RunOrigin(secrets.token_hex(8), user_name(), time.time())
        """What clients are told about this run."""
        self._hub = None if served is None else Hub(served, self.origin)
        self.starting = Starting("starting")
        """What clients are told while nothing is served; may be set in any thread."""
        self._still: tuple[Scene, Frame] | None = None
        self._still_files: dict[str, ServedFile] = {}
        self._thread: threading.Thread | None = None
        self.web_server: uvicorn.Server | None = None

    @property
    def port(self) -> int:
        """The port that it listens on; 0 before the start."""
        return self._port

    @property
    def address(self) -> str:
        """Host and port for clients, 'host:port'."""
        return address_text(_reachable(self.host), self._port)

    @property
    def hub(self) -> Hub:
        """The connections of the clients with the simulation."""
        assert self._hub is not None, "nothing is served yet"
        return self._hub

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return self.hub.client_count

    @property
    def url(self) -> str:
        """The link to open, with the token if there is one."""
        return f"http://{self.address}/" + (f"?token={self.token}" if self.token else "")

    def start(self) -> None:
        """Listen, and serve in a thread of its own. Raises `AutodriveError` if the port is not available."""
        if self._thread is not None:
            raise RuntimeError("this Server is already started")
        listening = _listener(self.host, self._wanted_port)
        self._port = listening.getsockname()[1]
        is_ready = threading.Event()

        def serve() -> None:
            with asyncio.Runner(loop_factory=_new_loop) as runner:
                runner.run(self._serve(listening, is_ready))

        self._thread = threading.Thread(target=serve, name="autodrive-server", daemon=True)
        self._thread.start()
        is_ready.wait()

    def show(self, scene_files: SceneFiles, frame: Frame) -> None:
        """Let clients draw that world until one is served; may be called in any thread."""
        self._still_files = immutable_files(scene_files.files, "scene")
        self._still = scene_files.scene, streamed(frame, ())

    def serve(self, served: Served) -> None:
        """Serve a simulation from now on. The server was started without one."""
        hub = Hub(served, self.origin)
        asyncio.run_coroutine_threadsafe(self._hubs.enter_async_context(hub), self._loop).result()
        self._hub = hub

    def close(self) -> None:
        """Disconnect all clients and end the thread."""
        if self._thread is None:
            return
        if self.web_server is not None:
            self.web_server.should_exit = True
        self._thread.join()
        self._thread = None

    def __enter__(self) -> SimulationServer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def _serve(self, listening: socket.socket, is_ready: threading.Event) -> None:
        """Run the hub and the web server in the thread, until `close`."""
        page = {} if self._page is None else page_files(self._page)
        application = WebApplication(
            self._policy,
            lambda path: page.get(path) or (self._hub and self._hub.files.get(path)) or self._still_files.get(path),
            self._serve_client,
            lambda path: self._hub and self._hub.download(path),
        )
        config = uvicorn.Config(
            application,  # type: ignore[arg-type]
            http=HttpProtocol,
            ws=WebSocketProtocol,
            ws_max_size=MESSAGE_LIMIT,
            ws_per_message_deflate=False,
            ws_ping_interval=None,  # a client without pongs is not dead: a script may be stopped at a breakpoint
            lifespan="off",
            log_config=None,
            log_level="error",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self.web_server = uvicorn.Server(config)
        logging.getLogger("uvicorn.error").addFilter(_admits)
        self._loop = asyncio.get_running_loop()
        async with AsyncExitStack() as self._hubs:
            is_ready.set()
            if self._hub is not None:
                await self._hubs.enter_async_context(self._hub)
            await self.web_server.serve(sockets=[listening])

    async def _serve_client(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Accept a WebSocket, and serve its client as soon as there is something to serve."""
        is_offered = SUBPROTOCOL in scope["subprotocols"]
        await send({"type": "websocket.accept", "subprotocol": SUBPROTOCOL if is_offered else None})
        early = deque[dict[str, Any]]()
        if self._hub is None:
            await self._tell_until_served(receive, send, early)

        async def receive_all() -> dict[str, Any]:
            return early.popleft() if early else await receive()

        await self.hub.serve(scope, receive_all, send)

    async def _tell_until_served(self, receive: Receive, send: Send, early: deque[dict[str, Any]]) -> None:
        """Send `starting` until there is a hub; what the client sends meanwhile goes to `early`."""

        async def read() -> None:  # the pings of a client that has sent something are not answered until that is read
            size = 0
            while len(early) < MAX_EARLY and size < MAX_EARLY_BYTES:
                early.append(await receive())
                size += len(early[-1].get("bytes") or early[-1].get("text") or "")

        reading = asyncio.create_task(read())
        is_shown = False
        try:
            while self._hub is None:
                message = self.starting
                if self._still and not is_shown:
                    is_shown, (scene, frame) = True, self._still
                    message = replace(message, scene=scene, frame=frame)
                await send({"type": "websocket.send", "bytes": encode(message)})
                await asyncio.sleep(STARTING_INTERVAL)
        finally:
            reading.cancel()


_throttle = LogThrottle(LOG_INTERVAL, time.monotonic)


def _admits(record: logging.LogRecord) -> bool:
    """Whether a line of uvicorn is logged: clients could cause many."""
    return _throttle.admits(record.msg)


def _new_loop() -> asyncio.AbstractEventLoop:
    """An event loop of uvloop if it is installed."""
    try:
        import uvloop  # noqa: PLC0415  not on Windows
    except ImportError:
        return asyncio.new_event_loop()
    return uvloop.new_event_loop()


def _listener(host: str, port: int | None) -> socket.socket:
    """Listen on that port, or on the first free default port."""
    for attempt in range(PORTS if port is None else 1):
        number = PORT + attempt if port is None else port
        try:
            return listener(host, number)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise AutodriveError(f"cannot listen on {host} port {number}: {error.strerror or error}") from None
        except OverflowError:
            raise AutodriveError(f"port {number} is not in the range 0 to 65535") from None
    if port is not None:
        raise AutodriveError(f"port {port} of {host} is in use; choose another one with --port")
    raise AutodriveError(f"ports {PORT} to {PORT + PORTS - 1} of {host} are all in use; choose a free one with --port")


def _reachable(host: str) -> str:
    """An address that other machines can use; for 'all addresses' the one of the default route."""
    if not is_every_interface(host):
        return host
    probes = [(socket.AF_INET, "192.0.2.1"), *([(socket.AF_INET6, "2001:db8::1")] if ":" in host else [])]
    for family, other in probes:
        with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((other, 9))  # nothing is sent; a documentation address (RFC 5737, RFC 3849)
            return probe.getsockname()[0]
    return "127.0.0.1"
