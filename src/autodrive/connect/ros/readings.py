"""Converts sensor readings to ROS messages (REP 103, 105, 117, 138, 145)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from autodrive.base.transforms import inverse, rotate
from autodrive.connect.ros.message import Fields, Message, Time
from autodrive.connect.ros.robot import Transform, xyz, xyzw
from autodrive.protocol.messages import (
    WHEEL_NAMES,
    Array,
    CameraIntrinsics,
    HeardLight,
    HeardVehicle,
    ImuReading,
    LidarScan,
    Lights,
    OwnReading,
    RangeReading,
    WheelsReading,
)

LEAST_VARIANCE = 1e-9
"""Variance of exact values: zero would mean that the covariance is unknown."""

DEVKIT_VARIANCE = 0.0025
"""Variance of all IMU values if the noise is unknown, as in the AutoDRIVE ROS packages."""


def header(stamp: Time, frame_id: str) -> Fields:
    """A std_msgs/Header."""
    return {"stamp": stamp, "frame_id": frame_id}


def number(value: float, type_: str = "std_msgs/Float32") -> Message:
    """A message with one number."""
    return Message(type_, {"data": value})


def own_reading(reading: OwnReading) -> Message:
    """A std_msgs/Float64MultiArray; the label of its dimension has the names of the columns, with commas."""
    count = len(reading.values)
    dimension = Message(
        "std_msgs/MultiArrayDimension", {"label": ", ".join(reading.columns), "size": count, "stride": count}
    )
    fields = {"layout": {"dim": [dimension], "data_offset": 0}, "data": reading.values}
    return Message("std_msgs/Float64MultiArray", fields)


def heard_vehicle(message: HeardVehicle) -> OwnReading:
    """What was heard of a vehicle as a row of numbers; the time is that of its arrival [s]."""
    columns = ("sent", "x", "y", "z", "yaw", "speed", "steering", "headlights", "indicators", "tail_lights")
    lamps = message.lights.headlights, message.lights.indicators, message.lights.tail_lights
    values = [message.sent, *message.position, message.yaw, message.speed, message.steering, *lamps]
    return OwnReading(message.received, np.array(values, np.float64), columns)


def heard_light(message: HeardLight) -> OwnReading:
    """What was heard of a traffic light as a row of numbers; the time is that of its arrival [s].

    The time to change is NaN if it is not known or if the light does not change.
    """
    time = math.nan if message.time_to_change is None else message.time_to_change
    values = np.array([message.sent, message.state, time], np.float64)
    return OwnReading(message.received, values, ("sent", "state", "time_to_change"))


def joint_states(stamp: Time, frame_id: str, angles: dict[str, float], rates: dict[str, float]) -> Message:
    """A sensor_msgs/JointState: angles [rad] and rates [rad/s]. Unknown rates are NaN; `rates` may be empty."""
    speeds = [rates.get(name, math.nan) for name in angles] if rates else []
    fields = {
        "header": header(stamp, frame_id),
        "name": [*angles],
        "position": np.array([*angles.values()], dtype=np.float64),
        "velocity": np.array(speeds, dtype=np.float64),
    }
    return Message("sensor_msgs/JointState", fields)


def imu(
    reading: ImuReading,
    frame_id: str,
    noise: dict[str, float] | None,
    *,
    added_gravity: float = 0.0,
    has_orientation: bool = True,
) -> Message:
    """A sensor_msgs/Imu. `noise`: see `VehicleScene.sensor_noise`.

    `added_gravity` [m/s^2], along the upward direction of the measured orientation, whose noise it has then: an
    acceleration without gravity becomes that of REP 145, which is +g at rest.
    """
    fields: Fields = {"header": header(Time.of(reading.time), frame_id)}
    orientation, rate, acceleration = [DEVKIT_VARIANCE] * 3
    if noise is not None:
        names = ("imu_orientation", "imu_angular_velocity", "imu_linear_acceleration")
        orientation, rate, acceleration = (noise[name] ** 2 for name in names)
        acceleration += added_gravity**2 * orientation
    variances = {"orientation": orientation, "angular_velocity": rate, "linear_acceleration": acceleration}
    for name, variance in variances.items():
        fields[f"{name}_covariance"] = np.diag([max(variance, LEAST_VARIANCE)] * 3).ravel()
    upward = rotate(inverse(reading.orientation), (0.0, 0.0, added_gravity))
    fields["angular_velocity"] = xyz(reading.angular_velocity)
    fields["linear_acceleration"] = xyz(np.add(reading.linear_acceleration, upward))
    if not has_orientation:
        fields["orientation_covariance"] = np.array([-1.0] + [0.0] * 8)
    else:
        fields["orientation"] = xyzw(reading.orientation)
    return Message("sensor_msgs/Imu", fields)


def laser_scan(scan: LidarScan, frame_id: str, *, is_turned: bool = False) -> Message:
    """A sensor_msgs/LaserScan, stamped with the time of its first ray.

    The first ray of a scan of 360 degrees points straight ahead, as in the devkits. `is_turned`: the frame points
    backwards, as in the packages of 2020 to 2023, so the angle straight ahead is -pi or pi.
    """
    ranges, intensities, angle_min = scan.ranges, scan.intensities, scan.angle_min
    count = len(ranges)
    if is_full_circle(scan):
        ahead = round(-angle_min / scan.angle_increment) % count
        ranges, intensities = np.roll(ranges, -ahead), np.roll(intensities, -ahead)
        angle_min = angle_min + ahead * scan.angle_increment
        angle_min = (angle_min + math.pi) % (2.0 * math.pi) - math.pi  # 0 but for rounding
    if is_turned:
        angle_min += math.pi if angle_min < -1e-6 else -math.pi
    fields = {
        "header": header(Time.of(max(scan.time - scan.time_increment * (count - 1), 0.0)), frame_id),
        "angle_min": angle_min,
        "angle_max": angle_min + (count - 1) * scan.angle_increment,
        "angle_increment": scan.angle_increment,
        "time_increment": scan.time_increment,
        "scan_time": 1.0 / scan.scan_rate if scan.scan_rate else 0.0,
        "range_min": scan.range_min,
        "range_max": scan.range_max,
        "ranges": ranges.astype(np.float32),
        "intensities": intensities.astype(np.float32),
    }
    return Message("sensor_msgs/LaserScan", fields)


def range_message(reading: RangeReading, frame_id: str) -> Message:
    """A sensor_msgs/Range; its two infinities are those of REP 117."""
    fields = {
        "header": header(Time.of(reading.time), frame_id),
        "radiation_type": {"ultrasound": 0, "infrared": 1}[reading.radiation],
        "field_of_view": reading.field_of_view,
        "min_range": reading.range_min,
        "max_range": reading.range_max,
        "range": reading.range,
    }
    return Message("sensor_msgs/Range", fields)


def is_full_circle(scan: LidarScan) -> bool:
    """Whether the scan covers 360 degrees."""
    return abs(abs(scan.angle_increment) * len(scan.ranges) - 2.0 * math.pi) < 0.5 * abs(scan.angle_increment)


def odometry(
    stamp: Time,
    pose: Transform,
    velocity: tuple[float, ...],
    angular: tuple[float, ...],
    variances: tuple[float, float],
) -> Message:
    """A nav_msgs/Odometry: pose in its parent frame, twist in its child frame; variances of pose and twist."""
    fields = {
        "header": header(stamp, pose.parent),
        "child_frame_id": pose.child,
        "pose": {
            "pose": {"position": xyz(pose.position), "orientation": xyzw(pose.orientation)},
            "covariance": np.diag([max(variances[0], LEAST_VARIANCE)] * 6).ravel(),
        },
        "twist": {
            "twist": {"linear": xyz(velocity), "angular": xyz(angular)},
            "covariance": np.diag([max(variances[1], LEAST_VARIANCE)] * 6).ravel(),
        },
    }
    return Message("nav_msgs/Odometry", fields)


def image(stamp: Time, frame_id: str, rgb: NDArray[np.uint8]) -> Message:
    """A sensor_msgs/Image from RGB pixels, shape (height, width, 3)."""
    height, width, channels = rgb.shape
    fields = {
        "header": header(stamp, frame_id),
        "height": height,
        "width": width,
        "encoding": "rgb8",
        "is_bigendian": 0,
        "step": width * channels,
        "data": rgb.tobytes(),
    }
    return Message("sensor_msgs/Image", fields)


def decoded(jpeg: bytes) -> NDArray[np.uint8]:
    """RGB pixels, shape (height, width, 3)."""
    return simplejpeg.decode_jpeg(jpeg, colorspace="RGB")


def compressed_image(stamp: Time, frame_id: str, jpeg: bytes) -> Message:
    """A sensor_msgs/CompressedImage."""
    return Message(
        "sensor_msgs/CompressedImage", {"header": header(stamp, frame_id), "format": "jpeg", "data": bytes(jpeg)}
    )


def camera_info(stamp: Time, frame_id: str, pinhole: CameraIntrinsics) -> Message:
    """A sensor_msgs/CameraInfo."""
    fields = {
        "header": header(stamp, frame_id),
        "height": pinhole.height,
        "width": pinhole.width,
        "distortion_model": "plumb_bob",
        "d": np.array(pinhole.distortion, dtype=np.float64),
        "k": pinhole.matrix.ravel(),
        "r": np.eye(3).ravel(),
        "p": (pinhole.matrix @ np.eye(3, 4)).ravel(),
    }
    return Message("sensor_msgs/CameraInfo", fields)


def joint_angles(wheels: WheelsReading) -> dict[str, float]:
    """Angles of the URDF joints [rad]."""
    left, right, *_ = wheels.steering_angle.tolist()
    return {"front_left_steering_joint": left, "front_right_steering_joint": right} | _by_wheel(wheels.rotation_angle)


def joint_rates(wheels: WheelsReading) -> dict[str, float]:
    """Rates of the wheel joints [rad/s]; steering rates are not measured."""
    return _by_wheel(wheels.angular_velocity)


def _by_wheel(values: Array) -> dict[str, float]:
    return {f"{name}_wheel_joint": value for name, value in zip(WHEEL_NAMES, values.tolist(), strict=True)}


def lights(stamp: Time, frame_id: str, lamps: Lights) -> Message:
    """An autodrive_msgs/Lights."""
    fields: Fields = {"header": header(stamp, frame_id)}
    for name in lamps.__struct_fields__:
        value = getattr(lamps, name)
        fields[name] = value if isinstance(value, bool) else int(value)
    return Message("autodrive_msgs/Lights", fields)


def wheel_states(stamp: Time, frame_id: str, wheels: WheelsReading) -> Message:
    """An autodrive_msgs/WheelStates."""
    quantities = {name: getattr(wheels, name) for name in wheels.__struct_fields__}
    return Message(
        "autodrive_msgs/WheelStates", {"header": header(stamp, frame_id), "name": [*WHEEL_NAMES], **quantities}
    )


CONVERTERS: dict[str, Callable[[Any, str], Message]] = {"sensor_msgs/Range": range_message}
"""Type of a topic that carries a reading as it is -> function of the reading and its frame_id."""
