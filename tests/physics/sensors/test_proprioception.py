"""Encoders, IPS and IMU compared with closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.arrays import Floats
from autodrive.base.transforms import quaternion_from_euler, quaternion_from_yaw
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.messages import EncoderReading, ImuReading
from tests.support.one_sensor import GRAVITY, OneSensor
from tests.support.sensor_scenes import scene

TICK = 2.0 * math.pi / 1920.0
# rounding errors of some products of numbers up to ten
CLOSE = 1e-12


def count(left: float, right: float, spec: EncoderSpec | None = None) -> EncoderReading:
    return OneSensor(spec or EncoderSpec(), scene([], wheel_rotation=[math.nan, math.nan, left, right])).sample(0.5)


def test_one_revolution_is_1920_ticks() -> None:
    assert count(2.0 * math.pi, -4.0 * math.pi).ticks.tolist() == [1920, -3840]


@given(st.floats(-1e4, 1e4))
def test_ticks_are_rounded_toward_zero_and_angles_are_whole_ticks(rotation: float) -> None:
    reading = count(rotation, -rotation)
    assert reading.ticks[0] == -reading.ticks[1]  # same in reverse
    lag = abs(rotation) - abs(reading.angles[0])
    assert -1e-9 <= lag < TICK + 1e-9  # the rounding error of 1e4 rad is 2e-12
    assert reading.angles[0] == pytest.approx(reading.ticks[0] * TICK, rel=1e-14)


@given(st.floats(0.0, 1e3), st.floats(0.0, 1.0))
def test_ticks_do_not_decrease_while_the_wheel_rolls_forward(rotation: float, more: float) -> None:
    assert count(rotation + more, 0.0).ticks[0] >= count(rotation, 0.0).ticks[0]


def test_encoder_has_the_resolution_of_its_spec() -> None:
    reading = count(math.pi, 0.0, EncoderSpec(pulses_per_revolution=7, gear_ratio=2.0))
    assert reading.ticks[0] == 7
    assert reading.time == 0.5


def test_encoders_of_the_second_vehicle_measure_its_rear_wheels() -> None:
    where = scene([], vehicles=2, wheel_rotation=[9.0] * 6 + [TICK * 5.5, -TICK * 2.5])
    assert OneSensor(EncoderSpec(), where, vehicle=1).sample().ticks.tolist() == [5, -2]


def test_ips_measures_the_rear_axle_or_its_mount() -> None:
    yaw = math.radians(90.0)
    where = scene([], vehicle_position=[[1.0, 2.0, 0.03]], vehicle_orientation=[quaternion_from_yaw(yaw)])
    np.testing.assert_array_equal(OneSensor(IpsSpec(), where).sample().position, (1.0, 2.0, 0.03))
    tag = IpsSpec(mount=Mount(position=(0.035, 0.01, 0.1295)))
    expected = (1.0 - 0.01, 2.0 + 0.035, 0.03 + 0.1295)
    np.testing.assert_allclose(OneSensor(tag, where).sample().position, expected, atol=CLOSE)


def test_ips_reading_is_a_copy() -> None:
    where = scene([])
    ips = OneSensor(IpsSpec(), where)
    reading = ips.sample()
    where.state.vehicle_position[:] = 7.0
    assert ips.sample().position.all()
    assert not reading.position.any()


def measure(spec: ImuSpec, **columns: Any) -> ImuReading:
    return OneSensor(spec, scene([], **columns)).sample()


def test_acceleration_at_the_mount_is_the_second_derivative_of_its_path() -> None:
    # a point of a body that rotates about a tilted axis while its origin moves along a parabola
    axis, spin, spin_rate = np.array([1.0, 2.0, 2.0]) / 3.0, 1.5, 0.7
    lever, start_speed, fall = np.array([0.3, -0.2, 0.1]), np.array([1.0, 0.5, 0.2]), np.array([0.1, -0.3, 0.4])

    def path(t: float) -> Floats:
        angle = spin * t + 0.5 * spin_rate * t * t
        turned = lever * math.cos(angle) + np.cross(axis, lever) * math.sin(angle)
        turned += axis * (axis @ lever) * (1.0 - math.cos(angle))  # Rodrigues
        return start_speed * t + 0.5 * fall * t * t + turned

    h = 1e-3
    expected = (path(h) - 2.0 * path(0.0) + path(-h)) / h**2
    reading = measure(
        ImuSpec(mount=Mount(position=tuple(lever.tolist()))),
        vehicle_angular_velocity=[spin * axis],
        vehicle_angular_acceleration=[spin_rate * axis],
        vehicle_acceleration=[fall],
    )
    # error of the difference quotient: h^2/12 times the fourth derivative (about 5 m/s^4), and rounding 4e-16 / h^2
    np.testing.assert_allclose(reading.linear_acceleration, expected, atol=1e-6)


def test_rotated_imu_reports_in_its_own_axes() -> None:
    spec = ImuSpec(mount=Mount(rotation_deg=(0.0, 0.0, 90.0)))  # its x points to the vehicle's left
    reading = measure(spec, vehicle_angular_velocity=[[1.0, 2.0, 3.0]], vehicle_acceleration=[[4.0, 5.0, 6.0]])
    np.testing.assert_allclose(reading.angular_velocity, (2.0, -1.0, 3.0), atol=CLOSE)
    np.testing.assert_allclose(reading.linear_acceleration, (5.0, -4.0, 6.0), atol=CLOSE)
    assert reading.euler[2] == pytest.approx(math.pi / 2)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_imu_reports_the_orientation_as_quaternion_and_euler_angles(roll: float, pitch: float, yaw: float) -> None:
    q = quaternion_from_euler(roll, pitch, yaw)
    reading = measure(ImuSpec(), vehicle_orientation=[q])
    np.testing.assert_allclose(reading.orientation, q, atol=CLOSE)
    np.testing.assert_allclose(reading.euler, (roll, pitch, yaw), atol=1e-11)  # 1/cos(1.5) = 14 amplifies rounding


def test_specific_force_includes_gravity_and_acceleration_does_not() -> None:
    pitch = 0.2
    tilted = {"vehicle_orientation": [quaternion_from_euler(0.0, pitch, 1.0)]}
    assert not measure(ImuSpec(), **tilted).linear_acceleration.any()
    felt = measure(ImuSpec(measures_specific_force=True), **tilted).linear_acceleration
    np.testing.assert_allclose(felt, (-GRAVITY * math.sin(pitch), 0.0, GRAVITY * math.cos(pitch)), atol=CLOSE)
