"""Sends the Frames of the simulation to all clients, and loads the scene files when the World changes."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING

from autodrive.connect.server.encoded_frames import EncodedFrames
from autodrive.connect.server.files import ServedFile, immutable_files
from autodrive.connect.server.frame_queue import MAX_EVENTS, Completion, FrameQueue, FrameUpdate
from autodrive.connect.server.remote_view import RemoteViews
from autodrive.connect.server.ways import WayNotes

if TYPE_CHECKING:
    from autodrive.connect.server.connected_client import ConnectedClient
    from autodrive.connect.server.served import Served
    from autodrive.protocol.messages import Frame
    from autodrive.world import World
    from autodrive.world.views.scene_files import SceneFiles

log = logging.getLogger(__name__)

RETRY = 0.02
"""A Frame that could not be sent yet is offered again after this time [s]."""


class Broadcast:
    """Used in the server's event loop. `clients` is shared with the Hub; `on_change` is called when the Status changes.

    Frames and finished requests of a new World wait until its scene files are loaded.
    """

    def __init__(self, served: Served, clients: set[ConnectedClient], on_change: Callable[[], None]) -> None:
        self.encoded = EncodedFrames(served.jpeg_encoder)
        self.files: dict[str, ServedFile] = {}
        """The scene files, by path."""
        self.queue = FrameQueue(served.simulation, self._take_items)
        self.ways = WayNotes()
        self.remote_views = RemoteViews(served.renderer_factory, self.watch_contacts)
        self.note = ""
        """A long operation that runs now, for the Status."""
        self._simulation = served.simulation
        self._clients = clients
        self._scene_files = served.scene_files
        self._on_change = on_change
        self._scene_files_now: dict[str, ServedFile] = {}
        self._held: list[FrameUpdate | Completion] = []
        self._world: World | None = None
        self._prepared: tuple[World, SceneFiles] | None = None
        self._loading: asyncio.Task[None] | None = None
        self._is_retry_pending = False

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Start to send the simulation's Frames."""
        self._loop = loop
        self.queue.open(loop)
        self._simulation.add_sink(self.ways)
        self._simulation.add_sink(self.queue)
        self.queue.publish(self._simulation.frame)

    async def close(self) -> None:
        """Stop sending."""
        self._simulation.remove_sink(self.queue)
        self._simulation.remove_sink(self.ways)
        if self._loading is not None:
            self._loading.cancel()
        await self.remote_views.close()

    def prepare(self, world: World) -> None:
        """Load the scene files of a World before its first Frame; called in another thread."""
        self._prepared = world, self._scene_files(world)

    @property
    def latest(self) -> Frame:
        """The latest Frame whose Scene is loaded; before the first Scene, that of the simulation."""
        return self.encoded.latest or self._simulation.frame

    def offer_latest(self, client: ConnectedClient) -> None:
        """Offer the latest Frame to a client that is new or has changed its subscription."""
        if self.encoded.latest is not None:
            client.offer(self.encoded.latest, (), self._loop.time())
        client.on_drawings()

    def watch_contacts(self) -> None:
        """Let the World report contact forces if a client wants them."""
        if self._world is not None:
            is_wanted = any(client.subscription.contacts for client in self._clients)
            self._world.watch_contacts(is_wanted or self.remote_views.wants_forces)

    def _take_items(self) -> None:
        for queued in self.queue.take():
            if self._loading is not None:
                self._hold(queued)
            elif isinstance(queued, Completion):
                queued.callback(queued.future)
            elif queued.world is not self._world:
                self._hold(queued)
                self._loading = asyncio.create_task(self._load_scene(queued.world))
            else:
                self._send(queued)
        self.update_drawings()

    def update_drawings(self) -> None:
        """Send drawings that are new: with each Frame, and from time to time in a pause, in which none comes."""
        if self._world is not None and self.encoded.set_drawings(self._world.drawings):
            for client in self._clients:
                client.on_drawings()
            self.remote_views.redraw(self._loop.time())

    def _hold(self, queued: FrameUpdate | Completion) -> None:
        """Keep an item for later: of consecutive updates the last of the World that is being loaded, and the last."""
        before = self._held[-1] if self._held else None
        if not (isinstance(queued, FrameUpdate) and isinstance(before, FrameUpdate)):
            self._held.append(queued)
        elif before.world is queued.world:
            self._held[-1] = FrameUpdate(queued.world, queued.frame, (*before.events, *queued.events)[-MAX_EVENTS:])
        elif len(self._held) > 1:
            self._held[-1] = queued
        else:
            self._held.append(queued)

    def _send(self, update: FrameUpdate) -> None:
        self.encoded.latest = update.frame
        self.encoded.contact_forces = update.world.contact_forces
        now = self._loop.time()
        self.remote_views.offer(update.frame, now)
        is_early = False
        for client in self._clients:
            is_early |= client.offer(update.frame, update.events, now)
        if is_early and not self._is_retry_pending:
            self._is_retry_pending = True
            self._loop.call_later(RETRY, self._retry)

    def _retry(self) -> None:
        """Offer the latest Frame again: it may be the last for a long time, for example before a pause."""
        self._is_retry_pending = False
        if self.encoded.latest is not None and self._loading is None and self._world is not None:
            self._send(FrameUpdate(self._world, self.encoded.latest, ()))

    async def _load_scene(self, world: World) -> None:
        """Load the scene files of a World, then deliver the items that waited for it."""
        self.note = "preparing the scene"
        self._on_change()
        try:
            made_of, loaded = self._prepared or (None, None)
            if loaded is None or made_of is not world:
                loaded = await asyncio.to_thread(self._scene_files, world)
            else:
                self._prepared = None
            new = immutable_files(loaded.files, "scene")
            self.files = self._scene_files_now | new  # a client may still be loading the previous scene
            self._scene_files_now = new
            self.encoded.set_scene(loaded.scene, world)
        except Exception:
            log.exception("server: the scene files cannot be loaded; clients get no scene")
        try:
            await self.remote_views.set_world(world)
        except Exception:
            log.exception("server: the scene cameras cannot be started; clients get no images of the scene cameras")
        self.note = ""
        if self._world is not None:
            self._world.watch_contacts(False)
        self._world = world
        self.watch_contacts()
        for client in self._clients:
            client.on_scene_change()
        self._loading = None
        held, self._held = self._held, []
        self.queue.put_back(held)
        self._take_items()
        self._on_change()
