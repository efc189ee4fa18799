"""The drivable area as an array of edges, with a compiled test whether a point is inside."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats


def drivable_edges(area: BaseGeometry) -> Floats:
    """x0, y0, x1, y1 of every edge of every ring of a polygon or multipolygon [m], shape (n, 4)."""
    rings = shapely.get_rings(shapely.get_parts(area))
    edges = [np.hstack([ring[:-1], ring[1:]]) for ring in map(shapely.get_coordinates, rings)]
    return np.ascontiguousarray(np.vstack(edges)) if edges else np.empty((0, 4))


def is_inside(edges: Floats, x: float, y: float) -> bool:
    """True if a point is inside the area with these edges (even-odd rule); plain Python that Numba can compile."""
    inside = False
    for i in range(edges.shape[0]):
        x0, y0, x1, y1 = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return inside
