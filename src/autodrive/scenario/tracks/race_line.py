"""Computes a race line: the line of least curvature between the walls, and the fastest speeds on it.

Heilmeier et al., Minimum curvature trajectory planning and control for an autonomous race car (2019): the line is the
centre line plus an offset along its normals; its second differences are linear in the offsets, so that the sum of their
squares is a quadratic function with bounds. The line becomes the new reference, and the step is repeated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.scenario.tracks.line import closed_line
from autodrive.scenario.tracks.shape import ahead, curvature, heading, resampled
from autodrive.scenario.tracks.track import Track

STEP = 0.2
"""Distance of the points of a race line, about [m]."""
UNKNOWNS_MAX = 1500
"""Offsets that one step optimises; a longer track has larger distances between them."""
REPETITIONS = 4


@dataclass(frozen=True)
class CarLimits:
    """What a car can do, for the speeds of a race line; our values for a RoboRacer on polished concrete."""

    speed: float = 8.0
    """[m/s]."""
    lateral: float = 6.0
    """Greatest lateral acceleration [m/s^2]."""
    forward: float = 4.0
    """Greatest acceleration on a straight [m/s^2]; in a bend, the rest of the friction ellipse."""
    braking: float = 5.0
    """Greatest deceleration on a straight [m/s^2]."""
    margin: float = 0.25
    """Least distance of the line, which is that of the middle of the car, from the edges of the track [m]."""


def with_race_line(track: Track, limits: CarLimits | None = None) -> Track:
    """The track with a race line. Raises `SpecError` if the track is too narrow for the margin."""
    return replace(track, race_line=race_line(track, limits or CarLimits()))


def race_line(track: Track, limits: CarLimits) -> Floats:
    """s, x, y, psi, kappa, vx, ax of the line of least curvature, shape (n, 7), from the start line on."""
    narrow = np.flatnonzero(track.centre_line[:, 2:].sum(axis=1) < 2.0 * limits.margin)
    if len(narrow):
        width = float(track.centre_line[narrow[0], 2:].sum())
        raise SpecError(
            [
                f"track '{track.name}' is {width:.3g} m wide at point {narrow[0]}; a race line with a margin of "
                f"{limits.margin:g} m to both edges needs {2.0 * limits.margin:g} m"
            ]
        )
    points = _least_curvature(track, limits.margin)
    points = np.round(resampled(_from_start(points, track), STEP), 4)
    line = closed_line(points)
    kappa = _mean_of_three(curvature(points))
    speed = speeds(np.diff(line.along), kappa, limits)
    acceleration = (np.roll(speed, -1) ** 2 - speed**2) / (2.0 * np.diff(line.along))
    rows = np.column_stack([line.along[:-1], points, heading(points), kappa, speed, acceleration])
    return np.round(rows, 4) + 0.0


def speeds(gaps: Floats, kappa: Floats, limits: CarLimits) -> Floats:
    """The greatest speed at each point [m/s]. `gaps`: distance of each point to the next one [m].

    The lateral acceleration limits the speed in a bend; two passes around the track, forward with the acceleration and
    backward with the deceleration, limit its change.
    """
    n = len(kappa)
    speed = np.minimum(limits.speed, np.sqrt(limits.lateral / np.maximum(np.abs(kappa), 1e-9)))
    for direction, greatest in ((1, limits.forward), (-1, limits.braking)):
        start = int(np.argmin(speed))
        for k in range(2 * n):
            i = (start + direction * k) % n
            j = (i + direction) % n
            share = speed[i] ** 2 * abs(kappa[i]) / limits.lateral
            left = greatest * math.sqrt(max(0.0, 1.0 - share * share))
            step = gaps[i] if direction > 0 else gaps[j]
            speed[j] = min(speed[j], math.sqrt(speed[i] ** 2 + 2.0 * left * step))
    return speed


def _least_curvature(track: Track, margin: float) -> Floats:
    """Points of the line of least curvature between the edges, shape (n, 2)."""
    spacing = max(STEP, track.length / UNKNOWNS_MAX)
    points = resampled(track.centre_line[:, :2], spacing)
    for _ in range(REPETITIONS):
        low, high = _room(points, track, margin)
        x, y = ahead(points).T / np.hypot(*ahead(points).T)
        normals = np.column_stack([-y, x])
        offsets = _least_bend(points, normals, low, high)
        points = resampled(points + offsets[:, None] * normals, spacing)
    return points


def _room(points: Floats, track: Track, margin: float) -> tuple[Floats, Floats]:
    """How far each point may move to the right (negative) and to the left [m]."""
    placed = [track.project(x, y) for x, y in points.tolist()]
    widths = np.array([track.widths_at(s) for s, _ in placed])
    lateral = np.array([lateral for _, lateral in placed])
    low, high = -(widths[:, 0] - margin) - lateral, widths[:, 1] - margin - lateral
    return np.minimum(low, high), np.maximum(low, high)


def _least_bend(points: Floats, normals: Floats, low: Floats, high: Floats) -> Floats:
    """The offsets along the normals, within bounds, with the least sum of squares of second differences."""
    n = len(points)
    hessian, slope = np.zeros((n, n)), np.zeros(n)
    index = np.arange(n)
    for axis in range(2):
        second = np.zeros((n, n))
        for shift, weight in ((-1, 1.0), (0, -2.0), (1, 1.0)):
            column = (index + shift) % n
            second[index, column] = weight * normals[column, axis]
        bend = np.roll(points[:, axis], 1) - 2.0 * points[:, axis] + np.roll(points[:, axis], -1)
        hessian += second.T @ second
        slope += second.T @ bend
    return _bounded_minimum(hessian + 1e-9 * np.eye(n), slope, low, high)


def _bounded_minimum(hessian: Floats, slope: Floats, low: Floats, high: Floats) -> Floats:
    """Minimum of x H x / 2 + slope x for low <= x <= high; projected Newton method (Bertsekas 1982)."""
    x = np.clip(np.zeros(len(slope)), low, high)

    def value(at: Floats) -> float:
        return float(at @ (0.5 * (hessian @ at) + slope))

    for _ in range(100):
        gradient = hessian @ x + slope
        held = ((x <= low) & (gradient > 0.0)) | ((x >= high) & (gradient < 0.0))
        free = np.flatnonzero(~held)
        if not len(free) or np.abs(gradient[free]).max() < 1e-10:
            break
        step = np.zeros(len(x))
        step[free] = -np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
        share, before = 1.0, value(x)
        while value(np.clip(x + share * step, low, high)) > before - 1e-15 and share > 1e-6:
            share /= 2.0
        moved = np.clip(x + share * step, low, high)
        if np.abs(moved - x).max() < 1e-7:
            break
        x = moved
    return x


def _from_start(points: Floats, track: Track) -> Floats:
    """A closed line from the point on where it crosses the start line of the track."""
    at = np.array([track.project(x, y)[0] for x, y in points.tolist()])
    last = int(np.argmin(np.roll(at, -1) - at))  # where the distance along the centre line starts again
    a, b = points[last], points[(last + 1) % len(points)]
    start = track.line.points[0]
    along = np.array(track.line.points[1] - start)
    share = float((start - a) @ along / max((b - a) @ along, 1e-12))
    crossing = a + min(max(share, 0.0), 1.0) * (b - a)
    rolled = np.roll(points, -(last + 1), axis=0)
    if np.hypot(*(rolled[0] - crossing)) < 1e-3:
        return rolled
    return np.vstack([crossing, rolled])


def _mean_of_three(values: Floats) -> Floats:
    return (np.roll(values, 1) + values + np.roll(values, -1)) / 3.0
