"""Contacts of the engine: their friction, how finely a step must be divided for them, and their impulses."""

from __future__ import annotations

from math import sqrt

from autodrive.base.jit import inlined
from autodrive.base.transforms import Vector
from autodrive.physics.buffers import Scratch, VehicleContacts
from autodrive.physics.engine import Views, copy_memory, mj_contact_force
from autodrive.physics.free_body import rotated, rotation_at, velocity_at
from autodrive.physics.model import Model
from autodrive.physics.state import State

DEPTH = 0.001
"""Two solids come at most so much closer in a step of the engine [m] if they touch in this step."""

MOST_PARTS = 200
"""A substep is divided into so many steps of the engine at most."""

FLOOR_GEOM = 0
"""Number of the floor among the geoms. Its contacts are softer, so that `_slide` has nothing to mend there."""

SLIP = 50.0
"""Friction that cannot stop a slip in a step is asked for so much more than it can do [m/s^2]: the other forces on the
solids, which are not known yet, accelerate the slip by less."""

SAME_WAY = 0.7
"""Two contacts whose normals have at least this cosine push a body in the same direction."""

LEAST_FRICTION = 1.0e-5
"""Least friction coefficient of the engine (mjMINMU)."""


@inlined
def prepare_contacts(model: Model, state: State, views: Views, scratch: Scratch) -> int:
    """Completes the contacts of the engine before a step; returns into how many steps this substep must be divided.

    The friction of a contact becomes the mean of both solids, as in Unity and so in the original; the engine takes the
    greater coefficient.
    """
    layout, shapes = views.contact_layout, model.shapes
    number, where, frame, pair, row = (
        scratch.contact_force,
        scratch.contact_position,
        scratch.contact_frame,
        scratch.contact_geoms,
        scratch.contact_row,
    )
    parts = 1
    for c in range(views.contact_count[0]):
        contact = views.contacts[0] + c * layout.stride
        copy_memory(pair.ctypes.data, contact + layout.geoms, 8)
        friction = max(LEAST_FRICTION, 0.5 * (views.friction[pair[0], 0] + views.friction[pair[1], 0]))
        number[0] = number[1] = friction
        copy_memory(contact + layout.friction, number.ctypes.data, 16)
        copy_memory(contact + layout.cone, number.ctypes.data, 8)
        copy_memory(number.ctypes.data, contact + layout.distance, 8)
        copy_memory(where.ctypes.data, contact + layout.position, 24)
        copy_memory(frame.ctypes.data, contact + layout.axes, 72)
        copy_memory(row.ctypes.data, contact + layout.row, 4)
        first, second = int(views.slots.solid[pair[0]]) - 1, int(views.slots.solid[pair[1]]) - 1
        # velocity of the second solid relative to the first one, in the axes of the contact
        vx, vy, vz = 0.0, 0.0, 0.0
        for s, sign in ((first, -1.0), (second, 1.0)):
            if s >= shapes.n_fixed:
                x, y, z = velocity_at(state, int(shapes.qpos[s]), int(shapes.dof[s]), where[0], where[1], where[2])
                vx, vy, vz = vx + sign * x, vy + sign * y, vz + sign * z
        normal = vx * frame[0] + vy * frame[1] + vz * frame[2]
        closer = -model.dt * normal
        if closer > max(DEPTH, number[0]):
            parts = max(parts, min(MOST_PARTS, 1 + int(closer / DEPTH)))
        if row[0] >= 0 and pair[0] != FLOOR_GEOM and pair[1] != FLOOR_GEOM:
            a = vx * frame[3] + vy * frame[4] + vz * frame[5]
            b = vx * frame[6] + vy * frame[7] + vz * frame[8]
            is_fast = sqrt(a * a + b * b) > SLIP * views.timestep[0]
            if is_fast and not _is_jammed(c, first, second, model, views, scratch):
                _slide(row[0], friction, a, b, first, second, model, state, views, scratch)
    return parts


@inlined
def _is_jammed(c: int, first: int, second: int, model: Model, views: Views, scratch: Scratch) -> bool:
    """Whether a movable body of contact c, which is between these shapes, is pushed in another direction as well.

    The floor does not count. scratch: contact_frame holds the axes of contact c.
    """
    layout, shapes, normal = views.contact_layout, model.shapes, scratch.contact_frame
    pair, row, axis = scratch.other_geoms, scratch.other_row, scratch.other_normal
    for other in range(views.contact_count[0]):
        contact = views.contacts[0] + other * layout.stride
        copy_memory(row.ctypes.data, contact + layout.row, 4)
        copy_memory(pair.ctypes.data, contact + layout.geoms, 8)
        if other == c or row[0] < 0 or pair[0] == FLOOR_GEOM or pair[1] == FLOOR_GEOM:
            continue
        copy_memory(axis.ctypes.data, contact + layout.axes, 24)
        along = normal[0] * axis[0] + normal[1] * axis[1] + normal[2] * axis[2]
        for side in range(2):
            s = int(views.slots.solid[pair[side]]) - 1
            if s < shapes.n_fixed:
                continue
            is_first = first >= shapes.n_fixed and shapes.dof[s] == shapes.dof[first]
            is_second = second >= shapes.n_fixed and shapes.dof[s] == shapes.dof[second]
            sign = 1.0 if (is_first and side == 0) or (is_second and side == 1) else -1.0
            if (is_first or is_second) and sign * along < SAME_WAY:
                return True
    return False


