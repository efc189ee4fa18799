"""Collisions: reports contacts of vehicles with other vehicles, objects and the map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.jit import jit_uncounted
from autodrive.physics.buffers import VehicleContacts
from autodrive.protocol.messages import Collision, CollisionEnded, Event
from autodrive.world.compile import CompiledScenario

SEPARATION = 0.2
"""A contact that is interrupted for less than this [s] is the same collision: a pushed box rattles, and a car touches
one part of a wall after the other."""

NEVER = -(2**62)
"""Stands for the tick of the last contact of a vehicle with an object that it has not touched."""


class CollisionTable(NamedTuple):
    """What does not change."""

    owner: Integers
    """Number of the object, in the order of `_objects_of`, to which each solid belongs; see `VehicleContacts`."""
    separation: float
    """`SEPARATION` [ticks]."""


class CollisionColumns(NamedTuple):
    """n worlds with v vehicles and m objects, which are also the vehicles and the objects of the map."""

    last_contact: Integers
    """Tick of the last contact of each vehicle with each object, shape (n, v, m)."""
    start: Integers
    """Tick in which the present collision with each object began, shape (n, v, m)."""
    impulse: Floats
    """Sum of the impulses of the present collision with each object [N s], 0 without a collision, shape (n, v, m)."""
    solid: Integers
    """The solid of each object that the present collision has touched first, shape (n, v, m)."""
    present: Integers
    """Number of present collisions, shape (n, v)."""
    total: Integers
    """Collisions since the reset, shape (n, v)."""
    has_collided: NDArray[np.bool_]
    """Whether there was a new collision since the caller has cleared this, shape (n, v)."""


class CollisionMemory(NamedTuple):
    """The vehicles that touch an object in a tick, in p rows, and the collisions that end in this tick.

    The rows whose collision begins come first.
    """

    pair: Integers
    """Numbers of the vehicle and the object, shape (p, 2)."""
    impulse: Floats
    """Sum of the impulses of the contacts of both [N s], shape (p,)."""
    place: Floats
    """Position of the first contact of both in the map [m], shape (p, 3)."""
    solid: Integers
    """The solid that was touched first, shape (p,)."""
    begun: Integers
    """Number of collisions that begin, shape (1,)."""
    ended: Integers
    """Vehicle and solid of the collisions that end, and how long each of them was [ticks], shape (p, 3)."""
    sum: Floats
    """Impulse of each of these collisions [N s], shape (p,)."""
    ended_count: Integers
    """Number of collisions that end, shape (1,)."""


def _objects_of(c: CompiledScenario) -> list[str]:
    """The object to which each solid belongs: a vehicle, a box, the ground, or all parts of an object of the map.

    No name of a vehicle or box begins with a slash.
    """
    fixed = [f"/{shape.object}" for shape in c.map.statics]
    return [c.owners[0], *fixed, *c.owners[1 + len(fixed) :]]


def table(c: CompiledScenario) -> CollisionTable:
    """What does not change in a scenario."""
    objects = _objects_of(c)
    numbers = {name: number for number, name in enumerate(dict.fromkeys(objects))}
    return CollisionTable(np.array([numbers[name] for name in objects], np.int64), SEPARATION / c.spec.tick)


def columns(c: CompiledScenario, n: int) -> CollisionColumns:
    """Columns of n worlds of the scenario, in which nothing has touched."""
    v, m = len(c.vehicles), len(set(_objects_of(c)))
    return CollisionColumns(
        last_contact=np.full((n, v, m), NEVER),
        start=np.zeros((n, v, m), np.int64),
        impulse=np.zeros((n, v, m)),
        solid=np.zeros((n, v, m), np.int64),
        present=np.zeros((n, v), np.int64),
        total=np.zeros((n, v), np.int64),
        has_collided=np.zeros((n, v), np.bool_),
    )


def memory(c: CompiledScenario) -> CollisionMemory:
    """Working memory for one world of the scenario."""
    p = len(c.contacts.pairs)
    return CollisionMemory(
        pair=np.zeros((p, 2), np.int64),
        impulse=np.zeros(p),
        place=np.zeros((p, 3)),
        solid=np.zeros(p, np.int64),
        begun=np.zeros(1, np.int64),
        ended=np.zeros((p, 3), np.int64),
        sum=np.zeros(p),
        ended_count=np.zeros(1, np.int64),
    )


def begin(columns: CollisionColumns, chosen: Integers) -> None:
    """Forget all contacts of the `chosen` worlds, as before the first tick."""
    columns.last_contact[chosen] = NEVER
    columns.impulse[chosen] = 0.0
    columns.present[chosen] = columns.total[chosen] = 0
    columns.has_collided[chosen] = False


def take_over(
    c: CompiledScenario, columns: CollisionColumns, before: CompiledScenario, before_columns: CollisionColumns
) -> None:
    """Set the columns of a World to those of another World with the same vehicles, whose objects may differ."""
    columns.total[:] = before_columns.total
    columns.last_contact[:] = NEVER
    columns.impulse[:] = 0.0
    objects, solids = _objects_of(c), c.owners
    numbers = {name: number for number, name in enumerate(dict.fromkeys(_objects_of(before)))}
    for number, name in enumerate(dict.fromkeys(objects)):
        if name in numbers:
            columns.last_contact[:, :, number] = before_columns.last_contact[:, :, numbers[name]]
            columns.start[:, :, number] = before_columns.start[:, :, numbers[name]]
            columns.impulse[:, :, number] = before_columns.impulse[:, :, numbers[name]]
            for i, solid in enumerate(before_columns.solid[0, :, numbers[name]].tolist()):
                touched = before.owners[solid]
                columns.solid[0, i, number] = solids.index(
                    touched if touched in solids else solids[objects.index(name)]
                )
    columns.present[:] = np.count_nonzero(columns.impulse, axis=2)


@jit_uncounted
def judge(
    k: int,
    tick: int,
    contacts: VehicleContacts,
    table: CollisionTable,
    columns: CollisionColumns,
    memory: CollisionMemory,
) -> bool:
    """Count the collisions of world k that begin in this tick, and clear the contacts; True if one begins or ends."""
    # contacts of a vehicle with the solids of one object are one row: the first gives its place, all its impulse
    touching = 0
    for p in range(contacts.pair_count[0]):
        vehicle, solid = contacts.pairs[p, 0], contacts.pairs[p, 1]
        other = table.owner[solid]
        row = 0
        while row < touching and not (memory.pair[row, 0] == vehicle and memory.pair[row, 1] == other):
            row += 1
        if row == touching:
            touching += 1
            memory.pair[row, 0], memory.pair[row, 1] = vehicle, other
            memory.solid[row] = solid
            memory.impulse[row] = 0.0
            for axis in range(3):
                memory.place[row, axis] = contacts.position[vehicle, solid, axis]
        memory.impulse[row] += contacts.impulse[vehicle, solid]
        contacts.impulse[vehicle, solid] = 0.0
    contacts.pair_count[0] = 0
    # a collision ends when the last contact with that object is long ago
    ended = 0
    for vehicle in range(columns.present.shape[1]):
        if columns.present[k, vehicle] == 0:
            continue
        for other in range(columns.impulse.shape[2]):
            if columns.impulse[k, vehicle, other] > 0.0 and ended < memory.sum.shape[0]:
                last = columns.last_contact[k, vehicle, other]
                if tick - last > table.separation:
                    memory.ended[ended, 0], memory.ended[ended, 1] = vehicle, columns.solid[k, vehicle, other]
                    memory.ended[ended, 2] = last + 1 - columns.start[k, vehicle, other]
                    memory.sum[ended] = columns.impulse[k, vehicle, other]
                    columns.impulse[k, vehicle, other] = 0.0
                    columns.present[k, vehicle] -= 1
                    ended += 1
    memory.ended_count[0] = ended
    # the rows of the collisions that begin move to the front
    begun = 0
    for row in range(touching):
        vehicle, other = memory.pair[row, 0], memory.pair[row, 1]
        before = columns.last_contact[k, vehicle, other]
        columns.last_contact[k, vehicle, other] = tick
        columns.impulse[k, vehicle, other] += memory.impulse[row]
        if tick - before <= table.separation:
            continue
        columns.start[k, vehicle, other], columns.solid[k, vehicle, other] = tick, memory.solid[row]
        columns.present[k, vehicle] += 1
        columns.total[k, vehicle] += 1
        columns.has_collided[k, vehicle] = True
        memory.pair[begun, 0], memory.pair[begun, 1] = vehicle, other
        memory.impulse[begun], memory.solid[begun] = memory.impulse[row], memory.solid[row]
        for axis in range(3):
            memory.place[begun, axis] = memory.place[row, axis]
        begun += 1
    memory.begun[0] = begun
    return begun + ended > 0


def events(c: CompiledScenario, memory: CollisionMemory, time: float) -> Iterator[Event]:
    """Events of the tick that `judge` has judged."""
    names = list(c.vehicles)
    for row in range(int(memory.ended_count[0])):
        vehicle, solid, ticks = memory.ended[row].tolist()
        yield CollisionEnded(time, names[vehicle], c.owners[solid], float(memory.sum[row]), ticks * c.spec.tick)
    for row in range(int(memory.begun[0])):
        vehicle, other = names[memory.pair[row, 0]], c.owners[memory.solid[row]]
        yield Collision(time, vehicle, other, float(memory.impulse[row]), read_only_copy(memory.place[row]))


@jit_uncounted
def forget(contacts: VehicleContacts) -> None:
    """Clear the contacts of a tick that nobody judges."""
    for p in range(contacts.pair_count[0]):
        contacts.impulse[contacts.pairs[p, 0], contacts.pairs[p, 1]] = 0.0
    contacts.pair_count[0] = 0
