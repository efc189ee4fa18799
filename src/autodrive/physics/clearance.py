"""How far a vehicle can move before anything can touch it. As long as it has moved less, it needs no contact engine.

The test is conservative: it takes the vehicle as a sphere around its colliders; near what this sphere touches, as a few
smaller spheres along its length, which together cover the colliders; and for the floor as the box around the colliders
that the floor stops. Wheels stand on the ground by their suspension, without a contact.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined
from autodrive.base.transforms import Vector
from autodrive.physics.buffers import Scratch
from autodrive.physics.free_body import rotated, rotation_at
from autodrive.physics.grid import shapes_near
from autodrive.physics.model import BOX, COVER, CYLINDER, Model
from autodrive.physics.state import State

HORIZON = 0.25
"""Shapes that are farther from a vehicle than this [m], and twice the way that it makes in the tick, are ignored."""

MARGIN = 1.0e-4
"""A clearance below this [m], and the way of a substep, counts as contact."""

CLOSE = 0.05
"""The small spheres of a vehicle decide if the sphere around it is nearer to something than this [m]."""


@inlined
def find_nearby(i: int, model: Model, state: State, scratch: Scratch, duration: float) -> None:
    """Lists the shapes that vehicle i can touch, or stand on with a wheel, in the next `duration` [s]."""
    v = model.vehicles[i]
    x, y, z = _centre(v, state.qpos)
    dof = v["dof"]
    vx, vy, vz = state.qvel[dof], state.qvel[dof + 1], state.qvel[dof + 2]
    scratch.horizon[i] = HORIZON + 2.0 * duration * sqrt(vx * vx + vy * vy + vz * vz)
    reach = v["reach"] + scratch.horizon[i]
    nearby = scratch.nearby[i]
    candidates = shapes_near(model.shapes, x, y, reach, nearby)
    count = 0
    for k in range(candidates):
        s = nearby[k]
        if model.shapes.vehicle[s] == i:
            continue
        centre = state.shape_position[s]
        dx, dy, dz = centre[0] - x, centre[1] - y, centre[2] - z
        far = reach + model.shapes.bounding_radius[s]
        if dx * dx + dy * dy + dz * dz < far * far:
            nearby[count] = s
            count += 1
    scratch.nearby_count[i] = count
    scratch.clearance[i] = -1.0


@inlined
def can_any_touch(model: Model, state: State, scratch: Scratch) -> bool:
    """Whether a vehicle may touch something in this substep. After `find_nearby`, and `path` for each one since."""
    touching = False
    for i in range(model.vehicles.shape[0]):
        least = MARGIN + path(model.vehicles[i], state.qvel, model.dt)
        if scratch.clearance[i] <= least:
            scratch.clearance[i] = _clearance(i, model, state, scratch)
            touching = touching or scratch.clearance[i] <= least
    return touching


@inlined
def path(v: Any, qvel: Floats, dt: float) -> float:
    """How far any point of a vehicle moves in a substep with its present velocity [m]."""
    dof, c = v["dof"], v["sphere_centre"]
    vx, vy, vz = qvel[dof], qvel[dof + 1], qvel[dof + 2]
    wx, wy, wz = qvel[dof + 3], qvel[dof + 4], qvel[dof + 5]
    arm = v["sphere_radius"] + sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    return dt * (sqrt(vx * vx + vy * vy + vz * vz) + arm * sqrt(wx * wx + wy * wy + wz * wz))


@inlined
def _clearance(i: int, model: Model, state: State, scratch: Scratch) -> float:
    v = model.vehicles[i]
    x, y, z = _centre(v, state.qpos)
    least = min(scratch.horizon[i], _height(v, state.qpos))
    for k in range(scratch.nearby_count[i]):
        s = scratch.nearby[i, k]
        if model.shapes.vehicle[s] < 0:
            gap = _distance_to(s, model, state, x, y, z) - v["sphere_radius"]
            if gap <= CLOSE:
                gap = max(gap, _gap_to_shape(v, s, model, state))
            least = min(least, gap)
    for j in range(model.vehicles.shape[0]):
        if j != i:
            other = model.vehicles[j]
            ox, oy, oz = _centre(other, state.qpos)
            dx, dy, dz = ox - x, oy - y, oz - z
            gap = sqrt(dx * dx + dy * dy + dz * dz) - v["sphere_radius"] - other["sphere_radius"]
            if gap <= CLOSE:
                gap = max(gap, _gap_to_vehicle(v, other, state.qpos))
            least = min(least, 0.5 * gap)  # both may move
    return least


@inlined
def _gap_to_shape(v: Any, s: int, model: Model, state: State) -> float:
    """Least distance [m] of the small spheres of a vehicle to shape s."""
    least = HORIZON
    for k in range(COVER):
        x, y, z = _centre_of_part(v, k, state.qpos)
        least = min(least, _distance_to(s, model, state, x, y, z) - v["cover"][k, 3])
    return least


@inlined
def _gap_to_vehicle(v: Any, other: Any, q: Floats) -> float:
    """Least distance [m] between the small spheres of two vehicles; `q` is `State.qpos`."""
    least = HORIZON
    for k in range(COVER):
        x, y, z = _centre_of_part(v, k, q)
        for n in range(COVER):
            ox, oy, oz = _centre_of_part(other, n, q)
            dx, dy, dz = ox - x, oy - y, oz - z
            distance = sqrt(dx * dx + dy * dy + dz * dz)
            least = min(least, distance - v["cover"][k, 3] - other["cover"][n, 3])
    return least


@inlined
def _centre(v: Any, q: Floats) -> Vector:
    """Centre of the sphere around a vehicle in the map; `q` is `State.qpos`."""
    at, c = v["qpos"], v["sphere_centre"]
    x, y, z = rotated(rotation_at(q, at + 3), c[0], c[1], c[2])
    return float(q[at]) + x, float(q[at + 1]) + y, float(q[at + 2]) + z


@inlined
def _centre_of_part(v: Any, k: int, q: Floats) -> Vector:
    """Centre of small sphere k of a vehicle in the map; `q` is `State.qpos`."""
    at, c = v["qpos"], v["cover"]
    x, y, z = rotated(rotation_at(q, at + 3), c[k, 0], c[k, 1], c[k, 2])
    return float(q[at]) + x, float(q[at + 1]) + y, float(q[at + 2]) + z


@inlined
def _height(v: Any, q: Floats) -> float:
    """Height of the chassis of a vehicle above the floor [m]; `q` is `State.qpos`."""
    at, low, high = v["qpos"], v["chassis_low"], v["chassis_high"]
    _, _, _, _, _, _, r20, r21, r22 = rotation_at(q, at + 3)
    return (
        q[at + 2]
        + min(r20 * low[0], r20 * high[0])
        + min(r21 * low[1], r21 * high[1])
        + min(r22 * low[2], r22 * high[2])
    )


@inlined
def _distance_to(s: int, model: Model, state: State, x: float, y: float, z: float) -> float:
    """Distance [m] of a point in the map to shape s."""
    shapes = model.shapes
    return distance(int(shapes.kind[s]), shapes.size[s], state.shape_position[s], state.shape_rotation[s], x, y, z)


@inlined
def distance(kind: int, size: Floats, centre: Floats, m: Floats, px: float, py: float, pz: float) -> float:
    """Distance [m] of a point in the map to a shape with that centre and rotation matrix (map from shape)."""
    dx, dy, dz = px - centre[0], py - centre[1], pz - centre[2]
    x, y, z = (
        abs(m[0] * dx + m[3] * dy + m[6] * dz),
        abs(m[1] * dx + m[4] * dy + m[7] * dz),
        abs(m[2] * dx + m[5] * dy + m[8] * dz),
    )
    if kind == BOX:
        x, y, z = max(0.0, x - size[0]), max(0.0, y - size[1]), max(0.0, z - size[2])
    elif kind == CYLINDER:
        x, y, z = max(0.0, sqrt(x * x + y * y) - size[0]), 0.0, max(0.0, z - size[1])
    else:
        return sqrt(x * x + y * y + z * z) - size[0]
    return sqrt(x * x + y * y + z * z)
