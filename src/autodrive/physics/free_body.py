"""Free rigid bodies: rotation, velocity of a point, force at a point, and the step of a body that touches nothing.

`qpos` and `dof` are the indices where the pose and the velocity of a body begin in `State.qpos` and `State.qvel`.
Vectors are in map axes unless it is said otherwise.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import inlined
from autodrive.base.transforms import Rotation, Vector, rotation_from_quaternion
from autodrive.physics.state import State


@inlined
def rotation_at(q: Floats, at: int) -> Rotation:
    """Rotation matrix, row by row, of the unit quaternion wxyz that begins at index `at`."""
    return rotation_from_quaternion((q[at], q[at + 1], q[at + 2], q[at + 3]))


@inlined
def rotated(rotation: Rotation, x: float, y: float, z: float) -> Vector:
    """The vector x, y, z of body axes in map axes."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    return r00 * x + r01 * y + r02 * z, r10 * x + r11 * y + r12 * z, r20 * x + r21 * y + r22 * z


@inlined
def angular_velocity(state: State, rotation: Rotation, dof: int) -> Vector:
    """Angular velocity of a body with that rotation, in the axes of the map [rad/s]."""
    return rotated(rotation, float(state.qvel[dof + 3]), float(state.qvel[dof + 4]), float(state.qvel[dof + 5]))


@inlined
def velocity_at(state: State, qpos: int, dof: int, x: float, y: float, z: float) -> Vector:
    """Velocity [m/s] of the point x, y, z of a body."""
    wx, wy, wz = angular_velocity(state, rotation_at(state.qpos, qpos + 3), dof)
    x, y, z = x - state.qpos[qpos], y - state.qpos[qpos + 1], z - state.qpos[qpos + 2]
    return (
        state.qvel[dof] + wy * z - wz * y,
        state.qvel[dof + 1] + wz * x - wx * z,
        state.qvel[dof + 2] + wx * y - wy * x,
    )


@inlined
def apply_force(
    applied: Floats,
    rotation: Rotation,
    dof: int,
    x: float,
    y: float,
    z: float,
    fx: float,
    fy: float,
    fz: float,
) -> None:
    """Adds the force fx, fy, fz [N] at the point x, y, z, which is relative to the origin of a body, to `applied`.

    `rotation` is that of the body. `applied` has the force on each body's origin in map axes and the torque in body
    axes, where `State.qvel` has its velocity.
    """
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    tx, ty, tz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
    applied[dof] += fx
    applied[dof + 1] += fy
    applied[dof + 2] += fz
    applied[dof + 3] += r00 * tx + r10 * ty + r20 * tz
    applied[dof + 4] += r01 * tx + r11 * ty + r21 * tz
    applied[dof + 5] += r02 * tx + r12 * ty + r22 * tz


@inlined
def step_free_body(
    v: Any, rotation: Rotation, gravity: float, dt: float, applied: Floats, q: Floats, velocity: Floats, change: Floats
) -> None:
    """Moves a vehicle by one substep under `applied` and gravity: the engine's equations without contacts.

    Newton and Euler about the centre of mass (Featherstone (2.60)); semi-implicit Euler as in MuJoCo: the new velocity
    moves the pose, and the quaternion turns by the exponential of the new angular velocity. `q`, `velocity` and
    `change` are `State.qpos`, `qvel` and `qacc`.
    """
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    c, inertia = v["center_of_mass"], v["inertia"]
    # angular velocity w and applied force b in body axes, f in map axes
    wx, wy, wz = velocity[dof + 3], velocity[dof + 4], velocity[dof + 5]
    fx, fy, fz = applied[dof], applied[dof + 1], applied[dof + 2]
    bx, by, bz = r00 * fx + r10 * fy + r20 * fz, r01 * fx + r11 * fy + r21 * fz, r02 * fx + r12 * fy + r22 * fz
    # torque about the centre of mass, without the gyroscopic part; body axes
    tx = applied[dof + 3] - (c[1] * bz - c[2] * by) - (wy * inertia[2] * wz - wz * inertia[1] * wy)
    ty = applied[dof + 4] - (c[2] * bx - c[0] * bz) - (wz * inertia[0] * wx - wx * inertia[2] * wz)
    tz = applied[dof + 5] - (c[0] * by - c[1] * bx) - (wx * inertia[1] * wy - wy * inertia[0] * wx)
    ax, ay, az = tx / inertia[0], ty / inertia[1], tz / inertia[2]
    # the origin is at -c from the centre of mass: -alpha x c - omega x (omega x c), body axes
    ux, uy, uz = wy * c[2] - wz * c[1], wz * c[0] - wx * c[2], wx * c[1] - wy * c[0]
    px = -(ay * c[2] - az * c[1]) - (wy * uz - wz * uy)
    py = -(az * c[0] - ax * c[2]) - (wz * ux - wx * uz)
    pz = -(ax * c[1] - ay * c[0]) - (wx * uy - wy * ux)
    # acceleration of the origin, map axes
    mass = v["mass"]
    gx = fx / mass + r00 * px + r01 * py + r02 * pz
    gy = fy / mass + r10 * px + r11 * py + r12 * pz
    gz = fz / mass - gravity + r20 * px + r21 * py + r22 * pz
    change[dof], change[dof + 1], change[dof + 2] = gx, gy, gz
    change[dof + 3], change[dof + 4], change[dof + 5] = ax, ay, az
    velocity[dof] += dt * gx
    velocity[dof + 1] += dt * gy
    velocity[dof + 2] += dt * gz
    wx, wy, wz = wx + dt * ax, wy + dt * ay, wz + dt * az
    velocity[dof + 3], velocity[dof + 4], velocity[dof + 5] = wx, wy, wz
    for axis in range(3):
        q[qpos + axis] += dt * velocity[dof + axis]
    # the turn of this substep as a quaternion w, x, y, z in body axes, which is multiplied from the right
    speed = sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * dt * speed
    k = sin(half) / speed if speed > 1e-12 else 0.5 * dt
    w, x, y, z = cos(half), k * wx, k * wy, k * wz
    at = qpos + 3
    q0, q1, q2, q3 = q[at], q[at + 1], q[at + 2], q[at + 3]
    n0 = q0 * w - q1 * x - q2 * y - q3 * z
    n1 = q0 * x + q1 * w + q2 * z - q3 * y
    n2 = q0 * y - q1 * z + q2 * w + q3 * x
    n3 = q0 * z + q1 * y - q2 * x + q3 * w
    length = sqrt(n0 * n0 + n1 * n1 + n2 * n2 + n3 * n3)
    q[at], q[at + 1] = n0 / length, n1 / length
    q[at + 2], q[at + 3] = n2 / length, n3 / length
