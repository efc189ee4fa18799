"""Where pictures are drawn, smoothed and read back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from autodrive.render.gl import source

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.render.quality import Antialiasing

SAMPLES = 4


class Target:
    """`count` pictures of one size, one above the other, so that they are read back at once."""

    def __init__(
        self, context: moderngl.Context, width: int, height: int, count: int, antialiasing: Antialiasing
    ) -> None:
        size = width, height * count
        self.width, self.height, self.count = width, height, count
        self._context = context
        self._color = context.texture(size, 4)
        self._color.repeat_x = self._color.repeat_y = False
        self._plain = context.framebuffer([self._color], context.depth_renderbuffer(size))
        self._last = self.frame = self._plain
        if antialiasing == "msaa":
            many = context.renderbuffer(size, 4, samples=SAMPLES), context.depth_renderbuffer(size, samples=SAMPLES)
            self.frame = context.framebuffer([many[0]], many[1])
        if antialiasing == "fxaa":
            self._smooth = context.program(source("corner.vert"), source("fxaa.frag"))
            self._smooth["texel"] = 1.0 / size[0], 1.0 / size[1]
            self._corners = context.vertex_array(self._smooth, [])
            self._last = context.framebuffer([context.renderbuffer(size, 4)])
        self._antialiasing = antialiasing

    def begin(self, number: int) -> None:
        """Draw the picture of that number from now on."""
        if number == 0:
            self.frame.viewport = (0, 0, self.width, self.height * self.count)
            self.frame.use()
            self.frame.clear(depth=1.0)
        self.frame.viewport = (0, number * self.height, self.width, self.height)

    def read(self) -> NDArray[np.uint8]:
        """The finished pictures, shape (count, height, width, 4)."""
        whole = (0, 0, self.width, self.height * self.count)
        if self._antialiasing == "msaa":
            self._plain.viewport = self.frame.viewport = whole
            self._context.copy_framebuffer(self._plain, self.frame)
        if self._antialiasing == "fxaa":
            self._context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
            self._last.use()
            self._color.use(0)
            self._corners.render(moderngl.TRIANGLES, 3)
            self._context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        pixels = np.empty((self.count, self.height, self.width, 4), np.uint8)
        self._last.read_into(pixels, viewport=whole, components=4)
        return pixels


class ExactTarget:
    """Likewise for depths and labels, which are of the middle of each pixel and never smoothed."""

    def __init__(self, context: moderngl.Context, width: int, height: int, count: int) -> None:
        size = width, height * count
        self.width, self.height, self.count = width, height, count
        self._depth = context.depth_texture(size)
        self.frame = context.framebuffer([context.texture(size, 1)], self._depth)

    begin = Target.begin

    def read(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Depths in [0, 1] of clip space and labels, shape (count, height, width) each."""
        shape = self.count, self.height, self.width
        depth, labels = np.empty(shape, np.float32), np.empty(shape, np.uint8)
        self._depth.read_into(depth)
        self.frame.read_into(labels, viewport=(0, 0, self.width, self.height * self.count), components=1)
        return depth, labels
