"""A closed line of points, with compiled functions: the point at a distance along it, and the nearest point."""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit

BLOCK = 16
"""Segments that one circle encloses."""


class ClosedLine(NamedTuple):
    """A closed line of n segments."""

    points: Floats
    """x, y [m], shape (n + 1, 2); the last point is the first one."""
    along: Floats
    """Distance of each point from the first one along the line [m], shape (n + 1,)."""
    circles: Floats
    """x, y and radius of a circle around each `BLOCK` successive segments [m]."""


def closed_line(points: Floats) -> ClosedLine:
    """The closed line through points, shape (n, 2), which does not repeat the first one."""
    closed = np.ascontiguousarray(np.vstack([points, points[:1]]))
    steps = np.diff(closed, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.sqrt(np.sum(steps * steps, axis=1)))])
    circles = []
    for first in range(0, len(points), BLOCK):
        block = closed[first : first + BLOCK + 1]
        middle = (block.min(axis=0) + block.max(axis=0)) / 2.0
        circles.append((*middle, np.sqrt(np.sum((block - middle) ** 2, axis=1).max())))
    return ClosedLine(closed, along, np.array(circles))


@jit
def point_on_line(line: ClosedLine, s: float) -> tuple[float, float, float, float]:
    """x, y [m] of the point at the distance s [m] along a closed line, and the unit vector of its segment."""
    points, along, _ = line
    n = len(along) - 1
    s -= along[n] * np.floor(s / along[n])
    i = min(max(np.searchsorted(along, s, side="right") - 1, 0), n - 1)
    length = along[i + 1] - along[i]
    dx, dy = (points[i + 1, 0] - points[i, 0]) / length, (points[i + 1, 1] - points[i, 1]) / length
    ahead = s - along[i]
    return points[i, 0] + ahead * dx, points[i, 1] + ahead * dy, dx, dy


@jit
def nearest_on_line(line: ClosedLine, x: float, y: float) -> tuple[float, float]:
    """Distance [m] along a closed line of the point nearest to x, y, and the distance of x, y to the left of it [m].

    The distance along is from 0 up to, but not including, the length. Blocks of segments whose circle is farther away
    than the nearest point so far are left out.
    """
    points, along, circles = line
    n = len(along) - 1
    best, s, side = inf, 0.0, 1.0
    nearest, start = inf, 0
    for b in range(len(circles)):
        dx, dy = circles[b, 0] - x, circles[b, 1] - y
        away = dx * dx + dy * dy
        if away < nearest:
            nearest, start = away, b
    for turn in range(len(circles)):
        b = (start + turn) % len(circles)
        dx, dy = circles[b, 0] - x, circles[b, 1] - y
        if sqrt(dx * dx + dy * dy) - circles[b, 2] > sqrt(best):
            continue
        for i in range(b * BLOCK, min(b * BLOCK + BLOCK, n)):
            ax, ay = points[i, 0], points[i, 1]
            dx, dy = points[i + 1, 0] - ax, points[i + 1, 1] - ay
            px, py = x - ax, y - ay
            length = along[i + 1] - along[i]
            f = min(1.0, max(0.0, (px * dx + py * dy) / (length * length)))
            ex, ey = px - f * dx, py - f * dy
            distance = ex * ex + ey * ey
            if distance < best:
                best, s = distance, along[i] + f * length
                side = 1.0 if dx * py >= dy * px else -1.0
    return (0.0 if s >= along[n] else s), side * sqrt(best)
