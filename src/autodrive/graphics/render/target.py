"""Render targets: where an image is drawn, antialiased and read back."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from autodrive.graphics.render.fxaa import smoothed

if TYPE_CHECKING:
    import moderngl
    from numpy.typing import NDArray

    from autodrive.graphics.render.quality import Antialiasing

SAMPLES = 4


class RenderTarget:
    """An image: draw between `begin` and `finish`, then `read`.

    Each view has its own target: llvmpipe draws one while the next is prepared.
    """

    def __init__(self, context: moderngl.Context, width: int, height: int, antialiasing: Antialiasing) -> None:
        size = width, height
        self._context, self._size, self._antialiasing = context, size, antialiasing
        self._plain = context.framebuffer([context.renderbuffer(size, 4)], context.depth_renderbuffer(size))
        self._frame = self._plain
        if antialiasing == "msaa":
            many = context.renderbuffer(size, 4, samples=SAMPLES), context.depth_renderbuffer(size, samples=SAMPLES)
            self._frame = context.framebuffer([many[0]], many[1])

    def begin(self) -> None:
        """Clear this target and draw to it from now on."""
        self._frame.use()
        self._frame.clear(depth=1.0)

    def finish(self) -> None:
        """Average the samples of each pixel, if there are several."""
        if self._antialiasing == "msaa":
            self._context.copy_framebuffer(self._plain, self._frame)

    def read(self) -> NDArray[np.uint8]:
        """The finished image, shape (height, width, 4)."""
        width, height = self._size
        pixels = np.empty((height, width, 4), np.uint8)
        self._plain.read_into(pixels, components=4)
        return smoothed(pixels) if self._antialiasing == "fxaa" else pixels

    def read_rgb_into(self, pixels: moderngl.Buffer, offset: int) -> None:
        """Copy the image to a buffer, from that byte on: rows of 3 bytes a pixel, without FXAA and a wait on a GPU."""
        self._plain.read_into(pixels, components=3, alignment=1, write_offset=offset)


class ExactImage(NamedTuple):
    """What is at the centre of each pixel, without antialiasing; shape (height, width) each."""

    depth: NDArray[np.float32]
    """[m]; infinite where nothing was drawn."""
    labels: NDArray[np.uint8]
    instances: NDArray[np.uint16]
    """Instance numbers; 0: none."""


class ExactTarget:
    """Where an `ExactImage` is drawn."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        self._size = size = width, height
        layers = context.texture(size, 1), context.texture(size, 2, dtype="f4")
        self._frame = context.framebuffer(layers, context.depth_renderbuffer(size))

    def begin(self) -> None:
        """Clear this target and draw to it from now on."""
        self._frame.use()
        self._frame.clear(depth=1.0)

    def read(self) -> ExactImage:
        """The image that was drawn."""
        width, height = self._size
        labels, others = np.empty((height, width), np.uint8), np.empty((height, width, 2), np.float32)
        self._frame.read_into(labels, components=1, alignment=1)
        self._frame.read_into(others, components=2, attachment=1, dtype="f4")
        depth = np.where(others[..., 0] > 0.0, others[..., 0], np.float32(np.inf))
        return ExactImage(depth, labels, others[..., 1].astype(np.uint16))
