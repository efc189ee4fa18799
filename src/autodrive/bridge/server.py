"""Serves the page, scene files and the native protocol on one port, from a thread of its own."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import uvicorn

from autodrive.bridge.door import Door, is_loopback
from autodrive.bridge.files import page_files
from autodrive.bridge.hub import Hub
from autodrive.bridge.web import Protocol, Site
from autodrive.errors import AutodriveError
from autodrive.protocol.ports import PORT

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge
    from autodrive.jpeg import JpegEncoder
    from autodrive.scene_process import SceneProcess
    from autodrive.scenery import Scenery
    from autodrive.simulation import Simulation
    from autodrive.world import World

log = logging.getLogger(__name__)

PORTS = 20
"""So many are tried, from the usual one on."""
MESSAGE_LIMIT = 2**16
"""A client that sends a longer message [bytes] is disconnected."""
CONNECTIONS = 400
"""Browsers open some for each viewer."""


class Server:
    """Serves a Simulation to browsers and programs: `start`, then `url` is the link to open; `close` ends it.

    - `page`: folder of the built page; None: the WebSocket and the scene files alone.
    - `scenery(world)`: what there is to draw; called in another thread, at the start and for each World that a
      `LoadScenario` brings.
    - `bridge`: connected and disconnected by request; it need not be started. None: such requests are refused.
    - `scenarios`: name -> title of those that may be loaded; the Simulation's `load` makes them.
    - `port` None: `PORT`, or the next free one; a port that was asked for and is taken is an `AutodriveError`.
    - `token`: needed to enter. Where `host` is not this machine alone, one is made if none is given.
    - `allowed_origins`: of pages elsewhere that may connect, for example 'https://lab.example.org'.
    - `pictures`: makes the JPEGs of the sensor cameras; None: no pictures are sent.
    - `cameras_fault()`: why there are no pictures; empty if there are.
    - `wants_pictures(wanted)`: called in the server's thread when the first viewer wants pictures, and when none does.
    - `crew(world)`: makes what draws scene cameras for viewers who cannot; None: `SceneProcess.of`.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        scenery: Callable[[World], Scenery],
        page: Path | None = None,
        bridge: DevkitBridge | None = None,
        scenarios: Mapping[str, str] | None = None,
        host: str = "127.0.0.1",
        port: int | None = None,
        token: str | None = None,
        allowed_origins: Sequence[str] = (),
        pictures: JpegEncoder | None = None,
        cameras_fault: Callable[[], str] = lambda: "",
        wants_pictures: Callable[[bool], None] = lambda wanted: None,
        crew: Callable[[World], SceneProcess] | None = None,
    ) -> None:
        self.host = host
        self.token = token or (None if is_loopback(host) else secrets.token_urlsafe(16))
        self._page = page
        self._wanted_port = port
        self._port = 0
        self._door = Door(self.token, tuple(allowed_origins))
        self._hub = Hub(
            simulation,
            scenery=scenery,
            bridge=bridge,
            scenarios=dict(scenarios or {}),
            pictures=pictures,
            cameras_fault=cameras_fault,
            wants_pictures=wants_pictures,
            crew=crew or _crew,
        )
        self._thread: threading.Thread | None = None
        self._server: uvicorn.Server | None = None

    @property
    def port(self) -> int:
        """The one that it listens on; 0 before the start."""
        return self._port

    @property
    def address(self) -> str:
        """Host and port as others reach it, 'host:port'."""
        host = _reachable(self.host)
        return f"[{host}]:{self._port}" if ":" in host else f"{host}:{self._port}"

    @property
    def viewers(self) -> int:
        """How many are connected now."""
        return self._hub.viewers

    @property
    def url(self) -> str:
        """The link to open, with the token where one is needed."""
        return f"http://{self.address}/" + (f"?token={self.token}" if self.token else "")

    def start(self) -> None:
        """Listen, and serve from a thread of its own. Raises `AutodriveError` if that port cannot be had."""
        if self._thread is not None:
            raise RuntimeError("this Server is started already")
        listener = _listener(self.host, self._wanted_port)
        self._port = listener.getsockname()[1]
        is_ready = threading.Event()

        def serve() -> None:
            with asyncio.Runner(loop_factory=_new_loop) as runner:
                runner.run(self._serve(listener, is_ready))

        self._thread = threading.Thread(target=serve, name="autodrive-server", daemon=True)
        self._thread.start()
        is_ready.wait()

    def close(self) -> None:
        """Say goodbye to all and end the thread."""
        if self._thread is None:
            return
        if self._server is not None:
            self._server.should_exit = True
        self._thread.join()
        self._thread = None

    def __enter__(self) -> Server:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def _serve(self, listener: socket.socket, is_ready: threading.Event) -> None:
        """In the thread: the hub and the web server, until `close`."""
        page = {} if self._page is None else page_files(self._page)
        site = Site(self._door, lambda path: page.get(path) or self._hub.files.get(path), self._hub.talk)
        config = uvicorn.Config(
            site,  # type: ignore[arg-type]
            ws=Protocol,
            ws_max_size=MESSAGE_LIMIT,
            ws_per_message_deflate=False,
            ws_ping_interval=None,  # a missing pong proves nothing: a script may stand at a breakpoint
            lifespan="off",
            log_config=None,
            log_level="error",
            access_log=False,
            server_header=False,
            limit_concurrency=CONNECTIONS,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        is_ready.set()
        async with self._hub:
            await self._server.serve(sockets=[listener])


def _crew(world: World) -> SceneProcess:
    """Imported when the first viewer needs it: it brings the renderer along."""
    from autodrive.scene_process import SceneProcess  # noqa: PLC0415

    return SceneProcess.of(world)


def _new_loop() -> asyncio.AbstractEventLoop:
    """Of uvloop, where there is one."""
    try:
        import uvloop  # noqa: PLC0415  not on Windows
    except ImportError:
        return asyncio.new_event_loop()
    return uvloop.new_event_loop()


def _listener(host: str, port: int | None) -> socket.socket:
    """On that port, or on the first free one of the usual."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for attempt in range(PORTS if port is None else 1):
        number = PORT + attempt if port is None else port
        try:
            return socket.create_server((host, number), family=family, backlog=200)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise AutodriveError(f"cannot listen on {host} port {number}: {error.strerror or error}") from None
        except OverflowError:
            raise AutodriveError(f"port {number} is not from 0 to 65535") from None
    if port is not None:
        raise AutodriveError(f"port {port} of {host} is taken by another program; without --port the next free is used")
    raise AutodriveError(f"ports {PORT} to {PORT + PORTS - 1} of {host} are all taken; name a free one with --port")


def _reachable(host: str) -> str:
    """An address that others can use: of all of this machine's, the one that leads outside."""
    try:
        is_any = ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return host
    if not is_any:
        return host
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # nothing is sent; a documentation address (RFC 5737)
            return probe.getsockname()[0]
        except OSError:
            return "127.0.0.1"
