"""Images of scene cameras, rendered by the simulator for clients that cannot render."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.protocol.codec import encode
from autodrive.protocol.native import Error, Rendered, SetCamera

if TYPE_CHECKING:
    from autodrive.connect.server.connected_client import ConnectedClient
    from autodrive.graphics.cameras.render_worker import Drawn
    from autodrive.graphics.cameras.scene_views import SceneViews
    from autodrive.protocol.messages import Frame
    from autodrive.world import World

MAX_RATE = 60.0
"""Images per second and client at most [Hz]."""


@dataclass
class _RemoteView:
    """The camera that a client has set, and the state of its images."""

    number: int
    camera: SetCamera
    frame: Frame | None = None
    """The Frame that was rendered last."""
    is_rendering: bool = False
    is_due_again: bool = False
    is_scheduled: bool = False
    next: float = 0.0


class RemoteViews:
    """Renders the latest Frame, one image at a time for each client. Used in the server's event loop.

    `renderer_factory` starts the process that renders a World; it is called for the first view.
    """

    def __init__(self, renderer_factory: Callable[[World], SceneViews]) -> None:
        self._renderer_factory = renderer_factory
        self._world: World | None = None
        self._process: SceneViews | None = None
        self._views: dict[ConnectedClient, _RemoteView] = {}
        self._latest: Frame | None = None
        self._count = 0

    async def set_world(self, world: World) -> None:
        """Render that World from now on."""
        previous, self._world, self._latest = self._process, world, None
        self._process = self._renderer_factory(world) if self._views else None
        if previous is not None:
            await asyncio.to_thread(previous.close)

    async def close(self) -> None:
        """Stop rendering."""
        self._views.clear()
        if self._process is not None:
            await asyncio.to_thread(self._process.close)

    def set_view(self, client: ConnectedClient, camera: SetCamera, now: float) -> None:
        """Send images of that camera to a client, or none. Raises `AutodriveError`."""
        if camera.camera is None:
            self.forget(client)
            return
        if self._world is None:
            raise AutodriveError("the scene is not ready yet")
        if self._process is None:
            self._process = self._renderer_factory(self._world)
        self._process.check(camera)
        if not 0.0 < camera.rate <= 1e6:
            raise AutodriveError(f"the rate of a SetCamera must be more than 0 Hz, not {camera.rate}")
        if client not in self._views:
            self._count += 1
            self._views[client] = _RemoteView(self._count, camera)
        view = self._views[client]
        view.camera, view.frame, view.next = camera, None, 0.0
        self._render(client, view, now)

    def forget(self, client: ConnectedClient) -> None:
        """Send no more images to that client."""
        view = self._views.pop(client, None)
        if view is not None and self._process is not None:
            self._process.forget(view.number)

    def offer(self, frame: Frame, now: float) -> None:
        """Render a new Frame for all clients where an image is due."""
        self._latest = frame
        for client, view in list(self._views.items()):
            self._render(client, view, now)

    def _render(self, client: ConnectedClient, view: _RemoteView, now: float) -> None:
        """Render the latest Frame, unless it was rendered, an image is being rendered, or it is too early."""
        frame, process = self._latest, self._process
        if frame is None or frame is view.frame or process is None:
            return
        if view.is_rendering:
            view.is_due_again = True
            return
        if now < view.next:  # this Frame may be the last for a long time, for example before a pause
            if not view.is_scheduled:
                view.is_scheduled = True
                asyncio.get_running_loop().call_at(view.next, self._render_now, client, view)
            return
        view.is_rendering, view.frame = True, frame
        view.next = now + 1.0 / min(view.camera.rate, MAX_RATE)
        loop = asyncio.get_running_loop()

        def deliver(image: Future[Drawn]) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(self._send, client, view, frame, image)

        process.draw(view.number, view.camera, frame).add_done_callback(deliver)

    def _render_now(self, client: ConnectedClient, view: _RemoteView) -> None:
        view.is_scheduled = False
        if self._views.get(client) is view:
            self._render(client, view, asyncio.get_running_loop().time())

    def _send(self, client: ConnectedClient, view: _RemoteView, frame: Frame, image: Future[Drawn]) -> None:
        view.is_rendering = False
        if self._views.get(client) is not view:
            return
        error = image.exception()
        if error is None:
            client.set_rendered(encode(Rendered(frame.time, image.result().answer)))
        elif self._latest is not None:  # otherwise it was rendered for the previous World
            del self._views[client]
            client.send_error(Error("request", str(error)))
            return
        if view.is_due_again:
            view.is_due_again = False
            self._render_now(client, view)
