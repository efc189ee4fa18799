"""Reports collisions and departures from the road as Events."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from autodrive.arrays import Floats
from autodrive.jit import jit_uncounted, resolved
from autodrive.model import Model, Table
from autodrive.physics.buffers import VehicleContacts
from autodrive.protocol.messages import BackOnRoad, Collision, Event, OffRoad
from autodrive.state import State
from autodrive.transforms import rotate

SEPARATION = 0.2
"""A contact that is interrupted for less than this [s] is the same collision: a pushed box rattles."""


class Referee:
    """Makes Events from contacts and positions; remembers which contacts and departures have been reported."""

    def __init__(
        self, names: Sequence[str], owners: Sequence[str], drivable_edges: Floats, ticks_per_second: float
    ) -> None:
        self._names = list(names)
        self._owners = list(owners)
        self._edges = drivable_edges
        self._separation_ticks = SEPARATION * ticks_per_second
        self._any_wheel_outside: Callable[..., bool] | None = None
        self.reset()

    def reset(self) -> None:
        """Forget everything, as before the first tick."""
        self.collision_counts = [0] * len(self._names)
        self._last_contact: dict[tuple[int, str], int] = {}
        self._is_off_road = [False] * len(self._names)

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return list(self.collision_counts), dict(self._last_contact), list(self._is_off_road)

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        counts, touches, off_road = saved
        self.collision_counts, self._last_contact, self._is_off_road = list(counts), dict(touches), list(off_road)

    def judge(self, tick: int, time: float, model: Model, state: State, contacts: VehicleContacts) -> tuple[Event, ...]:
        """What happened in the tick that ended at `time` [s]. Clears the contacts."""
        events: list[Event] = []
        if contacts.pair_count[0]:
            events += self._collisions(tick, time, contacts)
        if len(self._edges):
            events += self._road(time, model, state)
        return tuple(events)

    def _collisions(self, tick: int, time: float, contacts: VehicleContacts) -> list[Event]:
        impulses: dict[tuple[int, str], float] = {}
        places: dict[tuple[int, str], Floats] = {}
        pairs: Any = contacts.pairs[: contacts.pair_count[0]].tolist()
        for vehicle, geom in pairs:
            key = (vehicle, self._owners[geom])
            impulses[key] = impulses.get(key, 0.0) + float(contacts.impulse[vehicle, geom])
            places.setdefault(key, contacts.position[vehicle, geom].copy())
            contacts.impulse[vehicle, geom] = 0.0
        contacts.pair_count[0] = 0
        events: list[Event] = []
        for (vehicle, other), impulse in impulses.items():
            last = self._last_contact.get((vehicle, other))
            self._last_contact[vehicle, other] = tick
            if last is None or tick - last > self._separation_ticks:
                self.collision_counts[vehicle] += 1
                place = places[vehicle, other]
                place.flags.writeable = False
                events.append(Collision(time, self._names[vehicle], other, impulse, place))
        return events

    def _road(self, time: float, model: Model, state: State) -> list[Event]:
        events: list[Event] = []
        for i, name in enumerate(self._names):
            arguments = self._edges, model.wheels, i, state.vehicle_position[i], state.vehicle_orientation[i]
            if self._any_wheel_outside is None:
                self._any_wheel_outside = resolved(any_wheel_outside, *arguments)
            off = bool(self._any_wheel_outside(*arguments))
            if off != self._is_off_road[i]:
                self._is_off_road[i] = off
                place = state.vehicle_position[i].copy()
                place.flags.writeable = False
                events.append((OffRoad if off else BackOnRoad)(time, name, place))
        return events


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
