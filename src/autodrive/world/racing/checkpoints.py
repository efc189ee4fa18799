"""Checkpoints of a track, and the compiled function that finds who passed one in a tick."""

from __future__ import annotations

from math import hypot
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import cos, sin
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit_uncounted
from autodrive.scenario.tracks import Track
from autodrive.scenario.tracks.checks import checkpoint_errors
from autodrive.scenario.tracks.line import ClosedLine, nearest_on_line

MARGIN = 0.3
"""A checkpoint is this much wider than the track on each side [m]."""
REACH = 2.0
"""A vehicle passes only checkpoints whose distance along the centre line differs by less than this from its own [m]:
a checkpoint may reach into another part of the track."""
MAX_SPEED = 100.0
"""A vehicle that moves faster than this from tick to tick was placed elsewhere [m/s]; it passes nothing."""
WRONG_WAY = 0.5
"""A vehicle drives the wrong way after this distance against the direction of the track [m]."""


class Progress(NamedTuple):
    """Where the vehicles are on the track: one element of each array for each vehicle."""

    x: Floats
    """x of the centre of the rear axle in the map at the end of the latest tick [m]."""
    y: Floats
    """y of the centre of the rear axle in the map at the end of the latest tick [m]."""
    s: Floats
    """Distance along the centre line of the point nearest to the vehicle, from 0 to the length [m]."""
    lateral: Floats
    """How far the vehicle is to the left of the centre line [m]."""
    travelled: Floats
    """Sum of all changes of `s`, by half a lap at most [m]: without jumps at the start line."""
    farthest: Floats
    """Greatest `travelled` since the vehicle last turned into the direction of the track [m]."""
    backmost: Floats
    """Least `travelled` while it drives the wrong way [m]."""
    is_wrong_way: Integers
    """1 while the vehicle drives against the direction of the track."""
    has_turned: Integers
    """1 if the vehicle began to drive the wrong way in the latest tick."""
    counted: Integers
    """Number of the checkpoint that counts as passed last; 0 is the finish line."""
    left: Integers
    """Number of the checkpoint that the vehicle crossed last, in any direction."""
    crossed: Integers
    """Number of the checkpoint that the vehicle crossed forward in the latest tick; -1: none."""
    passed: Floats
    """Fraction of the latest tick at which it crossed this checkpoint."""


def progress(vehicles: int) -> Progress:
    """The arrays for that many vehicles."""
    whole = {"is_wrong_way", "has_turned", "counted", "left", "crossed"}
    columns: dict[str, Any] = {
        name: np.zeros(vehicles, np.int64 if name in whole else np.float64) for name in Progress._fields
    }
    return Progress(**columns)


def gates(track: Track, distance: float) -> Floats:
    """The checkpoints of a track, or else some about `distance` [m] apart, shape (n, 7); the first is the finish line.

    Columns: a point [m], the direction of the track there, widths to the right and left of the point [m], distance
    along the centre line [m]. Raises `SpecError` if the checkpoints of the track are not in driving order.
    """
    rows: list[tuple[float, ...]] = []
    if track.checkpoints is not None:
        if errors := checkpoint_errors(track):
            raise SpecError([f"track '{track.name}': {error}" for error in errors])
        for x, y, psi, width in track.checkpoints.tolist():
            s = track.project(x, y)[0] if rows else 0.0
            rows.append((x, y, cos(psi), sin(psi), width / 2.0, width / 2.0, s))
        return np.array(rows)
    count = max(3, round(track.length / distance))
    for s in (track.length * i / count for i in range(count)):
        x, y, _ = track.pose_at(s)
        rows.append((x, y, *_direction(track, s), *track.widths_at(s), s))
    return np.array(rows)


def _direction(track: Track, s: float) -> tuple[float, float]:
    """Mean direction of the centre line around s: at a corner of the line, the direction of its bisector."""
    (xa, ya, _), (xb, yb, _) = track.pose_at(s - 1e-3), track.pose_at(s + 1e-3)
    length = hypot(xb - xa, yb - ya)
    return (xb - xa) / length, (yb - ya) / length


@jit_uncounted
def start(line: ClosedLine, positions: Floats, i: int, p: Progress) -> None:
    """Let vehicle i be where it is now, without having crossed a checkpoint on its way there."""
    p.x[i], p.y[i] = positions[i, 0], positions[i, 1]
    _follow(line, i, p)
    p.farthest[i] = p.backmost[i] = p.travelled[i]
    p.is_wrong_way[i] = p.has_turned[i] = 0
    p.crossed[i] = -1


@jit_uncounted
def advance(line: ClosedLine, gates: Floats, positions: Floats, tick: float, p: Progress) -> bool:
    """Update the progress at the end of a tick; whether a vehicle crossed a checkpoint or turned the wrong way.

    A crossing is interpolated within the tick: the path is straight, and its speed changes by at most a few cm/s.
    """
    has_news = False
    for i in range(len(p.x)):
        x0, y0, x1, y1 = p.x[i], p.y[i], positions[i, 0], positions[i, 1]
        p.crossed[i] = -1
        if x0 == x1 and y0 == y1:
            p.has_turned[i] = 0
            continue
        if hypot(x1 - x0, y1 - y0) > MAX_SPEED * tick:
            start(line, positions, i, p)
            continue
        p.x[i], p.y[i] = x1, y1
        _follow(line, i, p)
        _update_direction(p, i)
        has_news |= p.has_turned[i] == 1
        for k in range(len(gates)):
            gx, gy, dx, dy, right, left, s = gates[k]
            away = s - p.s[i]
            if abs(away - line.along[-1] * np.round(away / line.along[-1])) > REACH:
                continue
            # distances in the direction of the checkpoint before and after the tick: it is crossed from - to +
            before = (x0 - gx) * dx + (y0 - gy) * dy
            after = (x1 - gx) * dx + (y1 - gy) * dy
            if (before < 0.0) == (after < 0.0):
                continue
            # where the straight path of the tick crosses the gate, and how far that is to the left of its middle
            fraction = before / (before - after)
            side = (y0 + fraction * (y1 - y0) - gy) * dx - (x0 + fraction * (x1 - x0) - gx) * dy
            if not -right - MARGIN <= side <= left + MARGIN:
                continue
            if before < 0.0:
                p.crossed[i], p.passed[i] = k, fraction
                has_news = True
            else:
                p.left[i] = k
    return has_news


@jit_uncounted
def _follow(line: ClosedLine, i: int, p: Progress) -> None:
    """Update `s`, `lateral` and `travelled` of vehicle i; a change by more than half a lap is the jump of s."""
    length = line.along[-1]
    s, p.lateral[i] = nearest_on_line(line, p.x[i], p.y[i])
    change = s - p.s[i]
    p.travelled[i] += change - length * np.round(change / length)
    p.s[i] = s


@jit_uncounted
def _update_direction(p: Progress, i: int) -> None:
    """Update `is_wrong_way` and `has_turned` of vehicle i."""
    travelled = p.travelled[i]
    p.has_turned[i] = 0
    if not p.is_wrong_way[i]:
        p.farthest[i] = max(p.farthest[i], travelled)
        p.backmost[i] = travelled
        if p.farthest[i] - travelled > WRONG_WAY:
            p.is_wrong_way[i] = p.has_turned[i] = 1
        return
    p.backmost[i] = min(p.backmost[i], travelled)
    if travelled - p.backmost[i] > WRONG_WAY:
        p.is_wrong_way[i] = 0
        p.farthest[i] = travelled
