"""Fields of ROS messages compared with their meaning: points, pixels and times."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from autodrive.base.transforms import quaternion_from_euler
from autodrive.connect.ros import Time, readings
from autodrive.protocol.messages import CameraIntrinsics, ImuReading, LidarScan, RangeReading
from tests.support.ros.transform_tree import matrix


def scan(count: int, angle_min: float, increment: float, **more: float) -> LidarScan:
    rng = np.random.default_rng(0)
    values: dict[str, Any] = {"range_min": 0.15, "range_max": 12.0, "scan_rate": 7.0, "scan_time": 1 / 7}
    values |= {"time_increment": 0.0, **more}
    return LidarScan(
        time=2.0,
        ranges=rng.uniform(0.2, 5.0, count),
        intensities=np.arange(count, dtype=float),
        angle_min=angle_min,
        angle_increment=increment,
        **values,
    )


def points(ranges: Any, angle_min: float, increment: float) -> np.ndarray:
    """Points in the frame of the scan, sorted by bearing."""
    angles = angle_min + increment * np.arange(len(ranges))
    found = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
    return found[np.argsort(np.round(np.arctan2(found[:, 1], found[:, 0]), 6) % (2 * math.pi))]


DEGREE = math.pi / 180


@pytest.mark.parametrize(
    ("count", "angle_min", "increment"),
    [(360, 0.0, DEGREE), (360, -math.pi, DEGREE), (360, 0.0, -DEGREE), (1080, -0.75 * math.pi, DEGREE / 4)],
)
@pytest.mark.parametrize("is_turned", [False, True])
def test_a_scan_message_has_the_same_points(count: int, angle_min: float, increment: float, is_turned: bool) -> None:
    one = scan(count, angle_min, increment)
    fields = readings.laser_scan(one, "lidar", is_turned=is_turned).fields
    seen = points(fields["ranges"], fields["angle_min"] + is_turned * math.pi, fields["angle_increment"])
    assert seen == pytest.approx(points(one.ranges, angle_min, increment), abs=1e-5)
    last = fields["angle_min"] + (count - 1) * fields["angle_increment"]
    assert fields["angle_max"] == pytest.approx(last)


@pytest.mark.parametrize(("is_turned", "begin"), [(False, 0.0), (True, -math.pi)])
def test_a_full_scan_begins_straight_ahead(is_turned: bool, begin: float) -> None:
    one = scan(360, -math.pi, DEGREE)
    fields = readings.laser_scan(one, "lidar", is_turned=is_turned).fields
    assert fields["angle_min"] == pytest.approx(begin)
    assert fields["ranges"][0] == np.float32(one.ranges[180])
    assert fields["intensities"][0] == 180.0


def test_infinite_ranges_are_kept() -> None:
    one = scan(360, 0.0, DEGREE)
    one.ranges[:2] = -math.inf, math.inf
    assert readings.laser_scan(one, "lidar").fields["ranges"][:2].tolist() == [-math.inf, math.inf]


def test_the_stamp_of_a_scan_is_the_time_of_its_first_ray() -> None:
    rolling = scan(360, 0.0, DEGREE, time_increment=1 / 7 / 360)
    header = readings.laser_scan(rolling, "lidar").fields["header"]
    assert header["stamp"].sec + 1e-9 * header["stamp"].nanosec == pytest.approx(2.0 - 359 / 360 / 7)
    assert readings.laser_scan(scan(360, 0.0, DEGREE), "lidar").fields["header"]["stamp"] == Time(2, 0)


@pytest.mark.parametrize(
    ("seconds", "time"), [(0.0, (0, 0)), (1.25, (1, 250_000_000)), (0.9999999999, (1, 0)), (7.1, (7, 100_000_000))]
)
def test_a_time_has_seconds_and_nanoseconds(seconds: float, time: tuple[int, int]) -> None:
    assert Time.of(seconds) == time


def test_a_camera_info_projects_like_the_pinhole_shifted_by_half_a_pixel() -> None:
    pinhole = CameraIntrinsics(640, 480, 630.0, 631.0, 320.0, 240.0, (0.1, 0.0, 0.0, 0.0, 0.0))
    fields = readings.camera_info(Time(0, 0), "front", pinhole).fields
    u, v, w = fields["k"].reshape(3, 3) @ (0.1, -0.2, 2.0)
    assert (u / w + 0.5, v / w + 0.5) == pytest.approx((320 + 630 * 0.05, 240 - 631 * 0.1))
    assert fields["p"].reshape(3, 4)[:, :3] == pytest.approx(fields["k"].reshape(3, 3))
    assert fields["d"].tolist() == [0.1, 0.0, 0.0, 0.0, 0.0]


IMU = ImuReading(1.0, np.array([0.5, 0.5, -0.5, 0.5]), np.zeros(3), np.arange(3.0), 2 * np.arange(3.0))
NOISE = {"imu_orientation": 0.0, "imu_angular_velocity": 0.1, "imu_linear_acceleration": 0.2}


def test_covariances_of_the_imu_are_the_squares_of_its_noise() -> None:
    fields = readings.imu(IMU, "imu", NOISE).fields
    assert fields["angular_velocity_covariance"].reshape(3, 3) == pytest.approx(0.01 * np.eye(3))
    assert fields["linear_acceleration_covariance"].reshape(3, 3) == pytest.approx(0.04 * np.eye(3))
    assert (fields["orientation_covariance"].reshape(3, 3).diagonal() > 0).all(), "zero would mean unknown"
    assert fields["orientation"] == {"x": 0.5, "y": -0.5, "z": 0.5, "w": 0.5}


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.3, 0.0, 1.0), (0.0, -0.5, 2.0), (math.pi, 0.0, 0.0)])
def test_the_imu_of_rep_145_measures_g_upward_at_rest(angles: tuple[float, float, float]) -> None:
    """In its axes: R^T (0, 0, g), by the Euler angles roll, pitch, yaw; without gravity it measures nothing."""
    roll, pitch, _ = angles
    still = ImuReading(1.0, np.array(quaternion_from_euler(*angles)), np.array(angles), np.zeros(3), np.zeros(3))
    noise = {"imu_orientation": 0.01, "imu_angular_velocity": 0.0, "imu_linear_acceleration": 0.2}
    fields = readings.imu(still, "imu", noise, added_gravity=9.81).fields
    x, y, z = -math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)
    assert [*fields["linear_acceleration"].values()] == pytest.approx([9.81 * x, 9.81 * y, 9.81 * z], abs=1e-9)
    assert fields["linear_acceleration_covariance"][0] == pytest.approx(0.2**2 + 0.0981**2)  # small angles
    assert [*readings.imu(still, "imu", noise).fields["linear_acceleration"].values()] == [0.0, 0.0, 0.0]


def test_a_raw_imu_has_no_orientation() -> None:
    fields = readings.imu(IMU, "imu", NOISE, has_orientation=False).fields
    assert fields["orientation_covariance"][0] == -1.0
    assert "orientation" not in fields


def test_the_matrix_of_the_test_tree_rotates() -> None:
    quarter = math.sqrt(0.5)
    pose = matrix((1.0, 2.0, 3.0), (0.0, 0.0, quarter, quarter))
    assert pose @ (1.0, 0.0, 0.0, 1.0) == pytest.approx((1.0, 3.0, 3.0, 1.0))


def test_a_range_keeps_the_infinities_of_rep_117() -> None:
    reading = RangeReading(1.5, math.inf, 0.26, 0.02, 4.0, "infrared")
    message = readings.CONVERTERS["sensor_msgs/Range"](reading, "range")
    assert message.type == "sensor_msgs/Range"
    assert message.fields == {
        "header": {"stamp": (1, 500_000_000), "frame_id": "range"},
        "radiation_type": 1,
        "field_of_view": 0.26,
        "min_range": 0.02,
        "max_range": 4.0,
        "range": math.inf,
    }
