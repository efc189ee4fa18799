"""Generates random closed tracks: the same numbers for the same seed on every processor."""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.errors import SpecError
from autodrive.protocol.commands import check_seed
from autodrive.scenario.tracks.growth import grow
from autodrive.scenario.tracks.line import closed_line
from autodrive.scenario.tracks.shape import crossings, curvature, resampled, straightest, walls_along
from autodrive.scenario.tracks.track import BarrierSpec, Track

MIN_WIDTH = 0.9
"""Least distance of the barriers [m]: three cars, as in the rules of RoboRacer."""
SPACING = 0.1
"""Distance of the points of the centre line, about [m]."""
NODES_APART = 0.45
"""Distance of the points that grow, about [m]."""
ATTEMPTS = 12
SLACK = 0.03
"""Difference between the limits of the growing points and those of the track [m]."""
LENGTH_TOLERANCE = 0.05
"""Relative tolerance of the length of a generated track."""


def generate_track(
    seed: int,
    *,
    length: float = 60.0,
    width: float = 1.2,
    area: tuple[float, float] = (30.0, 10.0),
    min_radius: float | None = None,
    barrier: BarrierSpec | None = None,
    name: str = "",
) -> Track:
    """A random closed track without a race line. Raises `SpecError` if none fits, `CommandError` for a wrong seed.

    `length`: of the centre line [m], kept within 5 %; `width`: between the barriers [m]; `area`: extent along x and y
    [m], barriers included; `min_radius`: of the centre line [m], by default the width.
    """
    check_seed(seed)
    barrier = barrier or BarrierSpec()
    radius = max(width, 1.0) if min_radius is None else min_radius
    _check(length, width, area, radius, barrier)
    margin = width / 2.0 + barrier.width + SLACK
    room = (area[0] - 2.0 * margin, area[1] - 2.0 * margin)
    gap = width + barrier.width
    for attempt in range(ATTEMPTS):
        centre = _loop(np.random.default_rng([seed, attempt]), length, room, gap, radius)
        if centre is None:
            continue
        points = np.round(centre - (area[0] / 2.0 - margin, area[1] / 2.0 - margin), 4)
        half = np.full((len(points), 2), round(width / 2.0, 4))
        track = Track(
            name or f"track_{seed}",
            np.hstack([points, half]),
            walls=walls_along(np.hstack([points, half])),
            title=f"Track {seed}: {length:g} m, {width:g} m wide",
            barrier=barrier,
        )
        if not crossings(track.walls):
            return track
    raise SpecError(
        [
            f"seed {seed}: no track of {length:g} m and {width:g} m width was found in {area[0]:g} m x {area[1]:g} m. "
            "Take another seed, a shorter length, a smaller width or a larger area"
        ]
    )


def _check(length: float, width: float, area: tuple[float, float], radius: float, barrier: BarrierSpec) -> None:
    errors = []
    if not MIN_WIDTH <= width <= 10.0:
        errors.append(f"width {width:g} m: it must be from {MIN_WIDTH:g} m to 10 m")
    least = 2.0 * (width + barrier.width + radius)
    if not least <= min(area) <= max(area) <= 1000.0:
        errors.append(
            f"area {area[0]:g} x {area[1]:g} m: each side must be from {least:.3g} m, for that width, to 1000 m"
        )
    elif not 2.0 * math.pi * radius <= length <= area[0] * area[1] / (width + barrier.width):
        most = area[0] * area[1] / (width + barrier.width)
        errors.append(
            f"length {length:g} m: it must be from {2.0 * math.pi * radius:.3g} m (a circle) to {most:.4g} m "
            "(all of the area) for that width and area"
        )
    if radius <= width / 2.0:
        errors.append(f"min_radius {radius:g} m: it must be above half the width, {width / 2.0:g} m")
    if errors:
        raise SpecError(errors)


def _loop(
    rng: np.random.Generator, length: float, room: tuple[float, float], gap: float, radius: float
) -> Floats | None:
    """A closed loop of points in a rectangle, shape (n, 2), from the start line on; None if it breaks a rule."""
    n = max(16, round(length / NODES_APART))
    # the loop starts as a superellipse that is shorter than it will be
    scale = min(0.95, 0.8 * length / _ellipse(*room))
    angles = (2.0 * math.pi * np.arange(n) / n).tolist()
    start = np.array([(cos(t), sin(t)) for t in angles])
    start /= np.sqrt(np.sqrt(start[:, :1] ** 4 + start[:, 1:] ** 4))
    points = (start * scale + 1.0) * np.array(room) / 2.0
    # kicks to the inside and the outside, without a mean: bulges of a few metres
    noise = _smooth(rng.random((n, 1)) - 0.5, 8)
    noise -= _smooth(noise, 200)
    kicks = 0.3 / np.abs(noise).max() * noise * start
    clockwise = bool(rng.random() < 0.5)
    target, reached, centre = length, 0.0, points
    for _ in range(3):
        grown = points.copy()
        grow(grown, kicks, room[0], room[1], target / n, 1.04 * gap, 1.25 * radius, 800)
        centre = resampled(_spline(grown), SPACING)
        reached = float(closed_line(centre).along[-1])
        if abs(reached - length) < 0.01 * length:
            break
        target *= length / reached
    overhang = np.maximum(-centre.min(axis=0), centre.max(axis=0) - room)
    if overhang.max() > SLACK:
        return None
    if abs(reached - length) > LENGTH_TOLERANCE * length:
        return None
    if np.abs(curvature(centre)).max() > 1.0 / radius or _comes_near(centre, 1.003 * gap):
        return None
    if clockwise:
        centre = centre[::-1]
    return np.roll(centre, -straightest(centre, SPACING), axis=0)


def _ellipse(a: float, b: float) -> float:
    """About the length of an ellipse in a rectangle [m]."""
    return math.pi / 2.0 * (a + b) * 0.95


def _smooth(rows: Floats, times: int) -> Floats:
    for _ in range(times):
        rows = (np.roll(rows, 1, axis=0) + 2.0 * rows + np.roll(rows, -1, axis=0)) / 4.0
    return rows


def _spline(nodes: Floats) -> Floats:
    """Forty points for each node on the uniform cubic B-spline with these control points."""
    before, after, second = np.roll(nodes, 1, axis=0), np.roll(nodes, -1, axis=0), np.roll(nodes, -2, axis=0)
    pieces = []
    for i in range(40):
        t = i / 40.0
        weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
        pieces.append((weights[0] * before + weights[1] * nodes + weights[2] * after + weights[3] * second) / 6.0)
    return np.stack(pieces, axis=1).reshape(-1, 2)


def _comes_near(points: Floats, gap: float) -> bool:
    """Whether two parts of a closed line that are not neighbours are nearer than `gap` [m]."""
    n = len(points)
    apart = int(1.7 * gap / SPACING)
    for shift in range(apart, n // 2 + 1):
        d = np.roll(points, -shift, axis=0) - points
        if (d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]).min() < gap * gap:
            return True
    return False
