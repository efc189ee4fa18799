"""Draws the strips on the ground of a scene into an image of their own, which the shader of the ground reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from autodrive.graphics.assets.asset import STRIP
from autodrive.graphics.render.gl import moderngl, source, write

if TYPE_CHECKING:
    from autodrive.graphics.assets.asset import Strips


class GroundStrips:
    """Paint and shade of each pixel of a view, from the `Strips` of an asset."""

    def __init__(self, context: moderngl.Context, strips: Strips) -> None:
        self._context = context
        self._program = context.program(source("strip.vert"), source("strip.frag"))
        block = self._program["Camera"]
        assert isinstance(block, moderngl.UniformBlock)
        block.binding = 1
        fields = [(name, int(np.prod(STRIP[name].shape))) for name in STRIP.names or ()]
        self._array = context.vertex_array(
            self._program,
            [
                (
                    context.buffer(strips.vertices.tobytes()),
                    " ".join(f"{n}f" for _, n in fields),
                    *(f for f, _ in fields),
                )
            ],
            context.buffer(strips.triangles.tobytes()),
        )

    def target(self, width: int, height: int) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        """A texture for paint and shade of an image of that size, and what draws into it."""
        texture = self._context.texture((width, height), 4)  # llvmpipe reads other formats slowly
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return texture, self._context.framebuffer([texture])

    def draw(self, frame: moderngl.Framebuffer) -> None:
        """Draw what the camera of the uniform block sees."""
        context = self._context
        frame.use()
        frame.clear()
        write(self._program, "half_size", (0.5 * np.array(frame.size, np.float32)).tobytes())
        context.disable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        self._array.render(moderngl.TRIANGLES)
        context.disable(moderngl.BLEND)
        context.enable(moderngl.CULL_FACE | moderngl.DEPTH_TEST)
