"""The map of a race track: barriers as solid pieces, the start line, and one closed lane."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan2
from autodrive.physics.model import BOX
from autodrive.scenario.maps.lanes import Piece
from autodrive.scenario.maps.shapes import rectangle
from autodrive.scenario.maps.solids import StaticShape
from autodrive.scenario.tracks.track import BarrierSpec, Track

OVERLAP = 0.001
"""Pieces are longer by this at both ends [m], so that no ray passes between two of them."""
THINNEST = 0.005
"""Least thickness of a wall with another face behind it [m]: at the tip of a spike the square end of a piece stands out
so far."""
START_LINE_WIDTH = 0.06
"""Width of the painted start line [m]."""


@dataclass(frozen=True)
class Barrier:
    """One wall, or one air duct: a line along its face, with the solid on the right side of it."""

    name: str
    wall: str
    """Name of the wall that it is a part of."""
    points: Floats
    """x, y [m], shape (n, 2); the first point is repeated at the end if the barrier is closed."""
    depth: Floats
    """Thickness behind each segment [m], shape (n - 1,)."""
    is_closed: bool


def barriers(track: Track) -> list[Barrier]:
    """All barriers of a track, without the gaps between ducts."""
    all_barriers: list[Barrier] = []
    for number, face in enumerate(track.walls, 1):
        closed = np.vstack([face, face[:1]])
        lines = [closed] if track.barrier.length is None else list(_ducts(closed, track.barrier))
        for k, line in enumerate(lines, 1):
            wall = f"wall_{number}"
            name = wall if len(lines) == 1 else f"{wall}_{k}"
            depth = np.full(len(line) - 1, track.barrier.width)
            all_barriers.append(Barrier(name, wall, line, depth, track.barrier.length is None))
    if all_barriers:
        _make_thinner(all_barriers)
    return all_barriers


def pieces(all_barriers: list[Barrier], spec: BarrierSpec) -> Iterator[StaticShape]:
    """A box behind each segment of each barrier. The part of a name before '/' is the barrier."""
    for barrier in all_barriers:
        steps = np.diff(barrier.points, axis=0)
        middles = (barrier.points[:-1] + barrier.points[1:]) / 2.0
        for k, ((dx, dy), (x, y), depth) in enumerate(
            zip(steps.tolist(), middles.tolist(), barrier.depth.tolist(), strict=True), 1
        ):
            length = math.sqrt(dx * dx + dy * dy)
            half = (length / 2.0 + OVERLAP, depth / 2.0, spec.height / 2.0)
            centre = (x + dy / length * depth / 2.0, y - dx / length * depth / 2.0, spec.height / 2.0)
            yield StaticShape(f"{barrier.name}/{k}", barrier.wall, BOX, half, centre, atan2(dy, dx), spec.kind)


def road(track: Track) -> BaseGeometry:
    """The ground between the edges of a track."""
    right, left = (shapely.Polygon(edge).buffer(0) for edge in track.edges)
    return shapely.symmetric_difference(right, left)


def start_line(track: Track) -> shapely.Polygon:
    """The painted start line; the middle of the line goes through the first point of the centre line."""
    right, left = track.widths_at(0.0)
    x, y, yaw = track.pose_at(0.0, (left - right) / 2.0)
    return rectangle((x, y, yaw), START_LINE_WIDTH, left + right)


def lane(track: Track) -> Piece:
    """The centre line as a closed lane."""
    return Piece("track", track.line.points, "start", "start")


def _ducts(face: Floats, spec: BarrierSpec) -> Iterator[Floats]:
    """The parts of a closed line with gaps between them, all equally long."""
    assert spec.length is not None
    along = np.concatenate([[0.0], np.cumsum(np.sqrt(np.sum(np.diff(face, axis=0) ** 2, axis=1)))])
    count = max(1, round(along[-1] / (spec.length + spec.gap)))
    period = along[-1] / count
    for k in range(count):
        start, end = k * period + spec.gap / 2.0, (k + 1) * period - spec.gap / 2.0
        inner = along[(along > start + 1e-3) & (along < end - 1e-3)]
        at = np.concatenate([[start], inner, [end]])
        yield np.column_stack([np.interp(at, along, face[:, axis]) for axis in range(2)])


def _make_thinner(barriers: list[Barrier]) -> None:
    """Makes barriers thinner until no other face is behind them."""
    first = np.vstack([barrier.points[:-1] for barrier in barriers])
    step = np.vstack([np.diff(barrier.points, axis=0) for barrier in barriers])
    depth = np.concatenate([barrier.depth for barrier in barriers])
    length = np.sqrt(np.sum(step * step, axis=1))[:, None]
    ahead = step / length
    back = np.column_stack([ahead[:, 1], -ahead[:, 0]])
    inset = np.minimum(0.1 * length, 0.002)
    a, b = first + inset * ahead + 0.001 * back, first + step - inset * ahead + 0.001 * back
    faces: Any = shapely.linestrings(np.stack([first, first + step], axis=1))
    tree = shapely.STRtree(faces)
    todo = np.arange(len(first))
    while len(todo):
        far = (depth[todo] + 0.001)[:, None] * back[todo]
        corners = np.stack([a[todo], b[todo], b[todo] + far, a[todo] + far], axis=1)
        behind, _ = tree.query(shapely.polygons(corners), predicate="intersects")
        todo = todo[np.unique(behind)]
        todo = todo[depth[todo] > THINNEST]
        depth[todo] *= 0.8
    starts = np.cumsum([0, *(len(barrier.depth) for barrier in barriers)])
    for barrier, start in zip(barriers, starts, strict=False):
        barrier.depth[:] = depth[start : start + len(barrier.depth)]
