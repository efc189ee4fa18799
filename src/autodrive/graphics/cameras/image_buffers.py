"""Layout of the memory shared with the camera worker: a render state and the images of each camera."""

from __future__ import annotations

import mmap
from typing import Any, NamedTuple

import numpy as np

from autodrive.graphics.cameras.rig import CameraRig, CameraSlot
from autodrive.graphics.render.render_state import RenderState


class ImageBuffer(NamedTuple):
    """Where the worker writes what one camera sees; arrays as in `CameraImage`."""

    rgba: np.ndarray
    depth: np.ndarray | None
    labels: np.ndarray | None


class SharedBuffers:
    """Views of shared memory: the state to draw, and one `ImageBuffer` for each camera of the rig."""

    def __init__(self, memory: mmap.mmap, rig: CameraRig) -> None:
        self._memory = memory
        self._used = 0
        vehicles, objects = len(rig.scene.vehicles), len(rig.scene.objects)
        size = len(RenderState.empty(vehicles, objects).data)
        self.state = RenderState.from_buffer(self._array((size,), np.float64), vehicles, objects)
        self.images = [self._image_buffer(slot) for slot in rig.slots]

    @staticmethod
    def size(rig: CameraRig) -> int:
        """Bytes that are enough for that rig."""
        state = RenderState.empty(len(rig.scene.vehicles), len(rig.scene.objects)).data.nbytes
        pixels = [slot.spec.width * slot.spec.height for slot in rig.slots]
        return state + 9 * sum(pixels) + 8 * 3 * len(pixels)  # 4 + 4 + 1 bytes a pixel; three arrays, each aligned

    def _image_buffer(self, slot: CameraSlot) -> ImageBuffer:
        size = slot.spec.height, slot.spec.width
        return ImageBuffer(
            rgba=self._array((*size, 4), np.uint8),
            depth=self._array(size, np.float32) if slot.spec.depth else None,
            labels=self._array(size, np.uint8) if slot.spec.labels else None,
        )

    def _array(self, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        array = np.ndarray(shape, dtype, self._memory, self._used)
        self._used += -(-array.nbytes // 8) * 8  # each array starts at a multiple of 8 bytes
        return array
