"""Axioms of rotations, and agreement of their four representations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base import transforms as tf
from autodrive.base.arrays import Floats
from autodrive.base.jit import jit
from autodrive.base.transforms import Quaternion, Vector

# Each check computes a few dozen products of numbers near one: 1e-12 allows 1e4 rounding errors.
CLOSE = 1e-12

angles = st.floats(-math.pi, math.pi)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
quaternions = st.builds(tf.quaternion_from_euler, angles, angles, angles)


def matrix(q: Quaternion) -> Floats:
    return np.array(tf.rotation_from_quaternion(q)).reshape(3, 3)


@given(quaternions)
def test_rotation_is_orthonormal_and_right_handed(q: Quaternion) -> None:
    m = matrix(q)
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=CLOSE)
    assert np.linalg.det(m) == pytest.approx(1.0, abs=CLOSE)


@given(quaternions, vectors)
def test_rotate_is_the_product_with_the_matrix(q: Quaternion, v: Vector) -> None:
    np.testing.assert_allclose(tf.rotate(q, v), matrix(q) @ v, atol=100 * CLOSE)


@given(quaternions, quaternions)
def test_composition_is_the_product_of_matrices(p: Quaternion, q: Quaternion) -> None:
    np.testing.assert_allclose(matrix(tf.compose(p, q)), matrix(p) @ matrix(q), atol=CLOSE)


@given(quaternions)
def test_inverse_undoes(q: Quaternion) -> None:
    np.testing.assert_allclose(tf.compose(q, tf.inverse(q)), (1.0, 0.0, 0.0, 0.0), atol=CLOSE)


@given(angles, angles, angles)
def test_euler_angles_are_rotations_about_x_then_y_then_z(roll: float, pitch: float, yaw: float) -> None:
    half = 0.5 * np.array([roll, pitch, yaw])
    (cx, cy, cz), (sx, sy, sz) = np.cos(half), np.sin(half)
    expected = tf.compose((cz, 0.0, 0.0, sz), tf.compose((cy, 0.0, sy, 0.0), (cx, sx, 0.0, 0.0)))
    np.testing.assert_allclose(tf.quaternion_from_euler(roll, pitch, yaw), expected, atol=CLOSE)


@given(quaternions)
def test_euler_angles_of_a_rotation_give_the_same_rotation(q: Quaternion) -> None:
    roll, pitch, yaw = tf.euler_from_quaternion(q)
    assert -math.pi < roll <= math.pi
    assert -math.pi / 2 <= pitch <= math.pi / 2
    assert -math.pi < yaw <= math.pi
    # near gimbal lock, below cos(pitch) = 1e-9, roll is set to 0, which changes the matrix by as much
    np.testing.assert_allclose(matrix(tf.quaternion_from_euler(roll, pitch, yaw)), matrix(q), atol=1e-8)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_are_recovered(roll: float, pitch: float, yaw: float) -> None:
    back = tf.euler_from_quaternion(tf.quaternion_from_euler(roll, pitch, yaw))
    own_yaw = tf.yaw_from_quaternion(tf.quaternion_from_euler(roll, pitch, yaw))
    assert math.remainder(back[2] - own_yaw, 2.0 * math.pi) == 0.0  # half a turn has either sign
    turned = np.array(back) - (roll, pitch, yaw)
    # -pi is returned as pi; 1/cos(1.5) = 14 amplifies rounding errors
    np.testing.assert_allclose(np.remainder(turned + math.pi, 2 * math.pi), math.pi, atol=1e-11)


def test_a_yaw_of_half_a_turn_is_always_plus_pi() -> None:
    assert tf.euler_from_quaternion((0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, math.pi)
    assert tf.euler_from_quaternion((-0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, math.pi)


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_gimbal_lock_has_roll_zero(pitch: float) -> None:
    roll, seen, yaw = tf.euler_from_quaternion(tf.quaternion_from_euler(0.0, pitch, 0.3))
    assert (roll, seen) == (0.0, pytest.approx(pitch, abs=1e-7))  # like asin, half of the digits
    assert yaw == pytest.approx(0.3, abs=CLOSE)


def test_left_is_positive() -> None:
    np.testing.assert_allclose(tf.rotate(tf.quaternion_from_yaw(math.pi / 2), (1.0, 0.0, 0.0)), (0, 1, 0), atol=CLOSE)


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_rotation_vector_is_axis_times_angle(angle: float, y: float, z: float) -> None:
    axis = np.array([1.0, y, z]) / math.sqrt(1.0 + y * y + z * z)
    q = tf.quaternion_from_rotation_vector(axis * angle)
    np.testing.assert_allclose(q, (math.cos(angle / 2), *(math.sin(angle / 2) * axis)), atol=CLOSE)


@given(vectors, vectors)
def test_cross_product_is_that_of_numpy(a: Vector, b: Vector) -> None:
    np.testing.assert_allclose(tf.cross(a, b), np.cross(a, b), atol=100 * CLOSE)


@given(quaternions, st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.floats(0.0, 1.0))
def test_slerp_turns_at_constant_speed(p: Quaternion, v: Vector, fraction: float) -> None:
    q = tf.compose(p, tf.quaternion_from_rotation_vector(v))
    part = (fraction * v[0], fraction * v[1], fraction * v[2])
    expected = tf.compose(p, tf.quaternion_from_rotation_vector(part))
    np.testing.assert_allclose(matrix(tf.slerp(p, q, fraction)), matrix(expected), atol=1e-11)
    other_sign = (-q[0], -q[1], -q[2], -q[3])  # q and -q are the same rotation
    np.testing.assert_allclose(matrix(tf.slerp(p, other_sign, fraction)), matrix(expected), atol=1e-11)


@jit
def heading(q: Floats, v: Vector) -> float:
    x, y, _ = tf.rotate(tf.compose(q, tf.inverse(tf.quaternion_from_yaw(0.1))), v)
    return math.atan2(y, x) + tf.euler_from_quaternion(q)[2]


def test_compiled_code_can_call_them() -> None:
    q = np.array(tf.quaternion_from_yaw(0.5))
    assert heading(q, (1.0, 0.0, 0.0)) == pytest.approx(0.9, abs=CLOSE)
