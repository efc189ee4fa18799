"""Renders cameras inside the tick, for lock-step: image time is Frame time, and runs are reproducible."""

from __future__ import annotations

import weakref
from typing import Any

from autodrive.graphics.cameras.backend import with_images
from autodrive.graphics.cameras.rig import CameraArray, CameraRig
from autodrive.graphics.render.gl import probe
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.messages import CameraImage, Frame


class TickCameras:
    """A camera backend that draws the state of exactly the Frame that it updates: the same bytes in each run.

    Raises `GlUnavailable` at once if there are cameras and no OpenGL to draw them with.
    """

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self._array = CameraArray(rig)
        self._latest: dict[tuple[str, str], CameraImage] = {}
        self._renderer: Renderer | None = None
        if rig.slots:
            probe()

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        """The Frame with the latest image of every camera; images that are due are drawn now."""
        due = range(len(self._rig.slots)) if redraw else self._array.due(frame.tick)
        if due:
            images = self._array.capture(self._started_renderer(), RenderState.of(frame), frame.tick, due)
            names = [(slot.vehicle, slot.camera) for slot in (self._rig.slots[number] for number in due)]
            self._latest = {**self._latest, **dict(zip(names, images, strict=True))}
        return with_images(frame, self._latest)

    def reset(self, seed: int) -> None:
        """Discard all images; image noise restarts from `seed`."""
        self._latest = {}
        self._array.reset(seed)

    def save(self) -> Any:
        """The latest images and the state of schedules and noise."""
        return self._latest, [camera.save() for camera in self._array.cameras]

    def restore(self, saved: Any) -> None:
        """Continue from a `save`."""
        self._latest, cameras = saved
        for camera, state in zip(self._array.cameras, cameras, strict=True):
            camera.restore(state)

    @property
    def has_pending_images(self) -> bool:
        """False: a Frame comes with its images."""
        return False

    @property
    def is_thread_bound(self) -> bool:
        """True: an OpenGL context belongs to one thread."""
        return True

    def close(self) -> None:
        """Free all graphics memory; the next image would start a new renderer."""
        if self._renderer is not None:
            self._release()
            self._renderer = None

    def _started_renderer(self) -> Renderer:
        if self._renderer is None:
            self._renderer = Renderer(self._rig.scene, self._rig.quality)
            self._release = weakref.finalize(self, self._renderer.release)
        return self._renderer
