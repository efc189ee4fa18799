"""The compiled substep loop of a tick: actuators, wheels, engine. It runs without the interpreter lock.

The order of a substep: the actuators follow their commands, each wheel finds the ground below it, forces of tyres and
air are applied, the engine moves the bodies, contacts of the vehicles are recorded.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from autodrive.arrays import Floats
from autodrive.jit import inlined, jit_uncounted
from autodrive.model import Model
from autodrive.physics.buffers import Scratch, VehicleContacts
from autodrive.physics.engine import Views, copy_memory, mj_contact_force, mj_step1, mj_step2
from autodrive.physics.formulas import drive_level, steered
from autodrive.physics.free_body import rotation_at
from autodrive.physics.vehicle_forces import apply_forces
from autodrive.state import State

REACH = 0.5
"""Shapes whose bounding sphere is farther from a vehicle frame than this [m] are ignored by its wheels in a tick."""


UNSOUND = 1.0e9
"""A position, velocity or force this large means that the simulation has diverged."""


@jit_uncounted
def advance(
    model: Model,
    state: State,
    views: Views,
    contacts: VehicleContacts,
    scratch: Scratch,
    throttle: Floats,
    steering: Floats,
    first: int,
    substeps: int,
) -> bool:
    """Advances the state by `substeps`; returns False if the state diverged.

    `first` is the number of the first substep since reset. `throttle` and `steering` are the commands of this tick in
    [-1, 1], shape (n,).
    """
    n = model.vehicles.shape[0]
    for i in range(n):
        for axis in range(3):
            state.vehicle_acceleration[i, axis] = 0.0
    for i in range(n):
        _find_nearby(i, model, state, views, scratch, substeps * model.dt)
    for i in range(n):
        for axis in range(3):  # the angular acceleration is the difference over the tick
            state.vehicle_angular_acceleration[i, axis] = -state.vehicle_angular_velocity[i, axis]
    for k in range(first, first + substeps):
        views.applied[:] = 0.0
        for i in range(n):
            _actuate(i, model, state, throttle[i], steering[i], k)
            apply_forces(i, model, state, views, scratch)
            v = model.vehicles[i]
            for axis in range(3):
                scratch.velocity[i, axis] = views.qvel[v["dof"] + axis]
        if not _is_sound(views):
            return False
        mj_step2(views.model, views.data)
        _note_contacts(model, views, contacts, scratch)
        for i in range(n):
            _limit_angular_velocity(model.vehicles[i], views)
            _accumulate_acceleration(i, model, state, views, scratch, 1.0 / (substeps * model.dt))
        mj_step1(views.model, views.data)
    observe(model, state, views)
    for i in range(n):
        for axis in range(3):
            state.vehicle_angular_acceleration[i, axis] += state.vehicle_angular_velocity[i, axis]
            state.vehicle_angular_acceleration[i, axis] /= substeps * model.dt
    return views.warnings[0] == 0 and views.warnings[1] == 0 and views.warnings[2] == 0


@jit_uncounted
def observe(model: Model, state: State, views: Views) -> None:
    """Copies the poses and velocities of vehicles and the poses of shapes from the engine to the state."""
    for i in range(model.vehicles.shape[0]):
        v = model.vehicles[i]
        qpos, dof = v["qpos"], v["dof"]
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(views.qpos, qpos + 3)
        vx, vy, vz = views.qvel[dof], views.qvel[dof + 1], views.qvel[dof + 2]
        for axis in range(3):
            state.vehicle_position[i, axis] = views.qpos[qpos + axis]
            state.vehicle_angular_velocity[i, axis] = views.qvel[dof + 3 + axis]
        for axis in range(4):
            state.vehicle_orientation[i, axis] = views.qpos[qpos + 3 + axis]
        state.vehicle_velocity[i, 0] = r00 * vx + r10 * vy + r20 * vz
        state.vehicle_velocity[i, 1] = r01 * vx + r11 * vy + r21 * vz
        state.vehicle_velocity[i, 2] = r02 * vx + r12 * vy + r22 * vz
    for s in range(views.shape_geom.shape[0]):
        geom = views.shape_geom[s]
        for axis in range(3):
            state.shape_position[s, axis] = views.geom_position[geom, axis]
        for axis in range(9):
            state.shape_rotation[s, axis] = views.geom_rotation[geom, axis]


@inlined
def _find_nearby(i: int, model: Model, state: State, views: Views, scratch: Scratch, duration: float) -> None:
    """Lists the shapes that a wheel of vehicle i can stand on during the tick."""
    x, y, z = state.vehicle_position[i, 0], state.vehicle_position[i, 1], state.vehicle_position[i, 2]
    vx, vy, vz = state.vehicle_velocity[i, 0], state.vehicle_velocity[i, 1], state.vehicle_velocity[i, 2]
    reach = REACH + 2.0 * duration * sqrt(vx * vx + vy * vy + vz * vz)
    count = 0
    for s in range(model.shapes.kind.shape[0]):
        if model.shapes.vehicle[s] == i:
            continue
        geom = views.shape_geom[s]
        dx, dy, dz = (
            views.geom_position[geom, 0] - x,
            views.geom_position[geom, 1] - y,
            views.geom_position[geom, 2] - z,
        )
        far = reach + model.shapes.bounding_radius[s]
        if dx * dx + dy * dy + dz * dz < far * far:
            scratch.nearby[i, count] = s
            count += 1
    scratch.nearby_count[i] = count


@inlined
def _actuate(i: int, model: Model, state: State, throttle: float, steering: float, k: int) -> None:
    """Delays the commands by the dead times; the servo and the drive follow the delayed commands."""
    v = model.vehicles[i]
    length = state.throttle_queue.shape[1]
    state.throttle_queue[i, k % length] = throttle
    state.steering_queue[i, k % length] = steering * v["steering_limit"]
    state.throttle[i] = state.throttle_queue[i, (k - v["drive_delay"]) % length]
    state.steering_target[i] = state.steering_queue[i, (k - v["steering_delay"]) % length]
    state.drive_level[i] = drive_level(state.drive_level[i], state.throttle[i], v["drive_response"])
    state.steering_angle[i] = steered(
        state.steering_angle[i], state.steering_target[i], v["steering_response"], v["steering_rate_limit"], model.dt
    )


@inlined
def _is_sound(views: Views) -> bool:
    """Whether state and forces are finite and small enough for the engine to continue."""
    for k in range(views.qpos.shape[0]):
        if not abs(views.qpos[k]) < UNSOUND:
            return False
    for k in range(views.qvel.shape[0]):  # noqa: SIM110 (Numba makes no generators)
        if not abs(views.qvel[k]) + abs(views.applied[k]) < UNSOUND:
            return False
    return True


@inlined
def _limit_angular_velocity(v: Any, views: Views) -> None:
    """Unity's limit of a rigid body's angular velocity."""
    dof = v["dof"]
    x, y, z = views.qvel[dof + 3], views.qvel[dof + 4], views.qvel[dof + 5]
    speed = sqrt(x * x + y * y + z * z)
    if speed > v["angular_velocity_max"]:
        for axis in range(3):
            views.qvel[dof + 3 + axis] *= v["angular_velocity_max"] / speed


@inlined
def _accumulate_acceleration(i: int, model: Model, state: State, views: Views, scratch: Scratch, share: float) -> None:
    """Adds the mean acceleration of this substep in the current vehicle axes, as an accelerometer measures it."""
    v = model.vehicles[i]
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(views.qpos, qpos + 3)
    x = (views.qvel[dof] - scratch.velocity[i, 0]) * share
    y = (views.qvel[dof + 1] - scratch.velocity[i, 1]) * share
    z = (views.qvel[dof + 2] - scratch.velocity[i, 2]) * share
    state.vehicle_acceleration[i, 0] += r00 * x + r10 * y + r20 * z
    state.vehicle_acceleration[i, 1] += r01 * x + r11 * y + r21 * z
    state.vehicle_acceleration[i, 2] += r02 * x + r12 * y + r22 * z


@inlined
def _note_contacts(model: Model, views: Views, contacts: VehicleContacts, scratch: Scratch) -> None:
    """Adds the impulses of all contacts of the vehicles in this substep to `contacts`."""
    count = views.contact_count[0]
    if count == 0:
        return
    stride, position, geoms = views.contact_layout[0], views.contact_layout[1], views.contact_layout[2]
    force, where, pair = scratch.contact_force, scratch.contact_position, scratch.contact_geoms
    for c in range(count):
        contact = views.contacts[0] + c * stride
        copy_memory(pair.ctypes.data, contact + geoms, 8)
        for side in range(2):
            vehicle = contacts.geom_vehicle[pair[side]]
            if vehicle < 0:
                continue
            mj_contact_force(views.model, views.data, c, force.ctypes.data)
            impulse = model.dt * sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
            if impulse == 0.0:
                continue
            other = pair[1 - side]
            if contacts.impulse[vehicle, other] == 0.0:
                if contacts.pair_count[0] == contacts.pairs.shape[0]:
                    continue
                contacts.pairs[contacts.pair_count[0], 0] = vehicle
                contacts.pairs[contacts.pair_count[0], 1] = other
                contacts.pair_count[0] += 1
                copy_memory(where.ctypes.data, contact + position, 24)
                for axis in range(3):
                    contacts.position[vehicle, other, axis] = where[axis]
            contacts.impulse[vehicle, other] += impulse
