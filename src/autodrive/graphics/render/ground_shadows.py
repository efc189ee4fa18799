"""Draws the shadows of static meshes and objects on the ground into the image that the shader of the ground reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from autodrive.graphics.render.gl import moderngl
from autodrive.graphics.render.parts import in_sight, sight_planes

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from autodrive.base.arrays import Floats


class GroundShadows:
    """Triangles of the ground where such a shadow can be; the shadow map says where it is."""

    def __init__(self, context: moderngl.Context, program: moderngl.Program) -> None:
        self._buffer = context.buffer(reserve=24, dynamic=True)
        self._array = context.vertex_array(program, [(self._buffer, "2f", "place")])
        self._shades: tuple[BaseGeometry, ...] = ()
        self._corners = np.zeros((0, 3, 2))
        """Corners of the triangles [m], shape (n, 3, 2)."""
        self._middles, self._radii = np.zeros((0, 3)), np.zeros(0)

    def draw(self, shades: tuple[BaseGeometry, ...], clip: Floats) -> None:
        """Add the shadows in these areas (`Shadows.shades`) that a view sees. `clip`: its clip space from map axes."""
        if shades is not self._shades:
            self._set(shades)
        seen = in_sight(sight_planes(clip), self._middles, self._radii)
        corners = self._corners[seen].astype(np.float32)
        if len(corners):
            self._buffer.orphan(corners.nbytes)
            self._buffer.write(corners.tobytes())
            self._array.render(moderngl.TRIANGLES, 3 * len(corners))

    def _set(self, shades: tuple[BaseGeometry, ...]) -> None:
        self._shades = shades
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(np.array(shades, object)))
        self._corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
        level = self._corners.mean(1)
        self._middles = np.column_stack([level, np.zeros(len(level))])
        self._radii = np.linalg.norm(self._corners - level[:, None], axis=-1).max(1, initial=0.0)
