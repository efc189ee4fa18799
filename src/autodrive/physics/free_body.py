"""Free rigid bodies in the engine's arrays: rotation, velocity of a point, force at a point.

`qpos` and `dof` are the indices where the pose and the velocity of a body begin in the engine's qpos and qvel.
Vectors are in map axes.
"""

from __future__ import annotations

from autodrive.arrays import Floats
from autodrive.jit import inlined
from autodrive.physics.engine import Views
from autodrive.transforms import Rotation, rotation_from_quaternion


@inlined
def rotation_at(q: Floats, at: int) -> Rotation:
    """Rotation matrix, row by row, of the unit quaternion wxyz that begins at index `at`."""
    return rotation_from_quaternion((q[at], q[at + 1], q[at + 2], q[at + 3]))


@inlined
def velocity_at(views: Views, qpos: int, dof: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Velocity [m/s] of the point x, y, z of a body."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(views.qpos, qpos + 3)
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
def apply_force(
    views: Views, qpos: int, dof: int, x: float, y: float, z: float, fx: float, fy: float, fz: float
) -> None:
    """Adds the force fx, fy, fz [N] at the point x, y, z, which is relative to the body's origin."""
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(views.qpos, qpos + 3)
    tx, ty, tz = y * fz - z * fy, z * fx - x * fz, x * fy - y * fx
    views.applied[dof] += fx
    views.applied[dof + 1] += fy
    views.applied[dof + 2] += fz
    views.applied[dof + 3] += r00 * tx + r10 * ty + r20 * tz
    views.applied[dof + 4] += r01 * tx + r11 * ty + r21 * tz
    views.applied[dof + 5] += r02 * tx + r12 * ty + r22 * tz
