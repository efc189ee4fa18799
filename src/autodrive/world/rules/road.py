"""The road: reports vehicles that leave the drivable area of the map, and that come back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.jit import jit_uncounted
from autodrive.base.transforms import rotate
from autodrive.physics.model import Table
from autodrive.physics.state import State
from autodrive.protocol.messages import BackOnRoad, Event, OffRoad
from autodrive.world.compile import CompiledScenario

Flags = NDArray[np.bool_]


class RoadColumns(NamedTuple):
    """n worlds with v vehicles."""

    is_off_road: Flags
    """Whether a wheel of the vehicle is outside the drivable area, shape (n, v)."""


class RoadMemory(NamedTuple):
    """Working memory of a tick."""

    has_changed: Flags
    """Whether `is_off_road` of the vehicle has changed in this tick, shape (v,)."""


def columns(c: CompiledScenario, n: int) -> RoadColumns:
    """Columns of n worlds of the scenario, all on the road."""
    return RoadColumns(np.zeros((n, len(c.vehicles)), np.bool_))


def memory(c: CompiledScenario) -> RoadMemory:
    """Working memory for one world of the scenario."""
    return RoadMemory(np.zeros(len(c.vehicles), np.bool_))


def begin(columns: RoadColumns, chosen: Integers) -> None:
    """Put the vehicles of the `chosen` worlds on the road, as before the first tick."""
    columns.is_off_road[chosen] = False


@jit_uncounted
def judge(k: int, edges: Floats, wheels: Table, state: State, columns: RoadColumns, memory: RoadMemory) -> bool:
    """Write whether each vehicle of world k is off the road; True if one has left the road or has come back.

    `edges`: of the drivable area, x0, y0, x1, y1 [m], shape (m, 4); a map without roads has none.
    """
    any_changed = False
    if edges.shape[0] > 0:
        for i in range(columns.is_off_road.shape[1]):
            is_outside = any_wheel_outside(edges, wheels, i, state.vehicle_position[i], state.vehicle_orientation[i])
            memory.has_changed[i] = is_outside != columns.is_off_road[k, i]
            columns.is_off_road[k, i] = is_outside
            any_changed |= memory.has_changed[i]
    return any_changed


def events(
    names: Sequence[str], columns: RoadColumns, memory: RoadMemory, position: Floats, time: float
) -> Iterator[Event]:
    """Events of a World in a tick that `judge` has judged; `position`: of the vehicles [m], shape (v, 3)."""
    for i in np.flatnonzero(memory.has_changed).tolist():
        kind = OffRoad if columns.is_off_road[0, i] else BackOnRoad
        yield kind(time, names[i], read_only_copy(position[i]))


@jit_uncounted
def any_wheel_outside(edges: Floats, wheels: Table, vehicle: int, position: Floats, orientation: Floats) -> bool:
    """Whether a wheel of the vehicle is outside the polygons whose edges are x0, y0, x1, y1, shape (n, 4)."""
    # a wheel is inside if a ray from it along x crosses an odd number of edges; one walk serves all four wheels
    xa, ya = _above(wheels[4 * vehicle]["hub"], position, orientation)
    xb, yb = _above(wheels[4 * vehicle + 1]["hub"], position, orientation)
    xc, yc = _above(wheels[4 * vehicle + 2]["hub"], position, orientation)
    xd, yd = _above(wheels[4 * vehicle + 3]["hub"], position, orientation)
    a = b = c = d = False
    low, high = min(ya, yb, yc, yd), max(ya, yb, yc, yd)
    for e in range(edges.shape[0]):
        edge = edges[e]
        if max(edge[1], edge[3]) < low or min(edge[1], edge[3]) > high:
            continue  # most edges are outside the range of y of the wheels
        a ^= _is_left_of(edge, xa, ya)
        b ^= _is_left_of(edge, xb, yb)
        c ^= _is_left_of(edge, xc, yc)
        d ^= _is_left_of(edge, xd, yd)
    return not (a and b and c and d)


@jit_uncounted
def _above(hub: Floats, position: Floats, orientation: Floats) -> tuple[float, float]:
    """Where a wheel is, seen from above [m]."""
    x, y, _ = rotate(orientation, hub)
    return x + position[0], y + position[1]


@jit_uncounted
def _is_left_of(edge: Floats, x: float, y: float) -> bool:
    """Whether a point is on the side of -x of an edge, within the edge's range of y."""
    x0, y0, x1, y1 = edge[0], edge[1], edge[2], edge[3]
    return (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
