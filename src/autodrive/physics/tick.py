"""The substep loop: actuators, wheels, engine. One compiled function without the interpreter lock.

It reads in the order things happen: the actuators follow their commands, each wheel finds the ground below it, slip
and compression become a force on the chassis and on what it stands on, the engine moves the bodies, contacts are
noted.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.jit import inlined, jit_uncounted
from autodrive.model import Model
from autodrive.physics.compile import (
    ackermann_angle,
    braked_spin,
    coasting_spin,
    drive_level,
    drive_target,
    drive_torque_limit,
    motor_torque,
    relaxed,
    slip_angle,
    slip_ratio_denominator,
    steered,
    suspension_force,
    tyre_force,
)
from autodrive.physics.engine import Views, copy_memory, mj_contact_force, mj_step1, mj_step2
from autodrive.physics.ray import MISS, ray_shape
from autodrive.state import Floats, Integers, State
from autodrive.transforms import Rotation, rotation_from_quaternion

REACH = 0.5
"""Shapes whose bounding sphere is farther from a vehicle frame than this [m] are out of its wheels' reach in a tick."""


class Touches(NamedTuple):
    """What the vehicles touched during a tick. Filled by `advance`, read by the referee."""

    geom_vehicle: Integers
    """Vehicle of each of the engine's geoms, or -1, shape (n_geom,)."""
    impulse: Floats
    """Between a vehicle and a geom [N s], shape (n, n_geom)."""
    position: Floats
    """A point of that contact [m], shape (n, n_geom, 3)."""
    pairs: Integers
    """The (vehicle, geom) pairs with an impulse, shape (n_max, 2)."""
    pair_count: Integers
    """How many pairs, shape (1,)."""


class Scratch(NamedTuple):
    """Memory that `advance` needs within a tick; nothing in it lives longer."""

    nearby: Integers
    """Shapes within each vehicle's reach, shape (n, n_shape)."""
    nearby_count: Integers
    """Shape (n,)."""
    velocity: Floats
    """Of each vehicle's origin before the substep, map axes [m/s], shape (n, 3)."""
    ground: Floats
    """Of the four wheels of the vehicle at hand: `GROUND_COLUMNS` numbers each."""
    contact_force: Floats
    """Force and torque of the contact at hand, shape (6,)."""
    contact_position: Floats
    """Its place [m], shape (3,)."""
    contact_geoms: NDArray[np.int32]
    """The engine's two geoms that meet there, shape (2,)."""


GROUND_COLUMNS = 24
UNSOUND = 1.0e9
"""A position, velocity or force that large comes from a state that has burst."""


