"""Reports collisions and departures from the road as Events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.elementary import register_jitable
from autodrive.base.jit import jit_uncounted, resolved
from autodrive.base.transforms import rotate
from autodrive.physics.buffers import VehicleContacts
from autodrive.physics.model import Model, Table
from autodrive.physics.state import State
from autodrive.protocol.messages import BackOnRoad, Collision, Event, OffRoad

Flags = NDArray[np.bool_]

SEPARATION = 0.2
"""A contact that is interrupted for less than this [s] is the same collision: a pushed box rattles."""

NEVER = -(2**62)
"""The tick of a contact that has not been."""


class Referee:
    """Makes Events from contacts and positions; remembers which contacts and departures have been reported."""

    def __init__(
        self, names: Sequence[str], owners: Sequence[str], drivable_edges: Floats, ticks_per_second: float
    ) -> None:
        self._names = list(names)
        self._others = list(dict.fromkeys(owners))
        self._owners = [self._others.index(owner) for owner in owners]
        self._last_contact = np.full((len(names), len(self._others)), NEVER)
        self._edges = drivable_edges
        self._separation_ticks = SEPARATION * ticks_per_second
        self._is_off_road = np.zeros(len(names), np.bool_)
        self._has_changed = np.zeros(len(names), np.bool_)
        self._update_off_road: Callable[..., bool] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything, as before the first tick."""
        self.collision_counts = [0] * len(self._names)
        self._last_contact[:] = NEVER
        self._is_off_road[:] = False

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        last_contact = dict(zip(self._others, self._last_contact.T.copy(), strict=True))
        return list(self.collision_counts), last_contact, self._is_off_road.copy()

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`, which may be that of a world with other objects."""
        counts, last_contact, self._is_off_road[:] = saved
        self.collision_counts = list(counts)
        for other, column in zip(self._others, self._last_contact.T, strict=True):
            column[:] = last_contact.get(other, NEVER)

    def judge(self, tick: int, time: float, model: Model, state: State, contacts: VehicleContacts) -> tuple[Event, ...]:
        """What happened in the tick that ended at `time` [s]. Clears the contacts."""
        events: list[Event] = []
        if contacts.pair_count[0]:
            events += self._collisions(tick, time, contacts)
        if len(self._edges):
            events += self._road(time, model, state)
        return tuple(events)

    def _collisions(self, tick: int, time: float, contacts: VehicleContacts) -> list[Event]:
        impulses: dict[tuple[int, int], float] = {}
        places: dict[tuple[int, int], Floats] = {}
        pairs: Any = contacts.pairs[: contacts.pair_count[0]].tolist()
        for vehicle, solid in pairs:
            key = (vehicle, self._owners[solid])
            impulses[key] = impulses.get(key, 0.0) + float(contacts.impulse[vehicle, solid])
            places.setdefault(key, read_only_copy(contacts.position[vehicle, solid]))
            contacts.impulse[vehicle, solid] = 0.0
        contacts.pair_count[0] = 0
        events: list[Event] = []
        for (vehicle, other), impulse in impulses.items():
            if begins_collision(self._last_contact, vehicle, other, tick, self._separation_ticks):
                self.collision_counts[vehicle] += 1
                name, place = self._others[other], places[vehicle, other]
                events.append(Collision(time, self._names[vehicle], name, impulse, place))
        return events

    def _road(self, time: float, model: Model, state: State) -> list[Event]:
        arguments = self._edges, model.wheels, state.vehicle_position, state.vehicle_orientation, self._is_off_road
        if self._update_off_road is None:
            self._update_off_road = resolved(update_off_road, *arguments, self._has_changed)
        if not self._update_off_road(*arguments, self._has_changed):
            return []
        return [
            (OffRoad if self._is_off_road[i] else BackOnRoad)(
                time, self._names[i], read_only_copy(state.vehicle_position[i])
            )
            for i in np.flatnonzero(self._has_changed).tolist()
        ]


@register_jitable
def begins_collision(last_contact: Integers, vehicle: int, other: int, tick: int, separation: float) -> bool:
    """Note a contact; whether it begins a collision, after more than `separation` ticks without one.

    `last_contact`: tick of the last contact of each vehicle with each object, shape (n, n_object).
    """
    before = last_contact[vehicle, other]
    last_contact[vehicle, other] = tick
    return tick - before > separation


@jit_uncounted
def update_off_road(
    edges: Floats, wheels: Table, position: Floats, orientation: Floats, is_off_road: Flags, has_changed: Flags
) -> bool:
    """Write whether a wheel of each vehicle is outside the edges, and whether this has changed; True if any has."""
    any_changed = False
    for i in range(is_off_road.shape[0]):
        is_outside = any_wheel_outside(edges, wheels, i, position[i], orientation[i])
        has_changed[i] = is_outside != is_off_road[i]
        is_off_road[i] = is_outside
        any_changed |= has_changed[i]
    return any_changed


@jit_uncounted
def any_wheel_outside(edges: Floats, wheels: Table, vehicle: int, position: Floats, orientation: Floats) -> bool:
    """Whether a wheel of the vehicle is outside the polygons whose edges are x0, y0, x1, y1, shape (n, 4)."""
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
