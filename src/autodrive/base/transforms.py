"""Rotations in plain scalar Python; compiled functions can call them, too.

Quaternions are wxyz and of unit length. Arguments are tuples or arrays, results are tuples.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan2, cos, register_jitable, sin

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
Rotation: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
"""A rotation matrix, row-major."""


@register_jitable
def quaternion_from_yaw(yaw: float) -> Quaternion:
    """Rotation to the left by `yaw` [rad] about z."""
    return cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)


@register_jitable
def quaternion_from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Quaternion of R = Rz(yaw) Ry(pitch) Rx(roll), angles in [rad]."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


@register_jitable
def quaternion_from_rotation_vector(v: Vector | Floats) -> Quaternion:
    """Rotation by |v| [rad] about the axis v (exponential map)."""
    angle = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    # series of sin(x)/x near 0, where the quotient is 0/0
    k = 0.5 - angle * angle / 48.0 if angle < 1e-4 else sin(0.5 * angle) / angle
    return cos(0.5 * angle), k * v[0], k * v[1], k * v[2]


def rotation_vector(q: Quaternion | Floats) -> Vector:
    """Axis times angle [rad] of a unit quaternion, at most pi long."""
    w, x, y, z = (float(value) for value in q)
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-12:
        return 2.0 * x, 2.0 * y, 2.0 * z
    angle = 2.0 * atan2(sine, w) if w >= 0.0 else 2.0 * atan2(-sine, -w)
    return x * angle / sine, y * angle / sine, z * angle / sine


@register_jitable
def euler_from_quaternion(q: Quaternion | Floats) -> Vector:
    """Roll, pitch, yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll): roll and yaw in (-pi, pi], pitch in [-pi/2, pi/2].

    At a pitch of +-90 degrees (gimbal lock) only roll -+ yaw is determined; roll is then 0.
    """
    m00, m01, _, m10, m11, _, m20, m21, m22 = rotation_from_quaternion(q)
    cos_pitch = math.sqrt(m00 * m00 + m10 * m10)
    pitch = atan2(0.0 - m20, cos_pitch)
    if cos_pitch < 1e-9:
        return 0.0, pitch, _upper_half(atan2(-m01, m11))
    return _upper_half(atan2(m21, m22)), pitch, _upper_half(atan2(m10, m00))


def yaw_from_quaternion(q: Quaternion | Floats) -> float:
    """The yaw [rad] of `euler_from_quaternion`, in [-pi, pi]."""
    w, x, y, z = (float(value) for value in q)
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@register_jitable
def rotation_from_quaternion(q: Quaternion | Floats) -> Rotation:
    """The rotation matrix, row-major."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


@register_jitable
def rotate(q: Quaternion | Floats, v: Vector | Floats) -> Vector:
    """The vector v rotated by q: with q = map from vehicle, v in vehicle axes becomes v in map axes."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    # v' = v + 2 w (u x v) + 2 u x (u x v), where u is the vector part of q
    tx = 2.0 * (y * v[2] - z * v[1])
    ty = 2.0 * (z * v[0] - x * v[2])
    tz = 2.0 * (x * v[1] - y * v[0])
    return (
        v[0] + w * tx + y * tz - z * ty,
        v[1] + w * ty + z * tx - x * tz,
        v[2] + w * tz + x * ty - y * tx,
    )


@register_jitable
def inverse(q: Quaternion | Floats) -> Quaternion:
    """The inverse rotation."""
    return q[0], -q[1], -q[2], -q[3]


@register_jitable
def compose(p: Quaternion | Floats, q: Quaternion | Floats) -> Quaternion:
    """The product p q (first q, then p): map from vehicle times vehicle from sensor is map from sensor."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@register_jitable
def cross(a: Vector | Floats, b: Vector | Floats) -> Vector:
    """The vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@register_jitable
def slerp(p: Quaternion | Floats, q: Quaternion | Floats, fraction: float) -> Quaternion:
    """Rotation on the shortest path from p (fraction 0) to q (fraction 1), at constant angular velocity."""
    w, x, y, z = compose(inverse(p), q)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    half_angle = atan2(sine, w)
    # sin(f a) / sin(a) tends to f as the angle tends to 0
    k = fraction if sine < 1e-12 else sin(fraction * half_angle) / sine
    return compose(p, (cos(fraction * half_angle), k * x, k * y, k * z))


@register_jitable
def _upper_half(angle: float) -> float:
    """An angle of [-pi, pi] in (-pi, pi]: -pi becomes pi."""
    return math.pi if angle == -math.pi else angle
