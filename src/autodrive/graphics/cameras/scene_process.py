"""Renders scene cameras in a separate process, for clients that cannot draw themselves."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, NamedTuple

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.scene_camera import SceneCamera, check_view, image_size
from autodrive.graphics.cameras.scene_worker import DrawnScene, DrawScene, SceneContents, SceneMessage
from autodrive.graphics.cameras.worker import RESTARTS, SHUTDOWN_TIME, Failed, Ready, Worker
from autodrive.graphics.render.render_state import RenderState

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import SetCamera

log = logging.getLogger(__name__)

CLOSED = "scene cameras of this world were closed"


class PendingImage(NamedTuple):
    """An image that a client waits for."""

    view: SetCamera
    frame: Frame
    image: Future[bytes]


class SceneProcess:
    """Draws the scene cameras of any number of clients, one image at a time, each client in turn.

    The worker starts with the first `draw`. If it dies, or is killed because it does not answer, a new one draws the
    image that was being drawn, `RESTARTS` times. After that, or if nothing can be drawn, as without OpenGL, each `draw`
    fails and `error` says why. All methods may be called in any thread.
    """

    def __init__(self, contents: SceneContents, *, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock`: wall time [s], by which God's Eye turns."""
        self._contents = contents
        self._clock = clock
        self._cameras: dict[int, SceneCamera] = {}
        self._pending: dict[int, PendingImage] = {}
        self._changed = threading.Condition()
        self._worker: Worker[SceneMessage] | None = None
        self._thread: threading.Thread | None = None
        self._is_closed = False
        self._error = self._renderer = ""
        self._is_unavailable = False
        self._restarts = 0

    def check(self, view: SetCamera) -> None:
        """Raises `AutodriveError` if that view cannot be drawn in any Frame."""
        check_view(view, list(self._contents.vehicles))
        if self._is_unavailable:
            raise AutodriveError(self._error)

    def draw(self, client: int, view: SetCamera, frame: Frame) -> Future[bytes]:
        """The JPEG image of that Frame; `client`: a number that identifies the client.

        While an image of that client is still waiting, its view and Frame are replaced and the same Future is
        returned. The Future fails with an `AutodriveError` if nothing can be drawn; the call itself never raises.
        """
        image: Future[bytes] = Future()
        try:
            self.check(view)
            self._check_frame(frame)
        except AutodriveError as error:
            image.set_exception(error)
            return image
        with self._changed:
            if self._is_closed:
                image.set_exception(AutodriveError(CLOSED))
                return image
            before = self._pending.get(client)
            if before is not None and not before.image.cancelled():
                image = before.image
            self._pending[client] = PendingImage(view, frame, image)
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="autodrive-scene", daemon=True)
                self._thread.start()
            self._changed.notify()
        return image

    def forget(self, client: int) -> None:
        """That client has left or draws itself; its waiting image fails."""
        with self._changed:
            self._cameras.pop(client, None)
            pending = self._pending.pop(client, None)
        if pending is not None:
            _fail(pending, "the client has left")

    @property
    def error(self) -> str:
        """Why there are no images; empty if there are, or if none was requested yet."""
        return self._error

    @property
    def renderer(self) -> str:
        """OpenGL renderer; empty before the first image."""
        return self._renderer

    @property
    def pid(self) -> int:
        """Process identifier of the worker; 0 if there is none."""
        worker = self._worker
        return worker.pid if worker else 0

    def close(self) -> None:
        """End the worker; images that are waiting or being drawn fail."""
        with self._changed:
            self._is_closed = True
            if self._worker is not None:
                self._worker.kill()  # it has no state that could be lost
            self._changed.notify()
            thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(SHUTDOWN_TIME)

    # -- in a thread of its own: one request, one image -------------------------------------------------------------

    def _run(self) -> None:
        while (turn := self._next()) is not None:
            client, pending = turn
            if not pending.image.set_running_or_notify_cancel():
                continue
            try:
                pending.image.set_result(self._draw(client, pending))
            except Exception as error:
                self._end_worker()
                if not isinstance(error, AutodriveError):
                    log.exception("the scene camera cannot be drawn")
                    error = AutodriveError(f"the scene camera cannot be drawn: {error}")
                pending.image.set_exception(error)
        self._end_worker()
        with self._changed:
            left, self._pending = list(self._pending.values()), {}
        for pending in left:
            _fail(pending, CLOSED)

    def _next(self) -> tuple[int, PendingImage] | None:
        """The client that has waited longest, and its image; None after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._pending or self._is_closed)
            if self._is_closed:
                return None
            client = next(iter(self._pending))
            return client, self._pending.pop(client)

    def _draw(self, client: int, pending: PendingImage) -> bytes:
        """Raises `AutodriveError` if no worker can draw."""
        self.check(pending.view)
        with self._changed:
            camera = self._cameras.setdefault(client, SceneCamera(self._contents.vehicles))
        viewpoint = camera.viewpoint(pending.view, pending.frame, self._clock())
        state = RenderState.of(pending.frame).data.tobytes()
        request = DrawScene(state, viewpoint, *image_size(pending.view.width))
        while True:
            try:
                return self._drawn_by(self._worker or self._start_worker(), request)
            except _WorkerDiedError:
                self._end_worker()

    def _drawn_by(self, worker: Worker[SceneMessage], request: DrawScene) -> bytes:
        worker.send(request)
        message = self._receive(worker)
        if not isinstance(message, DrawnScene):
            raise AutodriveError("the scene camera cannot be drawn: its process sent an unexpected message")
        return message.jpeg

    def _start_worker(self) -> Worker[SceneMessage]:
        """A worker that can draw."""
        with self._changed:
            if self._is_closed:
                raise AutodriveError(CLOSED)
            try:
                self._worker = worker = Worker("autodrive.graphics.cameras.scene_worker", messages=SceneMessage)
            except OSError as error:
                raise self._unavailable(f"scene cameras cannot be drawn: no process starts: {error.strerror}") from None
        worker.send_setup(self._contents)
        ready = self._receive(worker)
        if isinstance(ready, Ready):
            self._renderer, self._error = ready.renderer, ""
        return worker

    def _receive(self, worker: Worker[SceneMessage]) -> SceneMessage:
        """Raises `_WorkerDiedError` if another worker can be started, `AutodriveError` if nothing can be drawn."""
        message = worker.receive()
        if isinstance(message, Failed):
            raise self._unavailable(message.reason)
        if message is not None:
            return message
        status = worker.exit_status()
        if self._is_closed:
            raise AutodriveError(CLOSED)
        if self._restarts == RESTARTS:
            times = f"{RESTARTS + 1} times, now with {status}"
            raise self._unavailable(f"scene cameras are unavailable: their process ended unexpectedly {times}")
        self._restarts += 1
        text = "the process of the scene cameras ended unexpectedly (%s); it is started again (%d of %d)"
        log.warning(text, status, self._restarts, RESTARTS)
        raise _WorkerDiedError

    def _unavailable(self, reason: str) -> AutodriveError:
        """The error of every image from now on."""
        if not self._is_closed:
            self._error, self._is_unavailable = reason, True
            log.warning("%s", reason)
        return AutodriveError(reason)

    def _end_worker(self) -> None:
        with self._changed:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()

    def _check_frame(self, frame: Frame) -> None:
        contents = self._contents
        if list(frame.vehicles) != list(contents.vehicles) or len(frame.objects) != len(contents.boxes):
            raise AutodriveError("the Frame belongs to another world than the scene cameras")


class _WorkerDiedError(Exception):
    """Another worker can be started."""


def _fail(pending: PendingImage, reason: str) -> None:
    if pending.image.set_running_or_notify_cancel():
        pending.image.set_exception(AutodriveError(reason))