@jit_uncounted
def advance(
    model: Model,
    state: State,
    views: Views,
    touches: Touches,
    scratch: Scratch,
    throttle: Floats,
    steering: Floats,
    first: int,
    substeps: int,
) -> bool:
    """Moves the state by `substeps`, of which `first` is the number since reset; False if the engine gave up.

    `throttle` and `steering` are the commands of this tick, in [-1, 1], shape (n,).
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
            _drive(i, model, state, views, scratch)
            v = model.vehicles[i]
            for axis in range(3):
                scratch.velocity[i, axis] = views.qvel[v["dof"] + axis]
        if not _is_sound(views):
            return False
        mj_step2(views.model, views.data)
        _note_touches(model, views, touches, scratch)
        for i in range(n):
            _limit_spin(model.vehicles[i], views)
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
    """Copies where bodies and shapes are now from the engine to the state."""
    for i in range(model.vehicles.shape[0]):
        v = model.vehicles[i]
        qpos, dof = v["qpos"], v["dof"]
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
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
def _rotation(q: Floats, at: int) -> Rotation:
    """Rotation matrix, row by row, of the unit quaternion wxyz that begins at `at`."""
    return rotation_from_quaternion((q[at], q[at + 1], q[at + 2], q[at + 3]))


@inlined
def _find_nearby(i: int, model: Model, state: State, views: Views, scratch: Scratch, duration: float) -> None:
    """The shapes that a wheel of vehicle i could stand on during the tick."""
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
    """Commands travel down their queues; servo and drive follow what comes out at the far end."""
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
def _drive(i: int, model: Model, state: State, views: Views, scratch: Scratch) -> None:
    """Forces of the ground on vehicle i and on what it stands on, and the new spin of its wheels."""
    v = model.vehicles[i]
    dt = model.dt
    throttle = state.throttle[i]
    is_braking = throttle == 0.0
    g = scratch.ground
    coasting_left = coasting_right = gain_left = gain_right = 0.0
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        angle = 0.0
        if wheel["is_steered"]:
            angle = ackermann_angle(state.steering_angle[i], v["wheelbase"], wheel["hub"][1])
        state.wheel_steering_angle[row] = angle
        _find_ground(i, w, angle, model, state, views, scratch)
        load, v_long, v_lat = g[w, 0], g[w, 1], g[w, 2]
        spin = state.wheel_angular_velocity[row]
        is_active = is_braking or wheel["is_driven"]
        slip_speed = wheel["radius"] * spin - v_long
        ratio = slip_speed / slip_ratio_denominator(
            v_long, wheel["radius"] * spin, is_active, wheel["active_slip_offset"], wheel["passive_slip_minimum"]
        )
        slide = slip_angle(v_lat, v_long, wheel["slip_angle_offset"])
        fx, _ = _tyre(wheel, ratio, slide, load)
        coasting, gain = coasting_spin(
            spin, fx, slip_speed, wheel["radius"], wheel["inertia"], wheel["damping_rate"], dt
        )
        g[w, 3], g[w, 4], g[w, 5] = coasting, gain, slide
        if w == 2:
            coasting_left, gain_left = coasting, gain
        elif w == 3:
            coasting_right, gain_right = coasting, gain
    torque = 0.0
    if not is_braking:
        level = state.drive_level[i]
        torque = motor_torque(
            coasting_left,
            coasting_right,
            gain_left,
            gain_right,
            drive_target(level, v["drive_is_speed_controlled"], v["drive_speed_limit"]),
            v["drive_servo_gain"],
            drive_torque_limit(level, v["drive_is_speed_controlled"], v["drive_torque_limit"]),
        )
    _resist_air(v, views)
    for w in range(4):
        wheel = model.wheels[4 * i + w]
        row = 4 * i + w
        spin = g[w, 3]
        if wheel["is_driven"]:
            spin += g[w, 4] * torque
        if is_braking:
            spin = braked_spin(spin, v["brake_torque"], g[w, 4])
        state.wheel_angular_velocity[row] = spin
        state.wheel_rotation[row] += spin * dt
        _push(i, w, is_braking, model, state, views, scratch)


@inlined
def _tyre(wheel: Any, ratio: float, slide: float, load: float) -> tuple[float, float]:
    f, s = wheel["forward"], wheel["sideways"]
    return tyre_force(ratio, slide, load, f[0], f[1], f[2], f[3], f[4], s[0], s[1], s[2], s[3], s[4])


@inlined
def _find_ground(i: int, w: int, angle: float, model: Model, state: State, views: Views, scratch: Scratch) -> None:
    """Casts wheel w's suspension ray; leaves load, contact velocities, contact frame and lever arms in the scratch row.

    Row: 0 load, 1 longitudinal and 2 lateral velocity over the ground, (3-5 spin, set by `_drive`), 6-8 longitudinal,
    9-11 lateral axis, 12-14 normal, 15-17 force's point from the vehicle frame, 18-20 contact point, 21 shape or -1.
    """
    v = model.vehicles[i]
    wheel = model.wheels[4 * i + w]
    row = 4 * i + w
    g = scratch.ground
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
    ox, oy, oz = views.qpos[qpos], views.qpos[qpos + 1], views.qpos[qpos + 2]
    hub = wheel["hub"]
    # hub, from the vehicle frame's origin, map axes
    hx = r00 * hub[0] + r01 * hub[1] + r02 * hub[2]
    hy = r10 * hub[0] + r11 * hub[1] + r12 * hub[2]
    hz = r20 * hub[0] + r21 * hub[1] + r22 * hub[2]
    radius, high, low = wheel["radius"], wheel["compression_max"], wheel["droop_max"]
    start = radius + high
    px, py, pz = ox + hx + r02 * start, oy + hy + r12 * start, oz + hz + r22 * start
    # the floor is z = 0; other shapes may be nearer
    distance, nx, ny, nz, shape = MISS, 0.0, 0.0, 1.0, -1
    if r22 > 0.0 and pz > 0.0:
        distance = pz / r22
    for j in range(scratch.nearby_count[i]):
        s = scratch.nearby[i, j]
        geom = views.shape_geom[s]
        cx, cy, cz = (
            views.geom_position[geom, 0] - px,
            views.geom_position[geom, 1] - py,
            views.geom_position[geom, 2] - pz,
        )
        far = 2.0 * radius + high + low + model.shapes.bounding_radius[s]
        if cx * cx + cy * cy + cz * cz > far * far:
            continue
        t, sx, sy, sz = ray_shape(
            int(model.shapes.kind[s]),
            model.shapes.size[s],
            views.geom_position[geom],
            views.geom_rotation[geom],
            px,
            py,
            pz,
            -r02,
            -r12,
            -r22,
        )
        if t < distance:
            distance, nx, ny, nz, shape = t, sx, sy, sz, s
    compression = radius - (distance - start)
    upright = nx * r02 + ny * r12 + nz * r22
    if compression <= -low or upright <= 0.1:
        for column in range(3):
            g[w, column] = 0.0
        g[w, 21] = -2.0
        state.wheel_compression[row] = -low
        state.wheel_normal_load[row] = 0.0
        return
    # contact point, from the vehicle frame's origin; its velocity less that of the body it stands on
    down = distance - start
    kx, ky, kz = hx - r02 * down, hy - r12 * down, hz - r22 * down
    bx, by, bz = views.qvel[dof + 3], views.qvel[dof + 4], views.qvel[dof + 5]
    wx, wy, wz = (
        r00 * bx + r01 * by + r02 * bz,
        r10 * bx + r11 * by + r12 * bz,
        r20 * bx + r21 * by + r22 * bz,
    )
    vx = views.qvel[dof] + wy * kz - wz * ky
    vy = views.qvel[dof + 1] + wz * kx - wx * kz
    vz = views.qvel[dof + 2] + wx * ky - wy * kx
    if shape >= 0 and model.shapes.dof[shape] >= 0:
        gx, gy, gz = _velocity_at(views, model.shapes.qpos[shape], model.shapes.dof[shape], ox + kx, oy + ky, oz + kz)
        vx, vy, vz = vx - gx, vy - gy, vz - gz
    speed = -(nx * vx + ny * vy + nz * vz) / upright
    load = upright * suspension_force(
        compression,
        speed,
        wheel["sprung_mass"] * model.gravity * max(0.0, r22),
        wheel["stiffness"],
        wheel["damping"],
        high,
        wheel["bump_stiffness"],
        wheel["look_ahead"],
    )
    # chassis axis in the contact plane, turned by the steering angle about the normal
    along = r00 * nx + r10 * ny + r20 * nz
    fx, fy, fz = r00 - along * nx, r10 - along * ny, r20 - along * nz
    length = sqrt(fx * fx + fy * fy + fz * fz)
    fx, fy, fz = fx / length, fy / length, fz / length
    sx, sy, sz = ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx
    c, s_ = cos(angle), sin(angle)
    lx, ly, lz = c * fx + s_ * sx, c * fy + s_ * sy, c * fz + s_ * sz
    tx, ty, tz = c * sx - s_ * fx, c * sy - s_ * fy, c * sz - s_ * fz
    base = radius - wheel["force_height"]
    g[w, 0] = load
    g[w, 1] = vx * lx + vy * ly + vz * lz
    g[w, 2] = vx * tx + vy * ty + vz * tz
    g[w, 6], g[w, 7], g[w, 8] = lx, ly, lz
    g[w, 9], g[w, 10], g[w, 11] = tx, ty, tz
    g[w, 12], g[w, 13], g[w, 14] = nx, ny, nz
    g[w, 15], g[w, 16], g[w, 17] = hx - r02 * base, hy - r12 * base, hz - r22 * base
    g[w, 18], g[w, 19], g[w, 20] = ox + kx, oy + ky, oz + kz
    g[w, 21] = shape
    state.wheel_compression[row] = compression
    state.wheel_normal_load[row] = load


@inlined
def _push(i: int, w: int, is_braking: bool, model: Model, state: State, views: Views, scratch: Scratch) -> None:
    """The ground's force at wheel w, at the wheel's new spin, on the chassis and, reversed, on a body below."""
    v = model.vehicles[i]
    wheel = model.wheels[4 * i + w]
    row = 4 * i + w
    g = scratch.ground
    spin = state.wheel_angular_velocity[row]
    load, v_long, v_lat, slide = g[w, 0], g[w, 1], g[w, 2], g[w, 5]
    is_active = is_braking or wheel["is_driven"]
    slip_speed = wheel["radius"] * spin - v_long
    ratio = slip_speed / slip_ratio_denominator(
        v_long, wheel["radius"] * spin, is_active, wheel["active_slip_offset"], wheel["passive_slip_minimum"]
    )
    state.wheel_slip_ratio[row], state.wheel_slip_angle[row] = ratio, slide
    if g[w, 21] < -1.0:  # in the air
        state.wheel_force[row, 0] = state.wheel_force[row, 1] = 0.0
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        return
    slow = wheel["hold_speed"]
    if is_braking and spin == 0.0 and v_long * v_long + v_lat * v_lat < slow * slow:
        fx, fy = _hold(row, wheel, state, v_long, v_lat, load, model.dt)
    else:
        state.wheel_hold[row, 0] = state.wheel_hold[row, 1] = 0.0
        fx, fy = _tyre(wheel, ratio, slide, load)
        fx = relaxed(state.wheel_force[row, 0], fx, slip_speed, wheel["effective_mass"], model.dt)
        fy = relaxed(state.wheel_force[row, 1], fy, v_lat, wheel["effective_mass"], model.dt)
    state.wheel_force[row, 0], state.wheel_force[row, 1] = fx, fy
    x = fx * g[w, 6] + fy * g[w, 9] + load * g[w, 12]
    y = fx * g[w, 7] + fy * g[w, 10] + load * g[w, 13]
    z = fx * g[w, 8] + fy * g[w, 11] + load * g[w, 14]
    _apply(views, v["qpos"], v["dof"], g[w, 15], g[w, 16], g[w, 17], x, y, z)
    shape = int(g[w, 21])
    if shape >= 0 and model.shapes.dof[shape] >= 0:
        q = model.shapes.qpos[shape]
        _apply(
            views,
            q,
            model.shapes.dof[shape],
            g[w, 18] - views.qpos[q],
            g[w, 19] - views.qpos[q + 1],
            g[w, 20] - views.qpos[q + 2],
            -x,
            -y,
            -z,
        )


@inlined
def _hold(
    row: int, wheel: Any, state: State, v_long: float, v_lat: float, load: float, dt: float
) -> tuple[float, float]:
    """A locked, standing wheel: a damped spring from where it came to rest, up to the friction limit, then it slips.

    PhysX uses a velocity constraint here ("sticky tyre"), which lets a car on a slope creep.
    """
    k, c = wheel["hold_stiffness"], wheel["hold_damping"]
    x = state.wheel_hold[row, 0] + v_long * dt
    y = state.wheel_hold[row, 1] + v_lat * dt
    fx, fy = -k * x - c * v_long, -k * y - c * v_lat
    ux, uy = fx / (load * wheel["forward"][1] + 1e-12), fy / (load * wheel["sideways"][1] + 1e-12)
    excess = sqrt(ux * ux + uy * uy)
    if excess > 1.0:
        fx, fy = fx / excess, fy / excess
        x, y = (-fx - c * v_long) / k, (-fy - c * v_lat) / k
    state.wheel_hold[row, 0], state.wheel_hold[row, 1] = x, y
    return fx, fy


@inlined
def _velocity_at(views: Views, qpos: int, dof: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity [m/s], map axes, of the point x, y, z of a free body."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
    bx, by, bz = views.qvel[dof + 3], views.qvel[dof + 4], views.qvel[dof + 5]
    wx, wy, wz = (
        r00 * bx + r01 * by + r02 * bz,
        r10 * bx + r11 * by + r12 * bz,
        r20 * bx + r21 * by + r22 * bz,
    )
    x, y, z = x - views.qpos[qpos], y - views.qpos[qpos + 1], z - views.qpos[qpos + 2]
    return (
        views.qvel[dof] + wy * z - wz * y,
        views.qvel[dof + 1] + wz * x - wx * z,
        views.qvel[dof + 2] + wx * y - wy * x,
    )


@inlined
def _apply(views: Views, qpos: int, dof: int, x: float, y: float, z: float, fx: float, fy: float, fz: float) -> None:
    """Adds a force (map axes) at a point given from the free body's origin (map axes)."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
    tx, ty, tz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
    views.applied[dof] += fx
    views.applied[dof + 1] += fy
    views.applied[dof + 2] += fz
    views.applied[dof + 3] += r00 * tx + r10 * ty + r20 * tz
    views.applied[dof + 4] += r01 * tx + r11 * ty + r21 * tz
    views.applied[dof + 5] += r02 * tx + r12 * ty + r22 * tz


