"""Axioms of rotations, and agreement of the four ways to write one."""

import math

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive import transforms as tf

# Every check is a few dozen products of numbers near one: 1e-12 leaves 1e4 roundings of room.
CLOSE = 1e-12

angles = st.floats(-math.pi, math.pi)
vectors = st.tuples(*[st.floats(-10.0, 10.0)] * 3)
quaternions = st.builds(tf.quaternion_from_euler, angles, angles, angles)


def matrix(q):
    return np.array(tf.rotation_from_quaternion(q)).reshape(3, 3)


@given(quaternions)
def test_rotation_is_orthonormal_and_right_handed(q):
    m = matrix(q)
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=CLOSE)
    assert np.linalg.det(m) == pytest.approx(1.0, abs=CLOSE)


@given(quaternions, vectors)
def test_rotate_is_the_product_with_the_matrix(q, v):
    np.testing.assert_allclose(tf.rotate(q, v), matrix(q) @ v, atol=100 * CLOSE)


@given(quaternions, quaternions)
def test_composition_is_the_product_of_matrices(p, q):
    np.testing.assert_allclose(matrix(tf.compose(p, q)), matrix(p) @ matrix(q), atol=CLOSE)


@given(quaternions)
def test_inverse_undoes(q):
    np.testing.assert_allclose(tf.compose(q, tf.inverse(q)), (1.0, 0.0, 0.0, 0.0), atol=CLOSE)


@given(angles, angles, angles)
def test_euler_angles_are_turns_about_x_then_y_then_z(roll, pitch, yaw):
    half = 0.5 * np.array([roll, pitch, yaw])
    (cx, cy, cz), (sx, sy, sz) = np.cos(half), np.sin(half)
    expected = tf.compose((cz, 0.0, 0.0, sz), tf.compose((cy, 0.0, sy, 0.0), (cx, sx, 0.0, 0.0)))
    np.testing.assert_allclose(tf.quaternion_from_euler(roll, pitch, yaw), expected, atol=CLOSE)


@given(quaternions)
def test_euler_angles_name_the_same_rotation(q):
    roll, pitch, yaw = tf.euler_from_quaternion(q)
    assert -math.pi < roll <= math.pi
    assert -math.pi / 2 <= pitch <= math.pi / 2
    assert -math.pi < yaw <= math.pi
    # next to gimbal lock roll is given up below cos(pitch) = 1e-9, which moves the matrix by as much
    np.testing.assert_allclose(matrix(tf.quaternion_from_euler(roll, pitch, yaw)), matrix(q), atol=1e-8)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_come_back(roll, pitch, yaw):
    back = tf.euler_from_quaternion(tf.quaternion_from_euler(roll, pitch, yaw))
    turned = np.array(back) - (roll, pitch, yaw)
    # -pi comes back as pi; 1/cos(1.5) = 14 amplifies rounding
    np.testing.assert_allclose(np.remainder(turned + math.pi, 2 * math.pi), math.pi, atol=1e-11)


def test_straight_back_has_one_name():
    assert tf.euler_from_quaternion((0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, math.pi)
    assert tf.euler_from_quaternion((-0.0, 0.0, 0.0, 1.0)) == (0.0, 0.0, math.pi)


@pytest.mark.parametrize("pitch", [-math.pi / 2, math.pi / 2])
def test_looking_straight_up_or_down_has_roll_zero(pitch):
    roll, seen, yaw = tf.euler_from_quaternion(tf.quaternion_from_euler(0.0, pitch, 0.3))
    assert (roll, seen) == (0.0, pytest.approx(pitch, abs=1e-7))  # asin-like: half the digits at its end
    assert yaw == pytest.approx(0.3, abs=CLOSE)


def test_left_is_positive():
    np.testing.assert_allclose(tf.rotate(tf.quaternion_from_yaw(math.pi / 2), (1.0, 0.0, 0.0)), (0, 1, 0), atol=CLOSE)


@given(st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_rotation_vector_is_axis_times_angle(angle, y, z):
    axis = np.array([1.0, y, z]) / math.sqrt(1.0 + y * y + z * z)
    q = tf.quaternion_from_rotation_vector(axis * angle)
    np.testing.assert_allclose(q, (math.cos(angle / 2), *(math.sin(angle / 2) * axis)), atol=CLOSE)


@given(vectors, vectors)
def test_cross_product_is_that_of_the_books(a, b):
    np.testing.assert_allclose(tf.cross(a, b), np.cross(a, b), atol=100 * CLOSE)


@given(quaternions, st.tuples(*[st.floats(-1.0, 1.0)] * 3), st.floats(0.0, 1.0))
def test_slerp_turns_at_constant_speed(p, v, fraction):
    q = tf.compose(p, tf.quaternion_from_rotation_vector(v))
    part = tuple(fraction * x for x in v)
    expected = tf.compose(p, tf.quaternion_from_rotation_vector(part))
    np.testing.assert_allclose(matrix(tf.slerp(p, q, fraction)), matrix(expected), atol=1e-11)
    other_sign = tuple(-x for x in q)  # q and -q are the same turn
    np.testing.assert_allclose(matrix(tf.slerp(p, other_sign, fraction)), matrix(expected), atol=1e-11)


def test_compiled_code_can_call_them():
    @numba.njit
    def heading(q, v):
        x, y, _ = tf.rotate(tf.compose(q, tf.inverse(tf.quaternion_from_yaw(0.1))), v)
        return math.atan2(y, x) + tf.euler_from_quaternion(q)[2]

    q = np.array(tf.quaternion_from_yaw(0.5))
    assert heading(q, (1.0, 0.0, 0.0)) == pytest.approx(0.9, abs=CLOSE)
