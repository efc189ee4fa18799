"""The compiled substep loop of a tick: actuators, wheels, rigid bodies. It runs without the interpreter lock.

The order of a substep: the actuators follow their commands, each wheel finds the ground below it, forces of tyres and
air are computed, the bodies move, contacts of the vehicles are recorded. While no vehicle can touch anything and no
object moves, `free_body.py` moves the vehicles; otherwise the engine moves all bodies. Both solve the same equations
with the same integrator, so that they differ in the last bits only.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.base.transforms import Vector
from autodrive.physics.buffers import Scratch, VehicleContacts
from autodrive.physics.clearance import MARGIN, can_any_touch, find_nearby, path
from autodrive.physics.engine import AWAKE, Views, has_diverged, load, look_ahead, mj_step1, mj_step2
from autodrive.physics.engine_contacts import note_contacts, prepare_contacts
from autodrive.physics.formulas import drive_level, interpolated, steered
from autodrive.physics.free_body import rotated, rotation_at, step_free_body
from autodrive.physics.model import Model
from autodrive.physics.near import forget, hold_near
from autodrive.physics.state import State
from autodrive.physics.vehicle_forces import apply_forces, steer_wheels

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
    always_engine: bool,
) -> bool:
    """Advances the state by `substeps`; returns False if the state diverged.

    `first` is the number of the first substep since reset. `throttle` and `steering` are the commands of this tick in
    [-1, 1], shape (n,). `always_engine`: the engine moves the bodies in every substep.
    """
    n = model.vehicles.shape[0]
    duration = substeps * model.dt
    scratch.applied[:] = 0.0
    if has_diverged(views) or not _is_sound(state.qpos, state.qvel, scratch.applied):
        return False
    for i in range(n):
        scratch.horizon[i] = 0.0
        for axis in range(3):
            state.vehicle_acceleration[i, axis] = 0.0
            # the angular acceleration is the difference over the tick
            state.vehicle_angular_acceleration[i, axis] = -state.vehicle_angular_velocity[i, axis]
    needs_engine = always_engine or _is_any_awake(state.asleep, n)
    is_loaded = False
    for k in range(first, first + substeps):
        # Commands become steering angles and torques, and the wheels turn contact and slip into forces on the bodies.
        scratch.applied[:] = 0.0
        for i in range(n):
            v = model.vehicles[i]
            if scratch.horizon[i] <= MARGIN:
                find_nearby(i, model, state, scratch, duration)
            angle = state.steering_angle[i]
            actuate(i, model, state, throttle[i], steering[i], k)
            if k == first or state.steering_angle[i] != angle:  # it is often constant
                steer_wheels(i, model, state)
            apply_forces(i, rotation_at(state.qpos, v["qpos"] + 3), model, state, scratch)
            for axis in range(3):
                scratch.velocity[i, axis] = state.qvel[v["dof"] + axis]
        if not _is_sound(state.qpos, state.qvel, scratch.applied):
            return False
        # The engine moves the bodies from the first substep on in which something may touch; before, vehicles are free.
        needs_engine = needs_engine or can_any_touch(model, state, scratch)
        if needs_engine:
            if not is_loaded:
                load(model, state, views)
                is_loaded = True
            _step_engine(model, state, views, contacts, scratch)
        else:
            for i in range(n):
                v = model.vehicles[i]
                rotation = rotation_at(state.qpos, v["qpos"] + 3)
                step_free_body(
                    v, rotation, model.gravity, model.dt, scratch.applied, state.qpos, state.qvel, state.qacc
                )
                _limit_angular_velocity(v, state.qpos, state.qvel)
        # The distance within which a vehicle is known to be free shrinks by its way; its acceleration is a mean.
        for i in range(n):
            v = model.vehicles[i]
            way = path(v, state.qvel, model.dt)
            scratch.clearance[i] -= way
            scratch.horizon[i] -= way
            x, y, z = _acceleration(v, state.qpos, state.qvel, scratch.velocity[i], 1.0 / duration)
            state.vehicle_acceleration[i, 0] += x
            state.vehicle_acceleration[i, 1] += y
            state.vehicle_acceleration[i, 2] += z
    # What the engine computed last starts its next computation, also in an engine of another world.
    if needs_engine:
        for k in range(state.qacc.shape[0]):
            state.qacc[k] = views.warmstart[k]
        for b in range(state.asleep.shape[0]):
            state.asleep[b] = views.asleep[b]
    observe(model, state)
    for i in range(n):
        for axis in range(3):
            state.vehicle_angular_acceleration[i, axis] += state.vehicle_angular_velocity[i, axis]
            state.vehicle_angular_acceleration[i, axis] /= duration
    return not has_diverged(views)


@jit_uncounted
def observe(model: Model, state: State) -> None:
    """Updates the columns of vehicles and shapes from the poses and velocities of the bodies."""
    for i in range(model.vehicles.shape[0]):
        v = model.vehicles[i]
        qpos, dof = v["qpos"], v["dof"]
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(state.qpos, qpos + 3)
        vx, vy, vz = state.qvel[dof], state.qvel[dof + 1], state.qvel[dof + 2]
        for axis in range(3):
            state.vehicle_position[i, axis] = state.qpos[qpos + axis]
            state.vehicle_angular_velocity[i, axis] = state.qvel[dof + 3 + axis]
        for axis in range(4):
            state.vehicle_orientation[i, axis] = state.qpos[qpos + 3 + axis]
        state.vehicle_velocity[i, 0] = r00 * vx + r10 * vy + r20 * vz
        state.vehicle_velocity[i, 1] = r01 * vx + r11 * vy + r21 * vz
        state.vehicle_velocity[i, 2] = r02 * vx + r12 * vy + r22 * vz
    move_shapes(model, state)


@jit_uncounted
def place(model: Model, state: State, views: Views) -> None:
    """Updates columns and engine after bodies were placed by hand: all bodies are awake then."""
    state.asleep[:] = AWAKE
    load(model, state, views)
    observe(model, state)


@inlined
def move_shapes(model: Model, state: State) -> None:
    """Moves the shapes of movable bodies with their bodies."""
    shapes = model.shapes
    for s in range(shapes.n_fixed, shapes.kind.shape[0]):
        qpos, own, m = shapes.qpos[s], shapes.position[s], shapes.rotation[s]
        r = rotation_at(state.qpos, qpos + 3)
        for row in range(3):
            a, b, c = r[3 * row], r[3 * row + 1], r[3 * row + 2]
            state.shape_position[s, row] = state.qpos[qpos + row] + (a * own[0] + b * own[1] + c * own[2])
            for column in range(3):
                state.shape_rotation[s, 3 * row + column] = a * m[column] + b * m[3 + column] + c * m[6 + column]


@inlined
def _is_any_awake(asleep: Floats, n: int) -> bool:
    """Whether the engine has to move a body that is not one of the `n` vehicles, which come last."""
    for b in range(asleep.shape[0] - n):  # noqa: SIM110 (Numba makes no generators)
        if asleep[b] < 0.0:
            return True
    return False


@inlined
def _step_engine(model: Model, state: State, views: Views, contacts: VehicleContacts, scratch: Scratch) -> None:
    """One substep of the engine, which holds the present state; records the contacts of the vehicles."""
    for k in range(scratch.applied.shape[0]):
        views.applied[k] = scratch.applied[k]
    parts = prepare_contacts(model, state, views, scratch)
    if parts > 1:
        views.timestep[0] = model.dt / parts
        mj_step1(views.model, views.data)
    for part in range(parts):
        if parts > 1:
            prepare_contacts(model, state, views, scratch)
        mj_step2(views.model, views.data)
        note_contacts(views, contacts, scratch)
        for k in range(state.qpos.shape[0]):
            state.qpos[k] = views.qpos[k]
        for k in range(state.qvel.shape[0]):
            state.qvel[k] = views.qvel[k]
        for i in range(model.vehicles.shape[0]):
            v = model.vehicles[i]
            _limit_angular_velocity(v, state.qpos, state.qvel)
            for axis in range(6):
                views.qvel[v["dof"] + axis] = state.qvel[v["dof"] + axis]
        if part == parts - 1:
            views.timestep[0] = model.dt
        hold_near(model.shapes, state.qpos, views.slots)
        look_ahead(model, state, views)
        mj_step1(views.model, views.data)
    move_shapes(model, state)
    if has_diverged(views):
        forget(views.slots)  # the engine has returned to its start


@inlined
def actuate(i: int, model: Model, state: State, throttle: float, steering: float, k: int) -> None:
    """Delays the commands by the dead times; the servo and the drive follow the delayed commands."""
    v = model.vehicles[i]
    length = state.throttle_queue.shape[1]
    lowest, highest = v["command_limits"][0], v["command_limits"][1]
    state.throttle_queue[i, k % length] = throttle if v["drive_has_reverse"] else max(throttle, 0.0)
    state.steering_queue[i, k % length] = max(lowest, min(highest, steering)) * v["steering_limit"]
    state.throttle[i] = state.throttle_queue[i, (k - v["drive_delay"]) % length]
    state.steering_target[i] = state.steering_queue[i, (k - v["steering_delay"]) % length]
    state.drive_level[i] = drive_level(
        state.drive_level[i],
        state.throttle[i],
        v["drive_response"],
        v["drive_rate_limit"],
        v["drive_coasts"],
        model.dt,
    )
    servo = steered(
        state.servo_angle[i],
        state.steering_target[i],
        v["steering_response"],
        v["steering_rate_limit"],
        v["steering_unwinds_at_once"],
        model.dt,
    )
    state.servo_angle[i] = state.steering_angle[i] = servo
    if v["steering_curve_points"] > 0:
        state.steering_angle[i] = interpolated(
            v["steering_curve_points"], v["steering_curve_servo"], v["steering_curve_angle"], servo
        )


@inlined
def _is_sound(qpos: Floats, qvel: Floats, applied: Floats) -> bool:
    """Whether state and forces are finite and small enough to continue."""
    for k in range(qpos.shape[0]):
        if not abs(qpos[k]) < UNSOUND:
            return False
    for k in range(qvel.shape[0]):  # noqa: SIM110 (Numba makes no generators)
        if not abs(qvel[k]) + abs(applied[k]) < UNSOUND:
            return False
    return True


@inlined
def _limit_angular_velocity(v: Any, qpos: Floats, qvel: Floats) -> None:
    """Unity's limit of a rigid body's angular velocity; the velocity of its centre of mass stays."""
    dof, c = v["dof"], v["center_of_mass"]
    x, y, z = qvel[dof + 3], qvel[dof + 4], qvel[dof + 5]
    speed = sqrt(x * x + y * y + z * z)
    if speed > v["angular_velocity_max"]:
        kept = v["angular_velocity_max"] / speed
        lost = 1.0 - kept
        ux, uy, uz = rotated(
            rotation_at(qpos, v["qpos"] + 3),
            lost * (y * c[2] - z * c[1]),
            lost * (z * c[0] - x * c[2]),
            lost * (x * c[1] - y * c[0]),
        )
        qvel[dof] += ux
        qvel[dof + 1] += uy
        qvel[dof + 2] += uz
        for axis in range(3):
            qvel[dof + 3 + axis] *= kept


@inlined
def _acceleration(v: Any, q: Floats, velocity: Floats, before: Floats, share: float) -> Vector:
    """Change of a vehicle's velocity in this substep, times `share`, in the current vehicle axes (accelerometer).

    `q` and `velocity` are `State.qpos` and `qvel`; `before` is the velocity at the start of the substep, map axes.
    """
    dof = v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(q, v["qpos"] + 3)
    x = (velocity[dof] - before[0]) * share
    y = (velocity[dof + 1] - before[1]) * share
    z = (velocity[dof + 2] - before[2]) * share
    return r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