@inlined
def _resist_air(v: Any, views: Views) -> None:
    """Unity's drag: the body loses a share of its velocity and of its angular velocity in each second."""
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
    c = v["center_of_mass"]
    x = r00 * c[0] + r01 * c[1] + r02 * c[2]
    y = r10 * c[0] + r11 * c[1] + r12 * c[2]
    z = r20 * c[0] + r21 * c[1] + r22 * c[2]
    ox, oy, oz = views.qpos[qpos], views.qpos[qpos + 1], views.qpos[qpos + 2]
    vx, vy, vz = _velocity_at(views, qpos, dof, ox + x, oy + y, oz + z)
    drag = -v["drag"] * v["mass"]
    _apply(views, qpos, dof, x, y, z, drag * vx, drag * vy, drag * vz)
    for axis in range(3):
        views.applied[dof + 3 + axis] -= v["angular_drag"] * v["inertia"][axis] * views.qvel[dof + 3 + axis]


@inlined
def _is_sound(views: Views) -> bool:
    """Whether the engine can go on from this state and these forces: nothing is infinite or not a number."""
    for k in range(views.qpos.shape[0]):
        if not abs(views.qpos[k]) < UNSOUND:
            return False
    for k in range(views.qvel.shape[0]):  # noqa: SIM110 (Numba makes no generators)
        if not abs(views.qvel[k]) + abs(views.applied[k]) < UNSOUND:
            return False
    return True


