"""Messages of Foxglove's published schemas (https://docs.foxglove.dev/docs/sdk/schemas), with our own fields added.

Foxglove, Lichtblick and Rerun recognise a schema by its name and read the fields that they know. The fields with
numbers from 101 hold the rest of our reading, so that the same message gives back exactly what was recorded.

The package `foxglove-schemas-protobuf` (0.4.0, MIT, 31 kB) has the published messages as generated classes, to which no
field can be added. It would replace about 60 of these lines, those of poses and calibrations, and need a second kind of
message beside that of `wire`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, TypeAlias

import msgspec

from autodrive.protocol.messages import Array, CameraImage, CameraIntrinsics, LidarScan, Pose
from autodrive.recording import wire
from autodrive.recording.wire import Message, WireInteger

NANOSECONDS = 1_000_000_000

Fixed32: TypeAlias = Annotated[int, WireInteger("TYPE_FIXED32")]
Int64: TypeAlias = Annotated[int, WireInteger("TYPE_INT64")]
Int32: TypeAlias = Annotated[int, WireInteger("TYPE_INT32")]


class Timestamp(msgspec.Struct, frozen=True, gc=False):
    """A time, as seconds and nanoseconds."""

    seconds: Int64
    nanos: Int32


class Vector3(msgspec.Struct, frozen=True, gc=False):
    """[m]."""

    x: float
    y: float
    z: float


class Quaternion(msgspec.Struct, frozen=True, gc=False):
    """An orientation; w is the last one."""

    x: float
    y: float
    z: float
    w: float


class FoxglovePose(msgspec.Struct, frozen=True, gc=False):
    """A pose in the frame of the message."""

    position: Vector3
    orientation: Quaternion


class LaserScan(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.LaserScan`, and the rest of a `LidarScan`."""

    timestamp: Timestamp
    frame_id: str
    pose: FoxglovePose
    start_angle: float
    end_angle: float
    ranges: Array
    intensities: Array
    time: float
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    scan_rate: float
    scan_time: float
    time_increment: float


class CompressedImage(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.CompressedImage`, and the rest of a `CameraImage`."""

    timestamp: Timestamp
    data: bytes
    format: str
    frame_id: str
    time: float
    pose: Pose
    intrinsics: CameraIntrinsics


class CameraCalibration(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.CameraCalibration`."""

    timestamp: Timestamp
    width: Fixed32
    height: Fixed32
    distortion_model: str
    D: list[float]
    K: list[float]
    R: list[float]
    P: list[float]
    frame_id: str


class FrameTransform(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.FrameTransform`."""

    timestamp: Timestamp
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.FrameTransforms`."""

    transforms: tuple[FrameTransform, ...]


_OURS = (Vector3, Quaternion, LaserScan, CompressedImage, CameraCalibration, FrameTransform, FrameTransforms)
wire.NAMES |= {kind.__name__: f"foxglove.{kind.__name__}" for kind in _OURS}
wire.NAMES |= {"Timestamp": "google.protobuf.Timestamp", "FoxglovePose": "foxglove.Pose"}
wire.PUBLISHED |= {
    "foxglove.LaserScan": {name: 101 + i for i, name in enumerate(LaserScan.__struct_fields__[7:])},
    "foxglove.CompressedImage": {"frame_id": 4, "data": 2, "format": 3, "time": 101, "pose": 102, "intrinsics": 103},
    "foxglove.CameraCalibration": {
        "frame_id": 9,
        **{name: i for i, name in enumerate(CameraCalibration.__struct_fields__[1:8], 2)},
    },
}

NO_POSE = FoxglovePose(Vector3(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))


def timestamp(time: int) -> Timestamp:
    """Of a time [ns]."""
    return Timestamp(*divmod(time, NANOSECONDS))


def laser_scan(scan: LidarScan, time: int, frame_id: str) -> LaserScan:
    """The message of a scan."""
    return LaserScan(
        timestamp=timestamp(time),
        frame_id=frame_id,
        pose=NO_POSE,
        start_angle=scan.angle_min,
        end_angle=scan.angle_min + scan.angle_increment * (len(scan.ranges) - 1),
        **{name: getattr(scan, name) for name in scan.__struct_fields__},
    )


def lidar_scan(message: LaserScan) -> LidarScan:
    """The scan of a message."""
    return LidarScan(**{name: getattr(message, name) for name in LidarScan.__struct_fields__})


def compressed_image(image: CameraImage, jpeg: bytes, time: int, frame_id: str) -> CompressedImage:
    """The message of an image."""
    return CompressedImage(
        timestamp=timestamp(time),
        data=jpeg,
        format="jpeg",
        frame_id=frame_id,
        time=image.time,
        pose=image.pose,
        intrinsics=image.intrinsics,
    )


def calibration(of: CameraIntrinsics, time: int, frame_id: str) -> CameraCalibration:
    """The message of a camera's pinhole model."""
    return CameraCalibration(
        timestamp=timestamp(time),
        width=of.width,
        height=of.height,
        distortion_model="plumb_bob",
        D=list(of.distortion),
        K=[of.fx, 0.0, of.cx, 0.0, of.fy, of.cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[of.fx, 0.0, of.cx, 0.0, 0.0, of.fy, of.cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        frame_id=frame_id,
    )


def transform(pose: Any, time: int, parent: str, child: str) -> FrameTransform:
    """The message of a pose, an object with `position` [m] and `orientation` (wxyz)."""
    x, y, z = map(float, pose.position)
    qw, qx, qy, qz = map(float, pose.orientation)
    return FrameTransform(timestamp(time), parent, child, Vector3(x, y, z), Quaternion(qx, qy, qz, qw))


def transforms_message(poses: Iterable[tuple[str, str, Any]], time: int) -> FrameTransforms:
    """The message of poses in the frame of a parent: (parent, child, pose)."""
    return FrameTransforms(tuple(transform(pose, time, parent, child) for parent, child, pose in poses))


LASER_SCAN, COMPRESSED_IMAGE = Message(LaserScan), Message(CompressedImage)
CAMERA_CALIBRATION, FRAME_TRANSFORMS = Message(CameraCalibration), Message(FrameTransforms)
