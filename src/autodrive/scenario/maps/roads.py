"""Roads: the lanes of a map on which traffic can drive without end, as tables of numbers for compiled code.

A link is a lane that crosses or joins another one, or that has a stop line (a gate), or a chain of other lanes without
a branch. Between two gates there is at most one chain.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely

from autodrive.base.arrays import Floats, Integers
from autodrive.scenario.maps.lanes import LaneGraph
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.stop_lines import StopLine

SPACING = 0.02
"""Largest distance between the points of a link [m]."""
STRAIGHT = math.radians(30.0)
"""A link that turns by less goes straight on."""
CRITICAL_GAPS = {"left from major": 4.1, "right": 6.2, "straight": 6.5, "left": 7.1}
"""Gap in the traffic of a two-lane road that is long enough for half of the drivers [s]: Highway Capacity Manual 2010,
exhibit 19-10 (base critical headways). Without 'from major': from a road that gives way."""


class Roads(NamedTuple):
    """Links, n of them. Rows of a table with `_first` are those from `first[i]` to `first[i + 1]`."""

    point_first: Integers
    """Shape (n + 1,)."""
    points: Floats
    """Points at equal distances on each link [m], and the unit vector of the direction there, shape (m, 4)."""
    spacing: Floats
    """Distance between the points of a link [m], shape (n,)."""
    length: Floats
    """[m], shape (n,)."""
    successor_first: Integers
    """Shape (n + 1,)."""
    successor: Integers
    """Links that begin where a link ends."""
    is_gate: Integers
    """1: a vehicle needs permission to enter, shape (n,)."""
    stop_at: Floats
    """Where a vehicle waits before the gate, from the start of the link [m], shape (n,)."""
    turn: Integers
    """1: the link of a gate turns to the left; -1: to the right; else 0, shape (n,)."""
    light: Integers
    """Number of the traffic light of the gate in the map; -1: it has none, shape (n,)."""
    is_stop: Integers
    """1: the gate has a stop sign, shape (n,)."""
    critical_gap: Floats
    """Gap that a vehicle needs in the traffic to which it gives way [s], shape (n,)."""
    conflict_first: Integers
    """Shape (n + 1,)."""
    conflict: Integers
    """Other links that cross or join a link."""
    conflict_end: Floats
    """Where the other link is clear of this one, from the start of the other one [m]."""
    yields: Integers
    """1: the link gives way to the other one; -1: the other one does; 0: who comes first goes first."""

    @property
    def link_count(self) -> int:
        """Number of links."""
        return len(self.length)


_NO_NUMBERS, _NO_INTEGERS, _FIRST = np.zeros(0), np.zeros(0, np.int64), np.zeros(1, np.int64)
NO_ROADS = Roads(
    point_first=_FIRST,
    points=np.zeros((0, 4)),
    spacing=_NO_NUMBERS,
    length=_NO_NUMBERS,
    successor_first=_FIRST,
    successor=_NO_INTEGERS,
    is_gate=_NO_INTEGERS,
    stop_at=_NO_NUMBERS,
    turn=_NO_INTEGERS,
    light=_NO_INTEGERS,
    is_stop=_NO_INTEGERS,
    critical_gap=_NO_NUMBERS,
    conflict_first=_FIRST,
    conflict=_NO_INTEGERS,
    conflict_end=_NO_NUMBERS,
    yields=_NO_INTEGERS,
)
"""No link at all."""


def roads(map_: Map, clearance: float) -> Roads:
    """The roads of a map; lanes of which the centre lines come nearer than `clearance` [m] cross or join.

    There are no links on a map without a closed way.
    """
    graph = map_.lane_graph
    kept = _without_ends(graph)
    next_of = {i: [k for k in graph.lanes[i].successors if k in kept] for i in kept}
    lines = {i: shapely.LineString(graph.lanes[i].points) for i in kept}
    pairs = _conflicts(graph, lines, clearance)
    lines_of_signs = [*map_.stop_lines, *map_.give_way_lines]
    stops = {i: line for i in kept if (line := stop_line_on(graph.lanes[i].points, lines_of_signs))}
    gates = {i for pair in pairs for i in pair} | set(stops)
    chains = [[i] for i in sorted(gates)] + list(_chains(next_of, gates))
    link_of = {lane: k for k, chain in enumerate(chains) for lane in chain}
    points = [resampled(graph.path(tuple(chain))) for chain in chains]
    spacing = np.array([_steps(line)[0] for line in points])
    length = np.array([(len(line) - 1) * step for line, step in zip(points, spacing.tolist(), strict=True)])
    minor = {i for i, (_, line) in stops.items() if line.kind in ("stop", "give_way")}
    turn = {i: _turn(graph.lanes[i].points) for i in gates}
    rivals: list[list[tuple[int, float, int]]] = [[] for _ in chains]
    for a, b in pairs:
        for i, k in ((a, b), (b, a)):
            first, second = link_of[i], link_of[k]
            end = _clear_from(points[second], lines[i], clearance) * float(spacing[second])
            rivals[first].append((second, end, _yields(graph, minor, turn, i, k)))
    lights = {name: k for k, name in enumerate(map_.traffic_lights)}
    turns = [turn.get(chain[0], 0.0) for chain in chains]
    stop_of = [stops.get(chain[0]) for chain in chains]
    return Roads(
        point_first=_firsts([len(line) for line in points]),
        points=np.vstack([_with_directions(line) for line in points]) if points else np.empty((0, 4)),
        spacing=spacing,
        length=length,
        successor_first=_firsts([len(next_of[chain[-1]]) for chain in chains]),
        successor=_integers([link_of[k] for chain in chains for k in next_of[chain[-1]]]),
        is_gate=_integers([int(chain[0] in gates) for chain in chains]),
        stop_at=np.array([stop[0] if stop else 0.0 for stop in stop_of]),
        turn=_integers([int(angle > STRAIGHT) - int(angle < -STRAIGHT) for angle in turns]),
        light=_integers([lights.get(stop[1].prop, -1) if stop else -1 for stop in stop_of]),
        is_stop=_integers([int(stop is not None and stop[1].kind == "stop") for stop in stop_of]),
        critical_gap=np.array([_critical_gap(chain[0] in minor, t) for chain, t in zip(chains, turns, strict=True)]),
        conflict_first=_firsts([len(conflicts) for conflicts in rivals]),
        conflict=_integers([other for conflicts in rivals for other, _, _ in conflicts]),
        conflict_end=np.array([end for conflicts in rivals for _, end, _ in conflicts]),
        yields=_integers([order for conflicts in rivals for _, _, order in conflicts]),
    )


def _without_ends(graph: LaneGraph) -> set[int]:
    """Lanes from which a vehicle can drive on without end."""
    kept = set(range(len(graph.lanes)))
    while ends := {i for i in kept if not kept.intersection(graph.lanes[i].successors)}:
        kept -= ends
    return kept


def _conflicts(graph: LaneGraph, lines: dict[int, shapely.LineString], clearance: float) -> list[tuple[int, int]]:
    """Pairs of lanes of a module that cross or join; those that begin together do not."""
    lanes, shapes = list(lines), np.array(list(lines.values()), dtype=object)
    close_pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=clearance).T.tolist()
    module = {i: graph.lanes[i].name.rpartition(":")[0] for i in lanes}
    pairs = [
        (lanes[a], lanes[b]) for a, b in close_pairs if lanes[a] < lanes[b] and module[lanes[a]] == module[lanes[b]]
    ]
    return [(i, k) for i, k in sorted(pairs) if math.dist(lines[i].coords[0], lines[k].coords[0]) > SPACING]


def stop_line_on(points: Floats, lines: Sequence[StopLine]) -> tuple[float, StopLine] | None:
    """The first stop line that a lane crosses in its direction, and where it does [m]."""
    for line in lines:
        x, y, yaw = line.pose
        ahead = (points[:, 0] - x) * math.cos(yaw) + (points[:, 1] - y) * math.sin(yaw)
        aside = (points[:, 1] - y) * math.cos(yaw) - (points[:, 0] - x) * math.sin(yaw)
        at = 0.0
        for k, (before, now) in enumerate(pairwise(ahead.tolist())):
            step = math.dist(points[k], points[k + 1])
            share = before / (before - now) if before != now else 0.0
            if before <= 0.0 < now and abs(aside[k] + share * (aside[k + 1] - aside[k])) < line.width / 2.0:
                return at + share * step, line
            at += step
    return None


def _chains(next_of: dict[int, list[int]], gates: set[int]) -> Iterator[list[int]]:
    """The lanes that are no gates, in chains without a branch."""
    before: dict[int, list[int]] = {i: [] for i in next_of}
    for i, following in next_of.items():
        for k in following:
            before[k].append(i)

    def goes_on(i: int, k: int) -> bool:
        return i not in gates and k not in gates and next_of[i] == [k] and before[k] == [i]

    left = sorted(set(next_of) - gates)
    starts = [i for i in left if not (len(before[i]) == 1 and goes_on(before[i][0], i))]
    done: set[int] = set()
    for start in [*starts, *left]:  # what is left after the starts is closed
        if start not in done:
            chain = [start]
            while goes_on(chain[-1], k := next_of[chain[-1]][0]) and k != start:
                chain.append(k)
            done.update(chain)
            yield chain


def _yields(graph: LaneGraph, minor: set[int], turn: dict[int, float], i: int, k: int) -> int:
    """Who gives way, see `Roads.yields`: by a stop or give-way sign; else who turns left across oncoming traffic."""
    if (i in minor) != (k in minor):
        return 1 if i in minor else -1
    first, second = (graph.lanes[lane].points[1] - graph.lanes[lane].points[0] for lane in (i, k))
    is_opposite = first @ second < -0.7 * math.hypot(*first) * math.hypot(*second)
    is_left = turn[i] > STRAIGHT, turn[k] > STRAIGHT
    return int(is_left[0]) - int(is_left[1]) if is_opposite else 0


def _critical_gap(is_minor: bool, turn: float) -> float:
    if not is_minor:
        return CRITICAL_GAPS["left from major"]
    return CRITICAL_GAPS["left" if turn > STRAIGHT else "right" if turn < -STRAIGHT else "straight"]


def _turn(points: Floats) -> float:
    """Angle between the first and the last piece of a lane [rad], left positive."""
    (ax, ay), (bx, by) = points[1] - points[0], points[-1] - points[-2]
    return math.atan2(ax * by - ay * bx, ax * bx + ay * by)


def _clear_from(points: Floats, other: shapely.LineString, clearance: float) -> int:
    """Index of the first point of a lane behind those that are nearer to another lane."""
    near = shapely.distance(shapely.points(points), other) < clearance
    return int(np.flatnonzero(near)[-1]) + 1 if near.any() else 0


def resampled(path: Floats) -> Floats:
    """Points at equal distances on a path, shape (n, 2)."""
    at = np.concatenate([[0.0], np.cumsum(_steps(path))])
    count = max(2, math.ceil(at[-1] / SPACING - 1e-9) + 1)
    where = np.linspace(0.0, at[-1], count)
    return np.column_stack([np.interp(where, at, path[:, axis]) for axis in range(2)])


def _steps(path: Floats) -> Floats:
    way = np.diff(path, axis=0)
    return np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])


def _with_directions(points: Floats) -> Floats:
    """x, y and the unit vector to the next point, between its neighbours if there are two, shape (n, 4)."""
    way = np.diff(points, axis=0)
    way = np.vstack([way[:1], way[:-1] + way[1:], way[-1:]])
    return np.hstack([points, way / np.sqrt(way[:, :1] ** 2 + way[:, 1:] ** 2)])


def _firsts(counts: Sequence[int]) -> Integers:
    return np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]).astype(np.int64)


def _integers(values: Sequence[int]) -> Integers:
    return np.array(values, np.int64)