@inlined
def _limit_spin(v: Any, views: Views) -> None:
    """Unity's limit of a rigid body's angular velocity."""
    dof = v["dof"]
    x, y, z = views.qvel[dof + 3], views.qvel[dof + 4], views.qvel[dof + 5]
    speed = sqrt(x * x + y * y + z * z)
    if speed > v["angular_velocity_max"]:
        for axis in range(3):
            views.qvel[dof + 3 + axis] *= v["angular_velocity_max"] / speed


@inlined
def _accumulate_acceleration(i: int, model: Model, state: State, views: Views, scratch: Scratch, share: float) -> None:
    """Adds the substep's change of velocity, in the vehicle's axes of that moment: what an accelerometer integrates."""
    v = model.vehicles[i]
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(views.qpos, qpos + 3)
    x = (views.qvel[dof] - scratch.velocity[i, 0]) * share
    y = (views.qvel[dof + 1] - scratch.velocity[i, 1]) * share
    z = (views.qvel[dof + 2] - scratch.velocity[i, 2]) * share
    state.vehicle_acceleration[i, 0] += r00 * x + r10 * y + r20 * z
    state.vehicle_acceleration[i, 1] += r01 * x + r11 * y + r21 * z
    state.vehicle_acceleration[i, 2] += r02 * x + r12 * y + r22 * z


