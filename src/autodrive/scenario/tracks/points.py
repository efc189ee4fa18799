"""Tracks by points: the smooth closed line through some points, what is wrong with it, and the points of a line."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import shapely

from autodrive.base.arrays import Floats
from autodrive.scenario.tracks.line import closed_line
from autodrive.scenario.tracks.shape import curvature, resampled

MIN_POINTS, MAX_POINTS = 3, 200
POINT_GAP = 0.05
"""Least distance of neighbouring points [m]."""
REACH = 500.0
"""Greatest coordinate of a point [m]."""
SPACING = 0.1
"""Distance of the places on the line [m]; more on a line that is longer than `MAX_PLACES` of them."""
MIN_PLACES, MAX_PLACES = 16, 2000
WIDTH_MIN = 0.9
"""A narrower track is reported [m]."""
INNER_RADIUS = 0.1
"""Least radius of the inner barrier of a bend [m]."""
BETWEEN = 0.05
"""Least distance between the barriers of two parts of a track [m]."""
TOLERANCE = 0.03
"""Greatest distance of a line from the one through its points [m]."""
MAX_FAULTS = 20
_STEPS = 40
"""Steps of the parameter between two points."""
_ROUNDS = 60
"""Rounds of the computation of a curve; each of them halves the error of the second derivatives."""
_COUNTS = (8, 10, 12, 14, 16, 20, 24, 32, 40, 48, 64, 80, 100, 128, 160, MAX_POINTS)


class SmoothLine(NamedTuple):
    """Places at equal distances on a closed line, from its first point on."""

    places: Floats
    """x, y [m], shape (n, 2)."""
    parameters: Floats
    """Number of the point before each place, from 0, and the share of the way to the next one, shape (n,)."""


class TrackFault(NamedTuple):
    """A place where a track cannot be driven."""

    kind: Literal["bend", "touch", "narrow"]
    """'bend': the radius is too small; 'touch': two parts of the track touch or cross; 'narrow': the width is."""
    x: float
    y: float
    """[m]."""
    point: int
    """The nearest one."""
    value: float
    """Radius of the line, distance of the two parts, or width [m]."""
    least: float
    """[m]."""

    @property
    def text(self) -> str:
        """What is wrong, and what would be right."""
        at = f"at ({self.x:.2f}, {self.y:.2f})"
        if self.kind == "bend":
            return f"the radius {at} is {self.value:.2f} m; for that width it must be at least {self.least:.2f} m"
        if self.kind == "touch":
            return f"two parts of the track are {self.value:.2f} m apart {at}; the least distance is {self.least:.2f} m"
        return f"the track is {self.value:.2f} m wide; it should be at least {self.least:.2f} m"


def smooth_line(points: Floats) -> SmoothLine:
    """The periodic cubic spline through points, shape (n, 2), whose parameter is centripetal.

    Its second derivatives `m` solve de Boor, A Practical Guide to Splines, IV (7), by Jacobi's method: the matrix is
    diagonally dominant. Plain arithmetic: the same bits on every processor.
    """
    n = len(points)
    after = np.roll(points, -1, axis=0)
    difference = after - points
    chord = np.sqrt(difference[:, 0] * difference[:, 0] + difference[:, 1] * difference[:, 1])
    h = np.sqrt(chord)[:, None]
    before = np.roll(h, 1, axis=0)
    slope = difference / h
    right = 6.0 * (slope - np.roll(slope, 1, axis=0))
    m = np.zeros_like(points)
    for _ in range(_ROUNDS):
        m = (right - before * np.roll(m, 1, axis=0) - h * np.roll(m, -1, axis=0)) / (2.0 * (before + h))
    m_after = np.roll(m, -1, axis=0)

    def at(parameters: Floats) -> Floats:
        i = np.minimum(parameters.astype(np.int64), n - 1)
        t = (parameters - i)[:, None] * h[i]
        r = h[i] - t
        cubic = (m[i] * (r * r * r) + m_after[i] * (t * t * t)) / (6.0 * h[i])
        linear = (points[i] / h[i] - m[i] * h[i] / 6.0) * r + (after[i] / h[i] - m_after[i] * h[i] / 6.0) * t
        return cubic + linear

    fine = np.arange(n * _STEPS) / _STEPS
    along = closed_line(at(fine)).along
    length = float(along[-1])
    count = min(max(round(length / SPACING), MIN_PLACES), MAX_PLACES)
    parameters = np.interp(np.arange(count) * (length / count), along, np.append(fine, float(n)))
    return SmoothLine(at(parameters), parameters)


def centre_line(points: Floats, width: float) -> Floats:
    """The centre line of a track, shape (n, 4), see `Track.centre_line`."""
    places = smooth_line(points).places
    rows: Floats = np.column_stack([places, np.full((len(places), 2), width / 2.0)])
    return np.round(rows, 4) + 0.0


def faults(points: Floats, width: float) -> list[TrackFault]:
    """Where a track through points, shape (n, 2), with a width [m] cannot be driven."""
    places, parameters = smooth_line(points)
    n, length = len(places), float(closed_line(places).along[-1])
    radius, gap = width / 2.0 + INNER_RADIUS, width + BETWEEN

    def fault(kind: Literal["bend", "touch"], i: int, value: float, least: float) -> TrackFault:
        x, y = places[i].tolist()
        return TrackFault(kind, x, y, round(float(parameters[i])) % len(points), value, least)

    bend = np.abs(curvature(places))
    all_faults = [fault("bend", i, float(1.0 / bend[i]), radius) for i in _worst(bend, 1.0 / radius)]
    apart = math.ceil(1.7 * gap / (length / n))
    near, other = np.full(n, np.inf), np.zeros(n, np.int64)
    for shift in range(apart, n - apart + 1):
        away = np.roll(places, -shift, axis=0) - places
        square = away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1]
        nearer = square < near
        near[nearer], other[nearer] = square[nearer], (np.flatnonzero(nearer) + shift) % n
    pairs = [i for i in _worst(-near, -gap * gap) if i < other[i]]
    all_faults += [fault("touch", i, math.sqrt(near[i]), gap) for i in pairs]
    if width < WIDTH_MIN:
        x, y = points[0].tolist()
        all_faults.append(TrackFault("narrow", x, y, 0, width, WIDTH_MIN))
    return all_faults[:MAX_FAULTS]


def points_on(line: Floats, tolerance: float = TOLERANCE) -> Floats:
    """Few points, shape (n, 2), whose smooth line is a closed line within a tolerance [m], if `MAX_POINTS` can be."""
    length, places = float(closed_line(line).along[-1]), shapely.points(line)
    points = line
    for count in _COUNTS:
        points = np.round(resampled(line, length / count), 3) + 0.0
        ring = shapely.LinearRing(smooth_line(points).places)
        if length / count < 2.0 * POINT_GAP or float(shapely.distance(ring, places).max()) < tolerance:
            break
    return points


def _worst(values: Floats, limit: float) -> list[int]:
    """Places with the greatest value in each run of a closed line above a limit."""
    above = values > limit
    if above.all():
        return [int(np.argmax(values))]
    starts = np.flatnonzero(above & ~np.roll(above, 1))
    worst = []
    for start in starts.tolist():
        run = [start]
        while above[(run[-1] + 1) % len(values)]:
            run.append((run[-1] + 1) % len(values))
        worst.append(max(run, key=lambda i: values[i]))
    return worst
