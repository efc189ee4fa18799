"""Draws the strips on the ground of a scene into an image of their own, which the shader of the ground reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from autodrive.graphics.assets.asset import STRIP
from autodrive.graphics.render.gl import moderngl, source, write
from autodrive.graphics.render.parts import Parts

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.graphics.assets.asset import Strips

PART_SIZE = 0.5
"""Strips are drawn in parts of about that size, those in sight only [m]."""
MARGIN = 0.05
"""How much larger a part is, because strips are drawn wider than they are [m]."""


class GroundStrips:
    """Paint and shade of each pixel of a view, from the `Strips` of an asset."""

    def __init__(self, context: moderngl.Context, strips: Strips) -> None:
        self._program = context.program(source("strip.vert"), source("strip.frag"))
        block = self._program["Camera"]
        assert isinstance(block, moderngl.UniformBlock)
        block.binding = 1
        fields = [(name, int(np.prod(STRIP[name].shape))) for name in STRIP.names or ()]
        own = strips.triangles
        corners = np.zeros((len(own), 3, 3))
        corners[..., :2] = strips.vertices["place"][own]
        none = np.zeros(len(own), np.intp)
        parts = Parts.of_triangles(own, corners, none, none, PART_SIZE)
        self._parts = parts._replace(radius=parts.radius + MARGIN)
        self._indices = context.buffer(reserve=max(own.nbytes, 4), dynamic=True)
        layout = " ".join(f"{n}f" for _, n in fields)
        content = (context.buffer(strips.vertices.tobytes()), layout, *(name for name, _ in fields))
        self._array = context.vertex_array(self._program, [content], self._indices)

    def draw(self, clip: Floats, width: int, height: int) -> None:
        """Add what the camera of the uniform block sees to the image of the ground.

        `clip`: its clip space from map axes, shape (4, 4); `width`, `height`: of the image [pixels].
        """
        seen = self._parts.indices_of(self._parts.in_sight(clip))
        if len(seen) == 0:
            return
        self._indices.orphan()
        self._indices.write(seen.tobytes())
        write(self._program, "half_size", np.array([0.5 * width, 0.5 * height], np.float32).tobytes())
        self._array.render(moderngl.TRIANGLES, len(seen))
