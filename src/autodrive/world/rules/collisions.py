"""Collisions: reports contacts of vehicles with other vehicles, objects and the map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only_copy
from autodrive.base.jit import jit_uncounted
from autodrive.physics.buffers import VehicleContacts
from autodrive.protocol.messages import Collision, Event
from autodrive.world.compile import CompiledScenario

SEPARATION = 0.2
"""A contact that is interrupted for less than this [s] is the same collision: a pushed box rattles."""

NEVER = -(2**62)
"""Stands for the tick of the last contact of a vehicle with an object that it has not touched."""


class CollisionTable(NamedTuple):
    """What does not change."""

    owner: Integers
    """Number of the object, in the order of `objects_of`, to which each solid belongs; see `VehicleContacts`."""
    separation: float
    """`SEPARATION` [ticks]."""


class CollisionColumns(NamedTuple):
    """n worlds with v vehicles and m objects, which are also the vehicles and the parts of the map."""

    last_contact: Integers
    """Tick of the last contact of each vehicle with each object, shape (n, v, m)."""
    total: Integers
    """Collisions since the reset, shape (n, v)."""
    has_collided: NDArray[np.bool_]
    """Whether there was a new collision since the caller has cleared this, shape (n, v)."""


class CollisionMemory(NamedTuple):
    """The vehicles that touch an object in a tick, in p rows; those whose collision begins come first."""

    pair: Integers
    """Numbers of the vehicle and the object, shape (p, 2)."""
    impulse: Floats
    """Sum of the impulses of the contacts of both [N s], shape (p,)."""
    place: Floats
    """Position of the first contact of both in the map [m], shape (p, 3)."""
    begun: Integers
    """Number of collisions that begin, shape (1,)."""


def objects_of(c: CompiledScenario) -> list[str]:
    """Names of all that a vehicle can touch."""
    return list(dict.fromkeys(c.owners))


def table(c: CompiledScenario) -> CollisionTable:
    """What does not change in a scenario."""
    numbers = {name: number for number, name in enumerate(objects_of(c))}
    return CollisionTable(np.array([numbers[name] for name in c.owners], np.int64), SEPARATION / c.spec.tick)


def columns(c: CompiledScenario, n: int) -> CollisionColumns:
    """Columns of n worlds of the scenario, in which nothing has touched."""
    v = len(c.vehicles)
    return CollisionColumns(
        last_contact=np.full((n, v, len(objects_of(c))), NEVER),
        total=np.zeros((n, v), np.int64),
        has_collided=np.zeros((n, v), np.bool_),
    )


def memory(c: CompiledScenario) -> CollisionMemory:
    """Working memory for one world of the scenario."""
    p = len(c.contacts.pairs)
    return CollisionMemory(np.zeros((p, 2), np.int64), np.zeros(p), np.zeros((p, 3)), np.zeros(1, np.int64))


def begin(columns: CollisionColumns, chosen: Integers) -> None:
    """Forget all contacts of the `chosen` worlds, as before the first tick."""
    columns.last_contact[chosen] = NEVER
    columns.total[chosen] = 0
    columns.has_collided[chosen] = False


def take_over(
    c: CompiledScenario, columns: CollisionColumns, before: CompiledScenario, before_columns: CollisionColumns
) -> None:
    """Set the columns of a World to those of another World with the same vehicles, whose objects may differ."""
    columns.total[:] = before_columns.total
    columns.last_contact[:] = NEVER
    numbers = {name: number for number, name in enumerate(objects_of(before))}
    for number, name in enumerate(objects_of(c)):
        if name in numbers:
            columns.last_contact[:, :, number] = before_columns.last_contact[:, :, numbers[name]]


@jit_uncounted
def judge(
    k: int,
    tick: int,
    contacts: VehicleContacts,
    table: CollisionTable,
    columns: CollisionColumns,
    memory: CollisionMemory,
) -> bool:
    """Count the collisions of world k that begin in this tick, and clear the contacts; True if one begins."""
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
            memory.impulse[row] = 0.0
            for axis in range(3):
                memory.place[row, axis] = contacts.position[vehicle, solid, axis]
        memory.impulse[row] += contacts.impulse[vehicle, solid]
        contacts.impulse[vehicle, solid] = 0.0
    contacts.pair_count[0] = 0
    # a collision begins if the last contact with that object is long ago; such rows move to the front
    begun = 0
    for row in range(touching):
        vehicle, other = memory.pair[row, 0], memory.pair[row, 1]
        before = columns.last_contact[k, vehicle, other]
        columns.last_contact[k, vehicle, other] = tick
        if tick - before <= table.separation:
            continue
        columns.total[k, vehicle] += 1
        columns.has_collided[k, vehicle] = True
        memory.pair[begun, 0], memory.pair[begun, 1] = vehicle, other
        memory.impulse[begun] = memory.impulse[row]
        for axis in range(3):
            memory.place[begun, axis] = memory.place[row, axis]
        begun += 1
    memory.begun[0] = begun
    return begun > 0


def events(names: Sequence[str], objects: Sequence[str], memory: CollisionMemory, time: float) -> Iterator[Event]:
    """Events of the tick that `judge` has judged; `names`: of the vehicles, `objects`: see `objects_of`."""
    for row in range(int(memory.begun[0])):
        vehicle, other = int(memory.pair[row, 0]), int(memory.pair[row, 1])
        yield Collision(
            time, names[vehicle], objects[other], float(memory.impulse[row]), read_only_copy(memory.place[row])
        )


@jit_uncounted
def forget(contacts: VehicleContacts) -> None:
    """Clear the contacts of a tick that nobody judges."""
    for p in range(contacts.pair_count[0]):
        contacts.impulse[contacts.pairs[p, 0], contacts.pairs[p, 1]] = 0.0
    contacts.pair_count[0] = 0
