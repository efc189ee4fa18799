"""Lane graph: directed centre lines through modules, connected at ports; the nearest point, and loops."""

from __future__ import annotations

import heapq
import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.scenario.maps.shapes import Pose, arc

_SAME = 1e-9
MAX_RADIUS = 1e4
"""Largest radius of a lane [m]."""


@dataclass(frozen=True)
class Lane:
    """One lane of one placed module."""

    name: str
    """'placement:entry port>exit port'."""
    points: Floats
    """Centre line in driving direction [m], shape (n, 2)."""
    successors: tuple[int, ...]
    """Indices of the lanes that begin where this one ends."""

    @cached_property
    def length(self) -> float:
        """Length of the centre line [m]."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())


class LanePoint(NamedTuple):
    """The point of a centre line that is nearest to a query point."""

    lane: int
    x: float
    y: float
    yaw: float
    """Heading of the lane at that point [rad]."""
    offset: float
    """Signed distance of the query point from the centre line [m]; left is positive."""


@dataclass(frozen=True)
class LaneGraph:
    """Lanes, which follow each other where modules meet."""

    lanes: tuple[Lane, ...]

    def nearest(self, x: float, y: float, yaw: float | None = None) -> LanePoint | None:
        """The nearest point on any centre line. With `yaw` [rad], only on segments within 60 degrees of it."""
        first, step, lane = self._segments
        if yaw is not None:
            is_ahead = step @ (math.cos(yaw), math.sin(yaw)) > 0.5 * np.hypot(*step.T)
            first, step, lane = first[is_ahead], step[is_ahead], lane[is_ahead]
        if not len(first):
            return None
        length = np.hypot(*step.T)
        towards = np.array([x, y]) - first
        fraction = np.clip(np.sum(towards * step, axis=1) / length**2, 0.0, 1.0)
        points = first + fraction[:, None] * step
        i = int(np.argmin(np.hypot(x - points[:, 0], y - points[:, 1])))
        (px, py), (sx, sy) = points[i], step[i] / length[i]
        offset = math.copysign(math.hypot(x - px, y - py), sx * (y - py) - sy * (x - px))
        return LanePoint(int(lane[i]), float(px), float(py), math.atan2(sy, sx), offset)

    def loop(self, start: int) -> tuple[int, ...] | None:
        """The shortest closed sequence of lanes that begins with that lane (Dijkstra); None if there is none."""
        queue: list[tuple[float, int, tuple[int, ...]]] = [(0.0, start, (start,))]
        done: set[int] = set()
        while queue:
            cost, lane, route = heapq.heappop(queue)
            if lane == start and len(route) > 1:
                return route[:-1]
            if lane in done:
                continue
            done.add(lane)
            for successor in self.lanes[lane].successors:
                heapq.heappush(queue, (cost + self.lanes[successor].length, successor, (*route, successor)))
        return None

    def loops(self) -> tuple[tuple[int, ...], ...]:
        """The shortest loop through each lane, without duplicates, sorted by length."""
        loops: dict[frozenset[int], tuple[int, ...]] = {}
        for lane in range(len(self.lanes)):
            loop = self.loop(lane)
            if loop:
                loops.setdefault(frozenset(loop), loop)
        return tuple(sorted(loops.values(), key=self.length))

    def length(self, route: tuple[int, ...]) -> float:
        """Length of a route [m]."""
        return sum(self.lanes[i].length for i in route)

    def path(self, route: tuple[int, ...]) -> Floats:
        """The centre line of a whole route [m], shape (n, 2)."""
        first = self.lanes[route[0]].points[:1]
        return np.vstack([first, *(self.lanes[i].points[1:] for i in route)])

    @cached_property
    def _segments(self) -> tuple[Floats, Floats, Integers]:
        """First point, step and lane of each segment of each lane."""
        if not self.lanes:
            return np.empty((0, 2)), np.empty((0, 2)), np.empty(0, np.int64)
        steps = [np.diff(lane.points, axis=0) for lane in self.lanes]
        first = np.vstack([lane.points[:-1] for lane in self.lanes])
        lane = np.repeat(np.arange(len(steps)), [len(step) for step in steps])
        return first, np.vstack(steps), lane


class Piece(NamedTuple):
    """A lane before it is part of a graph."""

    name: str
    points: Floats
    """Centre line in driving direction [m], shape (n, 2)."""
    start: Hashable
    """Key of the place where it starts."""
    end: Hashable
    """Key of the place where it ends. Lanes that start there are the successors."""


def lane_graph(pieces: Sequence[Piece]) -> LaneGraph:
    """Builds the graph of these lanes."""
    starting: dict[Hashable, list[int]] = {}
    for lane, piece in enumerate(pieces):
        starting.setdefault(piece.start, []).append(lane)
    return LaneGraph(tuple(Lane(piece.name, piece.points, tuple(starting.get(piece.end, ()))) for piece in pieces))


def lane_path(start: Pose, end: Pose) -> Floats:
    """Points of a path between two poses with their headings: a line, or one arc with a line before or after it.

    The arc has the largest possible radius. Raises ValueError if no such path exists.
    """
    (x0, y0, yaw0), (x1, y1, yaw1) = start, end
    ahead, out = np.array([math.cos(yaw0), math.sin(yaw0)]), np.array([math.cos(yaw1), math.sin(yaw1)])
    way = np.array([x1 - x0, y1 - y0])
    turn = _cross(ahead, out)
    if abs(turn) < _SAME:
        if ahead @ out < 0.0 or abs(_cross(ahead, way)) > 1e-6 or ahead @ way <= 0.0:
            raise ValueError("neither a line nor a single arc connects the two poses")
        return np.array([(x0, y0), (x1, y1)])
    before, behind = _cross(way, out) / turn, _cross(ahead, way) / turn  # to the corner where the tangents meet
    reach = min(before, behind)
    if reach <= _SAME:
        raise ValueError("neither a line nor a single arc connects the two poses")
    angle = math.atan2(turn, ahead @ out)
    radius = reach / math.tan(abs(angle) / 2.0)
    if radius > MAX_RADIUS:
        raise ValueError(f"the arc between the two poses has a radius of {radius:.3g} m, more than {MAX_RADIUS:g} m")
    side = math.copysign(1.0, angle)
    tangent = np.array([x0, y0]) + (before - reach) * ahead
    centre = tangent + side * radius * np.array([-ahead[1], ahead[0]])
    begin = math.atan2(*(tangent - centre)[::-1])
    bend = arc((centre[0], centre[1]), radius, begin, begin + angle)
    points = np.vstack([[(x0, y0)], bend, [(x1, y1)]])
    return points[np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > _SAME])]


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
