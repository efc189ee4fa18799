"""Closes a road: a chain of roads from one port to another, found by A* over the poses to which roads lead."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.module import ModuleSpec, Port
from autodrive.scenario.maps.placing import HEADING_TOLERANCE, PORT_TOLERANCE, PlacedPort
from autodrive.scenario.maps.shapes import Pose, moved
from autodrive.scenario.maps.spec import Placement

MAX_NODES = 4000
"""Poses from which the search goes on; about half a second."""
CELL = 0.5
"""Edge of the squares that say where solids are, in the frame of the first port [m]."""
PIECE_COST = 0.05
"""Cost of each piece of a chain, so that a long one is preferred to several short ones [m]."""
GAP = 1e-3
"""Pieces may touch: they are taken as narrower by this on each side [m]."""
QUARTER = 0.5 * math.pi


@dataclass(frozen=True)
class Chain:
    """Modules that connect two ports; empty if none were found."""

    placements: tuple[Placement, ...]
    miss: tuple[float, float] | None = None
    """How far the module of the end must be moved [m] to let a chain meet it, if there is no chain; None: not known."""


@dataclass(frozen=True)
class _Way:
    """A way through a module, seen from the port at which it is joined: x outward there."""

    module: str
    size: tuple[float, float]
    x: float
    y: float
    quarter: int
    """Pose of the module; headings in quarters of a turn."""
    exit_x: float
    exit_y: float
    exit_quarter: int
    """Pose of its other port, outward."""


@dataclass(frozen=True)
class _ChainEnd:
    """An end of a chain, in the frame of its first port."""

    x: float
    y: float
    quarter: int
    cost: float
    way: _Way | None = None
    before: _ChainEnd | None = None
    box: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """x_min, y_min, x_max, y_max of its module."""


class _Taken:
    """Where solids are, in the frame of the first port."""

    def __init__(self, solids: Sequence[BaseGeometry], origin: Pose) -> None:
        x, y, yaw = origin
        shapes = [shapely.transform(solid, lambda at: moved(at - (x, y), (0.0, 0.0, -yaw))) for solid in solids]
        self._tree = shapely.STRtree(shapes)
        self._cells = {cell for shape in shapes for cell in _cells(shape.bounds)}

    def meets(self, box: tuple[float, float, float, float]) -> bool:
        """Whether a solid is in a rectangle."""
        is_near = any(cell in self._cells for cell in _cells(box))
        return is_near and len(self._tree.query(shapely.box(*box), predicate="intersects")) > 0


def _cells(box: tuple[float, float, float, float]) -> Iterator[tuple[int, int]]:
    x0, y0, x1, y1 = (math.floor(value / CELL) for value in box)
    return product(range(x0, x1 + 1), range(y0, y1 + 1))


def closing_chain(
    start: PlacedPort, end: PlacedPort, modules: Mapping[str, ModuleSpec], solids: Sequence[BaseGeometry]
) -> Chain:
    """A chain of roads among `modules` (by name) from `start` to `end`, which overlaps no `solids` (in the map).

    Only roads with two ports as wide as the given ones are used. The search is deterministic and ends after `MAX_NODES`
    poses.
    """
    x0, y0, yaw0 = start.pose
    goal_x, goal_y = moved(np.array([[end.pose[0] - x0, end.pose[1] - y0]]), (0.0, 0.0, -yaw0))[0].tolist()
    turns = (end.pose[2] + math.pi - yaw0) / QUARTER
    if abs(turns - round(turns)) * QUARTER > HEADING_TOLERANCE:
        return Chain(())
    goal_quarter = round(turns) % 4
    ways = list(_ways(modules, start))
    taken = _Taken(solids, start.pose)
    nodes = [_ChainEnd(0.0, 0.0, 0, 0.0)]
    queue = [(abs(goal_x) + abs(goal_y), 0)]
    done: set[tuple[int, int, int]] = set()
    miss: tuple[float, float] | None = None
    while queue and len(done) < MAX_NODES:
        node = nodes[heapq.heappop(queue)[1]]
        key = (round(node.x / GAP), round(node.y / GAP), node.quarter)
        if key in done:
            continue
        done.add(key)
        if node.quarter == goal_quarter and node.way:
            gap = (node.x - goal_x, node.y - goal_y)
            if math.hypot(*gap) < 0.5 * PORT_TOLERANCE:
                return Chain(tuple(_placements(node, start.pose)))
            miss = min(miss or gap, gap, key=lambda offset: math.hypot(*offset))
        for way in ways:
            after = _after(node, way)
            if _is_free(after, taken):
                heapq.heappush(queue, (after.cost + abs(goal_x - after.x) + abs(goal_y - after.y), len(nodes)))
                nodes.append(after)
    return Chain((), miss and _in_map(miss, yaw0))


def _ways(modules: Mapping[str, ModuleSpec], port: PlacedPort) -> Iterator[_Way]:
    """Ways through the roads that fit to a port; a road that lies in the same way by both ports is there once."""
    seen: set[tuple[float, ...]] = set()
    for name, spec in sorted(modules.items()):
        ends = [port_spec for port_spec in spec.ports.values() if not port_spec.is_blind]
        fitting = [end for end in ends if abs(end.width - port.width) <= PORT_TOLERANCE and end.lanes == port.lanes]
        if spec.type != "road" or len(ends) != 2 or len(fitting) != 2:
            continue
        for entry, exit_ in (ends, reversed(ends)):
            way = _way(name, spec, entry, exit_)
            lies = (way.exit_x, way.exit_y, way.exit_quarter, way.x, way.y)
            if lies not in seen:
                seen.add(lies)
                yield way


def _way(name: str, spec: ModuleSpec, entry: Port, exit_: Port) -> _Way:
    quarter = round(2.0 - entry.yaw_deg * DEGREE / QUARTER)
    x, y = _turned(-entry.x, -entry.y, quarter)
    dx, dy = _turned(exit_.x, exit_.y, quarter)
    out = (quarter + round(exit_.yaw_deg * DEGREE / QUARTER)) % 4
    values = [round(value, 9) for value in (x, y, x + dx, y + dy)]
    return _Way(name, (spec.length, spec.width), values[0], values[1], quarter % 4, values[2], values[3], out)


def _after(node: _ChainEnd, way: _Way) -> _ChainEnd:
    dx, dy = _turned(way.exit_x, way.exit_y, node.quarter)
    mx, my = _turned(way.x, way.y, node.quarter)
    length, width = way.size if (node.quarter + way.quarter) % 2 == 0 else way.size[::-1]
    x, y, a, b = node.x + mx, node.y + my, 0.5 * length - GAP, 0.5 * width - GAP
    cost = node.cost + math.hypot(dx, dy) + PIECE_COST
    quarter = (node.quarter + way.exit_quarter) % 4
    return _ChainEnd(node.x + dx, node.y + dy, quarter, cost, way, node, (x - a, y - b, x + a, y + b))


def _is_free(node: _ChainEnd, taken: _Taken) -> bool:
    x0, y0, x1, y1 = node.box
    before = node.before
    while before and before.way:
        a0, b0, a1, b1 = before.box
        if x0 < a1 and a0 < x1 and y0 < b1 and b0 < y1:
            return False
        before = before.before
    return not taken.meets(node.box)


def _placements(last: _ChainEnd, origin: Pose) -> Iterator[Placement]:
    chain: list[_ChainEnd] = []
    node: _ChainEnd | None = last
    while node and node.way:
        chain.append(node)
        node = node.before
    for node in reversed(chain):
        way, before = node.way, node.before
        assert way
        assert before
        dx, dy = _turned(way.x, way.y, before.quarter)
        x, y = moved(np.array([[before.x + dx, before.y + dy]]), origin)[0].tolist()
        yaw = origin[2] + (before.quarter + way.quarter) * QUARTER
        yaw_deg = round(math.degrees(math.remainder(yaw, 2.0 * math.pi)), 6)
        yield Placement(module=way.module, x=round(x, 6), y=round(y, 6), yaw_deg=yaw_deg)


def _in_map(step: tuple[float, float], yaw: float) -> tuple[float, float]:
    at: Floats = moved(np.array([step]), (0.0, 0.0, yaw))[0]
    return float(at[0]), float(at[1])


def _turned(x: float, y: float, quarter: int) -> tuple[float, float]:
    return ((x, y), (-y, x), (-x, -y), (y, -x))[quarter % 4]
