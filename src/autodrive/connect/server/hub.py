"""Connects all clients with the simulation: receives their messages and sends the Status."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from pathlib import Path
from typing import Any

from uvicorn.protocols.utils import ClientDisconnected

from autodrive.base.errors import AutodriveError
from autodrive.base.log_throttle import LogThrottle
from autodrive.base.version import __version__
from autodrive.connect.server.bridge_control import BridgeControl
from autodrive.connect.server.broadcast import Broadcast
from autodrive.connect.server.connected_client import ConnectedClient
from autodrive.connect.server.connections import ABORT, IS_CLIENT
from autodrive.connect.server.driver_lease import DriverLeases
from autodrive.connect.server.driving import Driving
from autodrive.connect.server.files import ServedFile
from autodrive.connect.server.handshake import RefusedError, decoded, id_of, next_message, receive_hello
from autodrive.connect.server.operations import OFFERED
from autodrive.connect.server.rate_limit import BYTES, RATE, RateLimit
from autodrive.connect.server.requests import Requests
from autodrive.connect.server.served import Served
from autodrive.protocol.codec import encode
from autodrive.protocol.native import (
    PROTOCOL,
    ClientMessage,
    Drive,
    Error,
    Hello,
    Release,
    Request,
    RunOrigin,
    Status,
    Subscribe,
    Welcome,
)

log = logging.getLogger(__name__)

DOWNLOADS = "recordings"
"""Folder of recordings and films, relative to the page."""
MAX_CLIENTS = 100
"""More are refused."""
MAX_WAIT = 10.0
"""A client that has not read a message for this time [s] is disconnected if its place is needed."""
STATUS_INTERVAL, LEAST_STATUS_INTERVAL = 0.25, 0.02
"""Time between two Status messages without and with changes [s]."""
MAX_AGE = 4.0
"""A request is refused if the Status that its sender had is older [s]; the page gives up its requests after 5 s."""
POLICY_VIOLATION, TRY_AGAIN_LATER = 1008, 1013
"""Close codes of a WebSocket (RFC 6455)."""


class Hub:
    """An asynchronous context in the server's event loop; `serve` serves one client."""

    def __init__(self, served: Served, origin: RunOrigin) -> None:
        self._served = served
        self._origin = origin
        self.clients: set[ConnectedClient] = set()
        self.broadcast = Broadcast(served, self.clients, self._send_status_soon)
        self._leases = DriverLeases()
        self._bridge = BridgeControl(served.bridge)
        self._driving = Driving(served, self._leases, self._send_status_soon, self.now)
        self._requests = Requests(
            served,
            self.broadcast,
            self._leases,
            self._bridge,
            on_change=self._send_status_soon,
            clock=self.now,
        )
        self._is_status_due = False
        self._last_status = -math.inf
        self._are_pictures_wanted = False

    async def __aenter__(self) -> Hub:
        self._loop = asyncio.get_running_loop()
        self.broadcast.open(self._loop)
        self._status_task = asyncio.create_task(self._send_status_regularly())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._status_task.cancel()
        if self._are_pictures_wanted:
            self._served.want_pictures(False)
        await self.broadcast.close()

    @property
    def files(self) -> dict[str, ServedFile]:
        """The scene files, by path."""
        return self.broadcast.files

    def download(self, path: str) -> Path | None:
        """The file of a recording or a film at that path; None: there is none."""
        folder, _, name = path.partition("/")
        return self._served.recording.path(name) if folder == DOWNLOADS else None

    @property
    def client_count(self) -> int:
        """Number of connected clients; may be called from any thread."""
        return len(self.clients)

    # -- one client ---------------------------------------------------------------------------------------------

    async def serve(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """Serve the client of an accepted WebSocket (ASGI) until it disconnects."""

        async def send_bytes(message: bytes) -> None:
            await send({"type": "websocket.send", "bytes": message})

        try:
            hello = await receive_hello(receive)
        except RefusedError as error:
            await send_bytes(error.message)
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        if hello is None:
            return
        if not self._has_room():
            await send_bytes(encode(Error("rate", f"{MAX_CLIENTS} clients are connected; no more are accepted")))
            await send({"type": "websocket.close", "code": TRY_AGAIN_LATER})
            return
        scope[IS_CLIENT] = True
        client = ConnectedClient(
            self._free_name(hello.name), self.broadcast.encoded, self.broadcast.ways, scope.get(ABORT, lambda: None)
        )
        served = self._served
        welcome = Welcome(
            PROTOCOL,
            __version__,
            client.name,
            dict(served.scenarios),
            served.own_files.folder,
            self._origin,
            served.simulation.world.spec.title,
            served.has_start_screen(),
        )
        await send_bytes(encode(welcome))
        await self._serve_client(client, receive, send, send_bytes)

    def _has_room(self) -> bool:
        """Whether one more client is accepted; it takes the place of one that has not read for `MAX_WAIT`."""
        if len(self.clients) < MAX_CLIENTS:
            return True
        slowest = min(self.clients, key=lambda client: client.waits_since)
        if self.now() - slowest.waits_since < MAX_WAIT:
            return False
        self.clients.discard(slowest)
        slowest.abort()
        return True

    async def _serve_client(self, client: ConnectedClient, receive: Any, send: Any, send_bytes: Any) -> None:
        self.clients.add(client)
        self._send_status_soon()
        self.broadcast.offer_latest(client)
        sending = asyncio.create_task(client.send_loop(send_bytes))
        sending.add_done_callback(lambda task: _on_end_of_sending(task, client))
        try:
            await self._receive_loop(client, receive)
            sending.cancel()  # it must send nothing after the close
            with contextlib.suppress(Exception):
                await send({"type": "websocket.close", "code": POLICY_VIOLATION})
        finally:
            sending.cancel()
            self.clients.discard(client)
            self._driving.forget(client)
            self._requests.forget(client)
            self.broadcast.remote_views.forget(client)
            self._update_wanted_pictures()
            self.broadcast.watch_contacts()
            self._send_status_soon()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await sending

    async def _receive_loop(self, client: ConnectedClient, receive: Any) -> None:
        """Handle messages until the client disconnects, exceeds the rate limit too often or does not read replies."""
        limit = RateLimit(self.now())
        warnings = LogThrottle(1.0, self.now)
        while (data := await next_message(receive)) is not None:
            if limit.allows_size(len(data), self.now()):
                try:
                    message = decoded(data)
                except AutodriveError as error:
                    id = id_of(data)
                    message = Error("message" if id is None else "request", str(error), id)
                if isinstance(message, Request) and (error := self._too_late(message)):
                    client.send_error(error)
                elif isinstance(message, Request):
                    if not self._requests.execute(client, message, len(data)):
                        limit.drop()
                elif limit.allows(self.now()):
                    self._handle(client, message)
                elif warnings.admits("messages"):
                    client.send_error(
                        Error("rate", f"more than {RATE:g} messages per second; some messages are dropped")
                    )
            elif warnings.admits("bytes"):
                client.send_error(Error("rate", f"more than {BYTES:g} bytes per second; some messages are dropped"))
            if limit.is_exhausted or client.is_overrun:
                return

    def _too_late(self, request: Request) -> Error | None:
        """The Error for a request that was held up on its way, or while this process was stopped."""
        age = 0.0 if request.heard is None else self.now() - request.heard
        if age <= MAX_AGE:
            return None
        text = f"the connection was interrupted: the request arrived {age:.0f} s late and was not executed"
        return Error("request", text, request.id)

    def _handle(self, client: ConnectedClient, message: ClientMessage | Error) -> None:
        """A message that is no Request."""
        match message:
            case Error():
                client.send_error(message)
            case Subscribe():
                self._subscribe(client, message)
            case Drive():
                self._driving.drive(client, message)
            case Release(vehicle=vehicle):
                self._driving.release(client, vehicle)
            case Hello():
                client.send_error(Error("message", "a Hello is sent once, at the beginning"))

    def _subscribe(self, client: ConnectedClient, subscription: Subscribe) -> None:
        client.subscribe(subscription)
        self._update_wanted_pictures()
        self.broadcast.watch_contacts()
        self.broadcast.offer_latest(client)

    def _update_wanted_pictures(self) -> None:
        wanted = any(client.subscription.picture_rate > 0 for client in self.clients)
        if wanted != self._are_pictures_wanted:
            self._are_pictures_wanted = wanted
            self._served.want_pictures(wanted)

    def _free_name(self, wanted: str) -> str:
        name = "".join(c for c in wanted if c.isprintable())[:40].strip() or "client"
        taken = {client.name for client in self.clients}
        return next(
            free_name
            for n in range(1, MAX_CLIENTS + 2)
            if (free_name := name if n == 1 else f"{name} {n}") not in taken
        )

    # -- status -------------------------------------------------------------------------------------------------

    def now(self) -> float:
        """Time of the event loop [s]."""
        return self._loop.time()

    def _send_status_soon(self) -> None:
        """Send one Status for all changes of this turn of the event loop, or of `LEAST_STATUS_INTERVAL`."""
        if not self._is_status_due:
            self._is_status_due = True
            self._loop.call_at(max(self._last_status + LEAST_STATUS_INTERVAL, self.now()), self._send_status)

    async def _send_status_regularly(self) -> None:
        while True:
            try:
                self.broadcast.update_drawings()
                self._send_status()
            except Exception:
                log.exception("server: a Status could not be sent")
            await asyncio.sleep(STATUS_INTERVAL)

    def _send_status(self) -> None:
        self._is_status_due = False
        if not self.clients:
            return
        served, simulation = self._served, self._served.simulation
        self._last_status = now = self.now()
        note = self.broadcast.note or self._requests.note
        status = encode(
            Status(
                is_paused=simulation.is_paused,
                speed=simulation.speed,
                real_time_factor=simulation.real_time_factor,
                late_ticks=simulation.late_ticks,
                clients=len(self.clients),
                drivers={vehicle: client.name for vehicle, client in self._leases.drivers(now).items()},
                bridge=self._bridge.status(now),
                cameras_error=served.cameras_error() if self._are_pictures_wanted else "",
                cameras_note=served.cameras_note() if self._are_pictures_wanted else "",
                note=note or ("" if simulation.is_running else "the simulation is not running"),
                undo=simulation.undo_name,
                redo=simulation.redo_name,
                error=simulation.error,
                recording=served.recording.status,
                position=served.replay.position if served.replay else None,
                change=self._requests.change,
                changes=self._requests.changes,
                clock=now,
                episode=served.episode(),
                refused={type(each).__name__: reason for each in OFFERED if (reason := served.refusal(each))},
            )
        )
        for client in self.clients:
            client.set_status(status)


def _on_end_of_sending(sending: asyncio.Task[None], client: ConnectedClient) -> None:
    """A client that is sent nothing more does not stay connected."""
    if not sending.cancelled() and (error := sending.exception()) is not None:
        if not isinstance(error, ClientDisconnected):
            log.error("server: a message to '%s' could not be sent", client.name, exc_info=error)
        client.abort()
