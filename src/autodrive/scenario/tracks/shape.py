"""Geometry of closed lines: resampling, curvature, simplification, crossings, and the walls along a centre line."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit
from autodrive.scenario.tracks.line import closed_line

WALL_TOLERANCE = 0.003
"""Largest distance of a wall from the edge of its centre line [m]."""
MAX_CROSSINGS = 10
"""Places at which a line crosses itself that are looked for."""


def resampled(points: Floats, spacing: float) -> Floats:
    """Points on a closed line at equal distances of about `spacing` [m], from its first point on."""
    line = closed_line(points)
    length = float(line.along[-1])
    count = max(3, round(length / spacing))
    at: Floats = np.arange(count, dtype=np.float64) * (length / count)
    return _on_line(line.points, line.along, at)


@jit
def _on_line(points: Floats, along: Floats, at: Floats) -> Floats:
    """Points at ascending distances along a line, shape (len(at), 2)."""
    places = np.empty((len(at), 2))
    i = 0
    for k in range(len(at)):
        while i < len(along) - 2 and along[i + 1] <= at[k]:
            i += 1
        f = (at[k] - along[i]) / (along[i + 1] - along[i])
        places[k, 0] = points[i, 0] + f * (points[i + 1, 0] - points[i, 0])
        places[k, 1] = points[i, 1] + f * (points[i + 1, 1] - points[i, 1])
    return places


def curvature(points: Floats) -> Floats:
    """Curvature of a closed line at each point [1/m], left positive: that of the circle through its neighbours."""
    a, c = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    u, v, w = points - a, c - points, c - a
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    lengths = [np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]) for d in (u, v, w)]
    return 2.0 * cross / (lengths[0] * lengths[1] * lengths[2])


def straightest(points: Floats, spacing: float) -> int:
    """The point of a closed line from which it bends least over 2 m before and 4 m after it."""
    bend = np.abs(curvature(points))
    total = np.zeros(len(points))
    for shift in range(-round(2.0 / spacing), round(4.0 / spacing) + 1):
        total += np.roll(bend, -shift)
    return int(np.argmin(total))


def steps(points: Floats) -> Floats:
    """Distance of each point of a closed line to the next one [m]."""
    return np.hypot(*(np.roll(points, -1, axis=0) - points).T)


def ahead(points: Floats) -> Floats:
    """Vector from the point before to the point after each point of a closed line [m], shape (n, 2)."""
    return np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)


def heading(points: Floats) -> Floats:
    """Direction of a closed line at each point [rad], from 0 to 2 pi."""
    x, y = ahead(points).T
    return np.arctan2(y, x) % (2.0 * np.pi)


def edges_of(centre_line: Floats) -> tuple[Floats, Floats]:
    """Right and left edge: the points of a centre line, shape (n, 4), moved by its widths, shape (n, 2) each."""
    points, x, y = centre_line[:, :2], *ahead(centre_line[:, :2]).T
    left = np.column_stack([-y, x]) / np.sqrt(x * x + y * y)[:, None]
    return points - centre_line[:, 2:3] * left, points + centre_line[:, 3:4] * left


def walls_along(centre_line: Floats, tolerance: float = WALL_TOLERANCE) -> tuple[Floats, Floats]:
    """The walls at the left and the right edge of a centre line, shape (n, 4); the track is on their left side."""
    right_edge, left_edge = edges_of(centre_line)
    return simplified(left_edge[::-1], tolerance), simplified(right_edge, tolerance)


def simplified(points: Floats, tolerance: float) -> Floats:
    """Some of the points of a closed line, so that no other point is farther than `tolerance` [m] from the new line."""
    kept = _kept(np.ascontiguousarray(np.vstack([points, points[:1]])), tolerance)
    return np.round(points[kept[:-1]], 4)


@jit
def _kept(points: Floats, tolerance: float) -> Integers:
    """Indices of the points that stay: each chord is as long as possible."""
    n = len(points)
    kept = np.empty(n, np.int64)
    kept[0], count, i = 0, 1, 0
    while i < n - 1:
        j = i + 1
        while j + 1 < n and j - i < 200:
            dx, dy = points[j + 1, 0] - points[i, 0], points[j + 1, 1] - points[i, 1]
            length = np.sqrt(dx * dx + dy * dy)
            fits = length > 1e-9
            for k in range(i + 1, j + 1):
                px, py = points[k, 0] - points[i, 0], points[k, 1] - points[i, 1]
                along = px * dx + py * dy
                if abs(px * dy - py * dx) > tolerance * length or along < 0.0 or along > length * length:
                    fits = False
                    break
            if not fits:
                break
            j += 1
        kept[count] = j
        count += 1
        i = j
    return kept[:count]


def crossings(walls: tuple[Floats, ...]) -> list[tuple[float, float]]:
    """Where closed lines cross or touch themselves or each other: x, y [m], a few places of each."""
    rings: Any = np.array([shapely.LinearRing(wall) for wall in walls], dtype=object)
    places = [place for ring in rings if not ring.is_simple for place in _self_crossings(ring)]
    pairs = shapely.STRtree(rings).query(rings, predicate="intersects").T.tolist()
    for ring, other in sorted(pair for pair in pairs if pair[0] < pair[1]):
        common = shapely.intersection(rings[ring], rings[other])
        places.append(tuple(shapely.get_coordinates(common)[0].tolist()))
    return list(dict.fromkeys(places))


def _self_crossings(ring: shapely.LinearRing) -> list[tuple[float, float]]:
    """Where a line crosses itself, at most `MAX_CROSSINGS` places: points that repeat cross millions of times."""
    points = shapely.get_coordinates(ring)
    segments: Any = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
    first, second = shapely.STRtree(segments).query(segments, predicate="intersects")
    n = len(segments)
    apart = (second - first) % n
    pairs = np.flatnonzero((first < second) & (apart != 1) & (apart != n - 1))[:MAX_CROSSINGS]
    common = shapely.intersection(segments[first[pairs]], segments[second[pairs]])
    places = shapely.get_coordinates(shapely.centroid(common))
    return [(float(x), float(y)) for x, y in places]
