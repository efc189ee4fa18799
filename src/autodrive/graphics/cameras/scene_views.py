"""Images of scene cameras for clients that cannot draw themselves, from a separate process."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.overlays import Marks, Overlays
from autodrive.graphics.cameras.render_process import RenderProcess, failed
from autodrive.graphics.cameras.render_worker import Jpeg, RenderResult
from autodrive.graphics.cameras.scene_camera import SceneCamera, check_sensor, check_view, image_size, sensor_view
from autodrive.protocol.native import ViewSensor

if TYPE_CHECKING:
    from autodrive.graphics.cameras.rig import CameraRig, CameraSlot
    from autodrive.protocol.messages import Frame
    from autodrive.protocol.native import SetCamera


class SceneViews:
    """Draws the scene cameras of any number of clients, one image at a time, each client in turn.

    The process starts with the first `draw`. All methods may be called in any thread.
    """

    def __init__(
        self, rig: CameraRig, *, slots: Sequence[CameraSlot] = (), clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`slots`: sensor cameras whose depth and labels can be seen; `clock`: wall time [s] for God's Eye."""
        self._contents = rig.contents
        self._slots = slots
        self._clock = clock
        self._lock = threading.Lock()
        self._cameras: dict[int, tuple[SceneCamera, Overlays]] = {}
        self.process = RenderProcess(rig, "scene cameras")
        """What draws; its `error` says why there are no images."""

    def check(self, view: SetCamera | ViewSensor) -> None:
        """Raises `AutodriveError` if that view cannot be drawn in any Frame."""
        if isinstance(view, ViewSensor):
            check_sensor(view, self._slots)
        else:
            check_view(view, list(self._contents.vehicles))
        if self.process.error:
            raise AutodriveError(self.process.error)

    def draw(
        self, client: int, view: SetCamera | ViewSensor, frame: Frame, marks: Marks | None = None
    ) -> Future[RenderResult]:
        """The JPEG image of that Frame; `client`: a number that identifies the client; `marks`: for its overlays.

        While an image of that client is still waiting, its view and Frame are replaced and the same Future is
        returned. The Future fails with an `AutodriveError` if nothing can be drawn; the call itself never raises.
        """
        try:
            self.check(view)
            self._check_frame(frame)
        except AutodriveError as error:
            return failed(Future(), str(error))
        if isinstance(view, ViewSensor):
            seen = sensor_view(view, check_sensor(view, self._slots), frame)
            return self.process.draw(client, frame, Jpeg(seen, view.content, view.farthest))
        with self._lock:
            new = SceneCamera(self._contents.vehicles), Overlays()
            camera, overlays = self._cameras.setdefault(client, new)
            viewpoint = camera.viewpoint(view, frame, now := self._clock())
            strokes = overlays.strokes(view, frame, marks, now) if marks else None
        return self.process.draw(client, frame, Jpeg(viewpoint.view(*image_size(view.width)), strokes=strokes))

    def forget(self, client: int) -> None:
        """Forget a client that has left or draws itself; its waiting image fails."""
        with self._lock:
            self._cameras.pop(client, None)
        self.process.forget(client)

    def close(self) -> None:
        """End the process; images that are waiting or being drawn fail."""
        self.process.close()

    def _check_frame(self, frame: Frame) -> None:
        contents = self._contents
        if list(frame.vehicles) != list(contents.vehicles) or len(frame.objects) != len(contents.boxes):
            raise AutodriveError("the Frame belongs to another world than the scene cameras")
