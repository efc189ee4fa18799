"""Grows a closed loop of points inside a rectangle until it has the wanted length, without crossings or sharp bends.

Position-based dynamics (Müller et al. 2007): in each sweep, every constraint moves its points until it holds. Sums
have a fixed order and only + - * / and square roots occur, so that the bits are the same on every processor.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit


@jit
def grow(
    points: Floats, kicks: Floats, size_x: float, size_y: float, step: float, gap: float, radius: float, sweeps: int
) -> None:
    """Moves the points of a closed loop, shape (n, 2), until neighbours are `step` [m] apart.

    The loop stays between 0 and `size_x`, `size_y` [m]; parts of it that are not neighbours stay `gap` [m] apart, and
    its bends are not tighter than `radius` [m]. `kicks`: a direction for each point, shape (n, 2), in which it is
    moved during the first half of the growth.
    """
    n = points.shape[0]
    length = 0.0
    for i in range(n):
        j = (i + 1) % n
        length += sqrt((points[j, 0] - points[i, 0]) ** 2 + (points[j, 1] - points[i, 1]) ** 2)
    first = length / n
    before = np.empty_like(points)
    for sweep in range(sweeps):
        grown = min(1.0, sweep / (0.7 * sweeps))
        rest = first + grown * (step - first)
        if grown < 0.5:
            for i in range(n):
                points[i, 0] += 0.02 * kicks[i, 0]
                points[i, 1] += 0.02 * kicks[i, 1]
        for stride in (3, 2, 1, 1):
            _straighten(points, before, stride, 0.02)
        for _ in range(2):
            for i in range(n):
                _move_apart(points, i, (i + 1) % n, rest, 0.5)
            for i in range(n - 1, -1, -1):
                _move_apart(points, i, (i + 1) % n, rest, 0.5)
        _separate(points, rest, gap)
        _bend(points, rest, radius)
        for i in range(n):
            _keep_inside(points, i, size_x, size_y, radius)
        for _ in range(1 if sweep < 0.9 * sweeps else 4):
            _bend(points, rest, radius)


@jit
def _keep_inside(points: Floats, i: int, size_x: float, size_y: float, radius: float) -> None:
    """Moves a point into the rectangle, whose corners are round."""
    x, y = min(max(points[i, 0], 0.0), size_x), min(max(points[i, 1], 0.0), size_y)
    cx, cy = min(max(x, radius), size_x - radius), min(max(y, radius), size_y - radius)
    dx, dy = x - cx, y - cy
    distance = sqrt(dx * dx + dy * dy)
    if distance > radius:
        x, y = cx + dx / distance * radius, cy + dy / distance * radius
    points[i, 0], points[i, 1] = x, y


@jit
def _straighten(points: Floats, before: Floats, stride: int, stiffness: float) -> None:
    """Moves each point as an elastic rod would move it; `before` is working memory of the same shape."""
    n = points.shape[0]
    before[:] = points
    for i in range(n):
        for axis in range(2):
            bend = (
                6.0 * before[i, axis]
                - 4.0 * (before[(i - stride) % n, axis] + before[(i + stride) % n, axis])
                + (before[(i - 2 * stride) % n, axis] + before[(i + 2 * stride) % n, axis])
            )
            points[i, axis] -= stiffness * bend


@jit
def _bend(points: Floats, step: float, radius: float) -> None:
    """Points that are k steps before and after a point are at least as far apart as on a circle of that radius."""
    n = points.shape[0]
    k = 1
    while k <= 8 and k * step <= 1.5 * radius:
        # 2 R sin(k h / R) by its series, which is exact to 1e-3 up to 1.5
        a = k * step / radius
        chord = 2.0 * radius * a * (1.0 - a * a / 6.0 * (1.0 - a * a / 20.0 * (1.0 - a * a / 42.0)))
        for i in range(n):
            _move_apart(points, (i - k) % n, (i + k) % n, chord, 0.4)
        k += 1


@jit
def _separate(points: Floats, step: float, gap: float) -> None:
    """Points that are farther along the loop than half a circle of that diameter are at least `gap` apart."""
    n = points.shape[0]
    apart = int(1.6 * gap / step) + 1
    for i in range(n):
        for j in range(i + apart, min(n, i + n - apart + 1)):
            dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            if dx * dx + dy * dy < gap * gap:
                _move_apart(points, i, j, gap, 0.5)


@jit
def _move_apart(points: Floats, i: int, j: int, least: float, share: float) -> None:
    """Moves both points so that their distance becomes at least `least`, or, for neighbours, exactly that."""
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    distance = sqrt(dx * dx + dy * dy)
    n = points.shape[0]
    if (distance >= least and (j - i) % n != 1) or distance < 1e-9:
        return
    correction = share * (least - distance) / distance
    points[i, 0] -= correction * dx
    points[i, 1] -= correction * dy
    points[j, 0] += correction * dx
    points[j, 1] += correction * dy
