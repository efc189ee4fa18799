"""Images of scene cameras, rendered by the simulator for clients that cannot render."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.overlays import Marks
from autodrive.protocol.codec import encode
from autodrive.protocol.native import Error, Rendered, SensorView, SetCamera, Shapes, ViewSensor
from autodrive.world.contacts import shapes_of

if TYPE_CHECKING:
    from autodrive.connect.server.connected_client import ConnectedClient
    from autodrive.graphics.cameras.render_worker import RenderResult
    from autodrive.graphics.cameras.scene_views import SceneViews
    from autodrive.protocol.messages import Frame
    from autodrive.world import World

MAX_RATE = 60.0
"""Images per second and client at most [Hz]."""


_Key: TypeAlias = "tuple[ConnectedClient, type[SetCamera | ViewSensor]]"


@dataclass
class _RemoteView:
    """The camera that a client has set, and the state of its images."""

    number: int
    camera: SetCamera | ViewSensor
    frame: Frame | None = None
    """The Frame that was rendered last."""
    is_rendering: bool = False
    is_due_again: bool = False
    is_scheduled: bool = False
    next: float = 0.0


class RemoteViews:
    """Renders the latest Frame, one image at a time for each client. Used in the server's event loop.

    `renderer_factory` starts the process that renders a World; it is called for the first view. `on_change` is called
    when views have changed.
    """

    def __init__(
        self, renderer_factory: Callable[[World], SceneViews], on_change: Callable[[], None] = lambda: None
    ) -> None:
        self._on_change = on_change
        self._renderer_factory = renderer_factory
        self._world: World | None = None
        self._process: SceneViews | None = None
        self._views: dict[_Key, _RemoteView] = {}
        self._shapes: tuple[World, Shapes] | None = None
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

    def set_view(self, client: ConnectedClient, camera: SetCamera | ViewSensor, now: float) -> None:
        """Send images of that camera to a client, or none. Raises `AutodriveError`."""
        key = client, type(camera)
        if camera.camera is None:
            self._forget(key)
            return
        if self._world is None:
            raise AutodriveError("the scene is not ready yet")
        if self._process is None:
            self._process = self._renderer_factory(self._world)
        self._process.check(camera)
        if not 0.0 < camera.rate <= 1e6:
            raise AutodriveError(f"the rate of a {type(camera).__name__} must be more than 0 Hz, not {camera.rate}")
        if key not in self._views:
            self._count += 1
            self._views[key] = _RemoteView(self._count, camera)
        view = self._views[key]
        view.camera, view.frame, view.next = camera, None, 0.0
        self._on_change()
        self._render(key, view, now)

    def forget(self, client: ConnectedClient) -> None:
        """Send no more images to that client."""
        for kind in (SetCamera, ViewSensor):
            self._forget((client, kind))

    def _forget(self, key: _Key) -> None:
        view = self._views.pop(key, None)
        if view is not None and self._process is not None:
            self._process.forget(view.number)
        self._on_change()

    def offer(self, frame: Frame, now: float) -> None:
        """Render a new Frame for all clients where an image is due."""
        self._latest = frame
        for key, view in list(self._views.items()):
            self._render(key, view, now)

    @property
    def wants_forces(self) -> bool:
        """Whether a view shows contact forces."""
        return any(
            isinstance(view.camera, SetCamera) and view.camera.force_scale > 0.0 for view in self._views.values()
        )

    def redraw(self, now: float) -> None:
        """Render the latest Frame again, with drawings that are new."""
        for key, view in list(self._views.items()):
            if isinstance(view.camera, SetCamera) and view.camera.drawings:
                view.frame = None
                self._render(key, view, now)

    def _render(self, key: _Key, view: _RemoteView, now: float) -> None:
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
                asyncio.get_running_loop().call_at(view.next, self._render_now, key, view)
            return
        view.is_rendering, view.frame = True, frame
        view.next = now + 1.0 / min(view.camera.rate, MAX_RATE)
        loop = asyncio.get_running_loop()

        def deliver(image: Future[RenderResult]) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(self._send, key, view, frame, image)

        process.draw(view.number, view.camera, frame, self._marks()).add_done_callback(deliver)

    def _marks(self) -> Marks:
        world = self._world
        assert world is not None
        return Marks(world.drawings, lambda: self._shapes_of(world), world.contact_forces)

    def _shapes_of(self, world: World) -> Shapes:
        """Made once for each World."""
        if self._shapes is None or self._shapes[0] is not world:
            self._shapes = world, shapes_of(world.compiled)
        return self._shapes[1]

    def _render_now(self, key: _Key, view: _RemoteView) -> None:
        view.is_scheduled = False
        if self._views.get(key) is view:
            self._render(key, view, asyncio.get_running_loop().time())

    def _send(self, key: _Key, view: _RemoteView, frame: Frame, image: Future[RenderResult]) -> None:
        view.is_rendering = False
        if self._views.get(key) is not view:
            return
        client, kind = key
        error = image.exception()
        if error is None:
            message = Rendered if kind is SetCamera else SensorView
            client.set_rendered(message, encode(message(frame.time, image.result().answer)))
        elif self._latest is not None:  # otherwise it was rendered for the previous World
            del self._views[key]
            client.send_error(Error("request", str(error)))
            return
        if view.is_due_again:
            view.is_due_again = False
            self._render_now(key, view)