@inlined
def _slide(
    row: int,
    friction: float,
    a: float,
    b: float,
    first: int,
    second: int,
    model: Model,
    state: State,
    views: Views,
    scratch: Scratch,
) -> None:
    """Sets what the rows of a contact along the surface ask for, if friction cannot stop the slip in this step.

    `a`, `b`: velocity along the second and the third axis of the contact [m/s].

    The solver of the engine is convex: the acceleration along the normal is greater than asked by friction times what
    lacks along the surface (Anitescu, Mathematical Programming 105, 2006). Asked to stop a fast slip, it throws the two
    solids apart. So it is asked for little more than what friction can do: the force along the normal that stops the
    solids, times friction, as far as one contact alone decides it.
    """
    speed, dt = sqrt(a * a + b * b), views.timestep[0]
    number, frame = scratch.contact_force, scratch.contact_frame
    rows = views.references[0] + 8 * row
    copy_memory(number.ctypes.data, rows, 8)
    asked = max(0.0, number[0])
    # acceleration of the contact per force along the normal, with the force of friction against the slip
    along, aside = -friction * a / speed, -friction * b / speed
    x = frame[0] + along * frame[3] + aside * frame[6]
    y = frame[1] + along * frame[4] + aside * frame[7]
    z = frame[2] + along * frame[5] + aside * frame[8]
    ax, ay, az = 0.0, 0.0, 0.0
    for s in (first, second):
        if s >= model.shapes.n_fixed:
            bx, by, bz = _response(s, x, y, z, model, state, views, scratch)
            ax, ay, az = ax + bx, ay + by, az + bz
    normal = ax * frame[0] + ay * frame[1] + az * frame[2]
    if normal <= 0.0:
        return
    force = asked / normal
    number[0] = force * (ax * frame[3] + ay * frame[4] + az * frame[5])
    number[1] = force * (ax * frame[6] + ay * frame[7] + az * frame[8])
    excess = speed / dt + (number[0] * a + number[1] * b) / speed - SLIP
    if excess <= 0.0:
        return
    # between what stops the slip and what friction can do there is no jump
    share = min(1.0, excess / SLIP)
    number[0] -= SLIP * a / speed
    number[1] -= SLIP * b / speed
    copy_memory(number.ctypes.data + 16, rows + 8, 16)
    number[0] = share * number[0] + (1.0 - share) * number[2]
    number[1] = share * number[1] + (1.0 - share) * number[3]
    copy_memory(rows + 8, number.ctypes.data, 16)


@inlined
def _response(
    s: int, fx: float, fy: float, fz: float, model: Model, state: State, views: Views, scratch: Scratch
) -> Vector:
    """Acceleration of the point of a contact, as a part of the body of shape s, for a force there; map axes."""
    qpos = model.shapes.qpos[s]
    body = 1 + model.shapes.dof[s] // 6
    rotation = rotation_at(state.qpos, qpos + 3)
    vehicle = model.shapes.vehicle[s]
    cx, cy, cz = 0.0, 0.0, 0.0
    if vehicle >= 0:
        c = model.vehicles[vehicle]["center_of_mass"]
        cx, cy, cz = rotated(rotation, c[0], c[1], c[2])
    where, mass, inertia = scratch.contact_position, views.mass[body], views.inertia[body]
    x, y, z = (
        where[0] - state.qpos[qpos] - cx,
        where[1] - state.qpos[qpos + 1] - cy,
        where[2] - state.qpos[qpos + 2] - cz,
    )
    tx, ty, tz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    wx, wy, wz = rotated(
        rotation,
        (r00 * tx + r10 * ty + r20 * tz) / inertia[0],
        (r01 * tx + r11 * ty + r21 * tz) / inertia[1],
        (r02 * tx + r12 * ty + r22 * tz) / inertia[2],
    )
    return fx / mass + wy * z - wz * y, fy / mass + wz * x - wx * z, fz / mass + wx * y - wy * x


@inlined
def note_contacts(views: Views, contacts: VehicleContacts, scratch: Scratch) -> None:
    """Adds the impulses of all contacts of the vehicles in the last step of the engine to `contacts`."""
    count = views.contact_count[0]
    if count == 0:
        return
    layout, push, dt = views.contact_layout, contacts.push, views.timestep[0]
    force, where, pair, frame = (
        scratch.contact_force,
        scratch.contact_position,
        scratch.contact_geoms,
        scratch.contact_frame,
    )
    for c in range(count):
        contact = views.contacts[0] + c * layout.stride
        copy_memory(pair.ctypes.data, contact + layout.geoms, 8)
        for side in range(2):
            vehicle = contacts.solid_vehicle[views.slots.solid[pair[side]]]
            if vehicle < 0:
                continue
            mj_contact_force(views.model, views.data, c, force.ctypes.data)
            impulse = dt * sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
            if impulse == 0.0:
                continue
            other = views.slots.solid[pair[1 - side]]
            if contacts.impulse[vehicle, other] == 0.0:
                if contacts.pair_count[0] == contacts.pairs.shape[0]:
                    continue
                contacts.pairs[contacts.pair_count[0], 0] = vehicle
                contacts.pairs[contacts.pair_count[0], 1] = other
                contacts.pair_count[0] += 1
                copy_memory(where.ctypes.data, contact + layout.position, 24)
                for axis in range(3):
                    contacts.position[vehicle, other, axis] = where[axis]
                for k in range(6):
                    push[vehicle, other, k] = 0.0
            contacts.impulse[vehicle, other] += impulse
            copy_memory(where.ctypes.data, contact + layout.position, 24)
            copy_memory(frame.ctypes.data, contact + layout.axes, 72)
            sign = dt if side == 1 else -dt  # the force acts on the second geom
            for axis in range(3):
                along = force[0] * frame[axis] + force[1] * frame[3 + axis] + force[2] * frame[6 + axis]
                push[vehicle, other, axis] += sign * along
                push[vehicle, other, 3 + axis] += impulse * where[axis]
