"""Computes the line in the middle between the walls of a track."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.scenario.tracks.shape import resampled, straightest

SPACING = 0.1
"""Distance of the points of the line [m]; more on a track that is longer than 1 km."""
MAX_POINTS = 20_000
"""Most points on all walls, for the computation."""


def middle_line(walls: tuple[Floats, ...]) -> Floats:
    """The line between the outer wall, which is the first, and the inner one: x, y, distance to both, shape (n, 4).

    It is counter-clockwise and starts where it is straight. It consists of those borders of the Voronoi cells of points
    on the walls that have a point of the outer and one of the inner wall next to them. Islands belong to the wall that
    they are nearer to, so that the line leads past them where there is more room. Raises `SpecError`.
    """
    inner_number = inner_wall(walls)
    rings = [shapely.LinearRing(wall) for wall in walls]
    spacing = max(SPACING, sum(ring.length for ring in rings) / MAX_POINTS)
    sides = outer, inner = [shapely.MultiLineString(lines) for lines in _sides(rings, inner_number)]
    outer_points, inner_points = (shapely.MultiPoint(_points(shapely.segmentize(side, spacing))) for side in sides)
    borders = shapely.voronoi_polygons(shapely.union(outer_points, inner_points), only_edges=True)
    corners, border = shapely.get_coordinates(shapely.get_parts(borders), return_index=True)
    is_segment = border[1:] == border[:-1]
    segments = np.stack([corners[:-1], corners[1:]], axis=1)[is_segment]
    parts: Any = shapely.linestrings(segments)  # an array of them
    ends = shapely.points(shapely.get_coordinates(parts))
    outer_away, inner_away = (
        shapely.STRtree(shapely.get_parts(points)).query_nearest(ends, return_distance=True, all_matches=False)[1]
        for points in (outer_points, inner_points)
    )
    is_middle = (np.abs(outer_away - inner_away) < 1e-6).reshape(-1, 2).all(axis=1)
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(shapely.node(shapely.union_all(parts[is_middle])))))
    if not len(faces):
        raise SpecError(["no middle line was found between the walls; give a centre line"])
    area = max(shapely.get_parts(shapely.union_all(faces)), key=lambda part: part.area)
    points = shapely.get_coordinates(area.exterior)[:-1]
    if not area.exterior.is_ccw:
        points = points[::-1]
    points = resampled(points, spacing)
    for _ in range(10):
        points = (np.roll(points, 1, axis=0) + 2.0 * points + np.roll(points, -1, axis=0)) / 4.0
    points = np.roll(points, -straightest(points, spacing), axis=0)
    places = shapely.points(points)
    return np.column_stack([points, shapely.distance(outer, places), shapely.distance(inner, places)])


def inner_wall(walls: tuple[Floats, ...]) -> int:
    """Which one of the walls inside of the outer one, which is the first, is around most."""
    return max(range(1, len(walls)), key=lambda number: shapely.LinearRing(walls[number]).convex_hull.area)


def _points(lines: BaseGeometry) -> Floats:
    return np.unique(shapely.get_coordinates(lines), axis=0)


def _sides(rings: list[shapely.LinearRing], inner: int) -> tuple[list[shapely.LinearRing], list[shapely.LinearRing]]:
    """The lines of the outer and of the inner wall, with the islands.

    The island that is nearest to a wall, or to islands that belong to it, is the next one that belongs to it (Prim's
    algorithm): so the narrowest place of the way between both sides is as wide as possible.
    """
    islands: Any = np.array([ring for number, ring in enumerate(rings) if number not in (0, inner)], dtype=object)
    sides = [rings[0]], [rings[inner]]
    away = np.stack([shapely.distance(islands, side[0]) for side in sides]) if len(islands) else np.empty((2, 0))
    is_free = np.full(len(islands), True)
    while is_free.any():
        side, nearest = np.unravel_index(np.argmin(np.where(is_free, away, np.inf)), away.shape)
        sides[side].append(islands[nearest])
        is_free[nearest] = False
        away[side] = np.minimum(away[side], shapely.distance(islands, islands[nearest]))
    return sides
