"""Contacts of the engine: their friction, how finely a step must be divided for them, and their impulses."""

from __future__ import annotations

from math import sqrt

from autodrive.base.jit import inlined
from autodrive.physics.buffers import Scratch, VehicleContacts
from autodrive.physics.engine import Views, copy_memory, mj_contact_force
from autodrive.physics.free_body import velocity_at
from autodrive.physics.model import Model
from autodrive.physics.state import State

DEPTH = 0.001
"""Two solids come at most so much closer in a step of the engine [m] if they touch in this step."""

MOST_PARTS = 200
"""A substep is divided into so many steps of the engine at most."""

LEAST_FRICTION = 1.0e-5
"""Least friction coefficient of the engine (mjMINMU)."""


@inlined
def prepare_contacts(model: Model, state: State, views: Views, scratch: Scratch) -> int:
    """Sets the friction of all contacts to the mean of both solids; returns the number of steps for this substep.

    The engine takes the greater of two coefficients; Unity, and so the original, takes the mean.
    """
    layout, shapes = views.contact_layout, model.shapes
    number, where, frame, pair = (
        scratch.contact_force,
        scratch.contact_position,
        scratch.contact_frame,
        scratch.contact_geoms,
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
        copy_memory(frame.ctypes.data, contact + layout.axes, 24)
        closer = 0.0
        for side in range(2):
            s = views.slots.solid[pair[side]] - 1
            if s >= shapes.n_fixed:
                x, y, z = velocity_at(state, shapes.qpos[s], shapes.dof[s], where[0], where[1], where[2])
                along = model.dt * (x * frame[0] + y * frame[1] + z * frame[2])
                closer += along if side == 0 else -along
        if closer > max(DEPTH, number[0]):
            parts = max(parts, min(MOST_PARTS, 1 + int(closer / DEPTH)))
    return parts


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