@inlined
def _note_touches(model: Model, views: Views, touches: Touches, scratch: Scratch) -> None:
    """Adds the impulse of each of the engine's contacts of a vehicle to what that vehicle touched in this tick."""
    count = views.contact_count[0]
    if count == 0:
        return
    stride, position, geoms = views.contact_layout[0], views.contact_layout[1], views.contact_layout[2]
    force, where, pair = scratch.contact_force, scratch.contact_position, scratch.contact_geoms
    for c in range(count):
        contact = views.contacts[0] + c * stride
        copy_memory(pair.ctypes.data, contact + geoms, 8)
        for side in range(2):
            vehicle = touches.geom_vehicle[pair[side]]
            if vehicle < 0:
                continue
            mj_contact_force(views.model, views.data, c, force.ctypes.data)
            impulse = model.dt * sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
            if impulse == 0.0:
                continue
            other = pair[1 - side]
            if touches.impulse[vehicle, other] == 0.0:
                if touches.pair_count[0] == touches.pairs.shape[0]:
                    continue
                touches.pairs[touches.pair_count[0], 0] = vehicle
                touches.pairs[touches.pair_count[0], 1] = other
                touches.pair_count[0] += 1
                copy_memory(where.ctypes.data, contact + position, 24)
                for axis in range(3):
                    touches.position[vehicle, other, axis] = where[axis]
            touches.impulse[vehicle, other] += impulse
