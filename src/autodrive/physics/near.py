"""The fixed shapes near the bodies are in slots of the engine, whose model does not contain the map.

A slot is a geom of the engine that becomes one fixed shape after the other. The slots hold all fixed shapes that a body
can touch, in ascending order, so that contacts and their order are those of an engine with the whole map. There are as
many slots as the bodies can need at any place.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.physics.clearance import distance
from autodrive.physics.grid import fixed_near, most_within
from autodrive.physics.model import CYLINDER, ShapeTable

SLACK = 0.1
"""A body can move so far [m] until the slots are filled again."""

AHEAD = 0.05
"""The slots also hold the shapes that are so far [m] from what a body can reach until then."""

Numbers32 = NDArray[np.int32]


class Slots(NamedTuple):
    """The slots of an engine, and its memory that they need. Geom 0 is the floor, geom 1 the first slot.

    The tree is that of the boxes around the geoms of the world body, with which the engine finds what can touch.
    """

    shape: Integers
    """Numbers of the fixed shapes in the first slots, ascending, shape (n_slot,)."""
    solid: Integers
    """Solid of each geom of the engine: 0 for the floor, otherwise 1 + the number of its shape, shape (n_geom,)."""
    reach: Floats
    """Distance of the farthest point of each body from its origin [m], shape (n_body,)."""
    filled_at: Floats
    """Where the bodies were when the slots were filled [m], shape (n_body, 3)."""
    nearby: Integers
    """Working memory of `fill`, shape (n_fixed,)."""
    kind: Numbers32
    """Kind of each geom, as in `ShapeTable`, as are size and bounding radius; shape (n_geom,)."""
    size: Floats
    bounding_radius: Floats
    box: Floats
    """Centre and half sizes of the box around each geom in its own axes [m], shape (n_geom, 6)."""
    position: Floats
    """Centre of each geom in the map [m], shape (n_geom, 3)."""
    rotation: Floats
    """Rotation matrix of each geom, map from geom, row-major, shape (n_geom, 9)."""
    tree_children: Numbers32
    """The nodes below each node of the tree, or -1, shape (n_node, 2)."""
    tree_geom: Numbers32
    """Geom of each node without nodes below it; -1 for the others, shape (n_node,)."""
    tree_box: Floats
    """Centre and half sizes of a box around all geoms below each node [m], shape (n_node, 6)."""


EVERYWHERE = 1.0e10
"""Half size [m] of a box without limits (mjMAXVAL)."""


def slot_count(fixed: ShapeTable, reach: Floats) -> int:
    """How many slots bodies with that `reach` (see `Slots`) can need among these fixed shapes."""
    reaches, counts = np.unique(reach, return_counts=True)
    most = [
        count * most_within(fixed, reach_of_body + SLACK + AHEAD)
        for reach_of_body, count in zip(reaches.tolist(), counts, strict=True)
    ]
    return min(int(sum(most)), len(fixed.kind))


@inlined
def hold_near(shapes: ShapeTable, qpos: Floats, slots: Slots) -> bool:
    """Fills the slots if a body is so far from where it was that it may touch another shape; whether it was.

    `qpos`: as `State.qpos`.
    """
    if slots.shape.shape[0] > 0:
        for b in range(slots.reach.shape[0]):
            x, y, z = (
                qpos[7 * b] - slots.filled_at[b, 0],
                qpos[7 * b + 1] - slots.filled_at[b, 1],
                qpos[7 * b + 2] - slots.filled_at[b, 2],
            )
            if x * x + y * y + z * z > SLACK * SLACK:
                fill(shapes, qpos, slots)
                return True
    return False


@inlined
def forget(slots: Slots) -> None:
    """Has the slots filled again before the next step, because the engine has placed them elsewhere."""
    slots.filled_at[:] = inf


@jit_uncounted
def fill(shapes: ShapeTable, qpos: Floats, slots: Slots) -> None:
    """Puts the fixed shapes near the bodies at `qpos` into the slots, and the used slots into the tree."""
    count = 0
    for b in range(slots.reach.shape[0]):
        x, y, z = float(qpos[7 * b]), float(qpos[7 * b + 1]), float(qpos[7 * b + 2])
        slots.filled_at[b, 0], slots.filled_at[b, 1], slots.filled_at[b, 2] = x, y, z
        far = slots.reach[b] + SLACK + AHEAD
        for k in range(fixed_near(shapes.grid, x, y, far, slots.nearby, 0)):
            s = slots.nearby[k]
            if distance(int(shapes.kind[s]), shapes.size[s], shapes.position[s], shapes.rotation[s], x, y, z) <= far:
                count = _insert(s, slots.shape, count)
    for k in range(count):
        _set(k + 1, slots.shape[k], shapes, slots)
    _build_tree(count, slots)


@inlined
def _insert(s: int, numbers: Integers, count: int) -> int:
    """Adds a number to the first `count` ascending ones, if it is not among them; returns how many there are then."""
    k = count
    while k > 0 and numbers[k - 1] > s:
        k -= 1
    if k > 0 and numbers[k - 1] == s:
        return count
    for j in range(count, k, -1):
        numbers[j] = numbers[j - 1]
    numbers[k] = s
    return count + 1


@inlined
def _set(geom: int, s: int, shapes: ShapeTable, slots: Slots) -> None:
    """Lets a slot be shape s."""
    slots.solid[geom] = 1 + s
    slots.kind[geom] = shapes.kind[s]
    slots.bounding_radius[geom] = shapes.bounding_radius[s]
    for axis in range(3):
        slots.size[geom, axis] = shapes.size[s, axis]
        slots.position[geom, axis] = shapes.position[s, axis]
        slots.box[geom, axis] = 0.0
        slots.box[geom, 3 + axis] = shapes.size[s, axis]
    if shapes.kind[s] == CYLINDER:
        slots.box[geom, 4], slots.box[geom, 5] = shapes.size[s, 0], shapes.size[s, 1]
    for k in range(9):
        slots.rotation[geom, k] = shapes.rotation[s, k]


@inlined
def _build_tree(count: int, slots: Slots) -> None:
    """Makes the tree of the floor and `count` slots: below the root the floor and a binary heap of the slots."""
    for axis in range(3):
        slots.tree_box[0, axis], slots.tree_box[0, 3 + axis] = 0.0, EVERYWHERE
        slots.tree_box[1, axis], slots.tree_box[1, 3 + axis] = slots.box[0, axis], slots.box[0, 3 + axis]
    slots.tree_geom[0], slots.tree_children[0, 0], slots.tree_children[0, 1] = -1, 1, 2 if count > 0 else -1
    slots.tree_geom[1], slots.tree_children[1, 0], slots.tree_children[1, 1] = 0, -1, -1
    for node in range(2 * count, 1, -1):
        if node > count:
            geom = node - count
            slots.tree_geom[node], slots.tree_children[node, 0], slots.tree_children[node, 1] = geom, -1, -1
            for axis in range(3):
                slots.tree_box[node, axis] = slots.position[geom, axis]
                slots.tree_box[node, 3 + axis] = 0.0
                for k in range(3):
                    slots.tree_box[node, 3 + axis] += abs(slots.rotation[geom, 3 * axis + k]) * slots.box[geom, 3 + k]
        else:
            first = 2 * node - 1  # node 2 is the first of the heap
            slots.tree_geom[node], slots.tree_children[node, 0], slots.tree_children[node, 1] = -1, first, first + 1
            for axis in range(3):
                a, b = slots.tree_box[first], slots.tree_box[first + 1]
                low = min(a[axis] - a[3 + axis], b[axis] - b[3 + axis])
                high = max(a[axis] + a[3 + axis], b[axis] + b[3 + axis])
                slots.tree_box[node, axis] = 0.5 * (low + high)
                slots.tree_box[node, 3 + axis] = 0.5 * (high - low)
