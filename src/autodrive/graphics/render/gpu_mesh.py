"""The triangles of an asset in graphics memory."""

from __future__ import annotations

from copy import copy

import numpy as np

from autodrive.graphics.render.gl import moderngl
from autodrive.graphics.render.scene import VERTEX, Geometry

_FIELDS = [(name, int(np.prod(VERTEX[name].shape))) for name in VERTEX.names or ()]


class GpuMesh:
    """Vertices and indices of an asset, drawn with any shader program."""

    def __init__(self, context: moderngl.Context, own: Geometry) -> None:
        self.geometry = own
        self._context = context
        self._is_empty = len(own.indices) == 0
        if not self._is_empty:
            self._vertices = context.buffer(own.vertices.tobytes())
            self._indices = context.buffer(own.indices.tobytes())
        self.radius = max((float(np.linalg.norm(r.center)) + r.radius for r in own.ranges), default=0.0)
        """Radius of a sphere around the origin of the asset that contains it [m]."""
        self._arrays: dict[int, moderngl.VertexArray] = {}

    def with_indices(self, indices: moderngl.Buffer) -> GpuMesh:
        """A mesh of the same vertices with other triangles: uint32 in a buffer that the caller fills.

        `geometry` is unchanged.
        """
        other = copy(self)
        other._indices, other._arrays = indices, {}
        return other

    def draw(self, program: moderngl.Program, first: int = 0, count: int = -1) -> None:
        """Draw `count` indices from `first` (-1: all) with a program whose uniforms are set."""
        if self._is_empty:
            return
        array = self._arrays.get(program.glo)
        if array is None:
            used = [name for name, _ in _FIELDS if name in program]
            layout = " ".join(f"{width}f" if name in used else f"{4 * width}x" for name, width in _FIELDS)
            array = self._context.vertex_array(program, [(self._vertices, layout, *used)], self._indices)
            self._arrays[program.glo] = array
        array.render(moderngl.TRIANGLES, vertices=count, first=first)
