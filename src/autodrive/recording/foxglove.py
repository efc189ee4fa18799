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
import numpy as np

from autodrive.protocol.messages import Array, CameraImage, CameraIntrinsics, Draw, Drawing, LidarScan, Pose
from autodrive.recording import wire
from autodrive.recording.wire import WireInteger, WireMessage

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


class Duration(msgspec.Struct, frozen=True, gc=False):
    """A duration in seconds and nanoseconds."""

    seconds: Int64
    nanos: Int32


class Color(msgspec.Struct, frozen=True, gc=False):
    """Red, green, blue and opacity, 0 to 1."""

    r: float
    g: float
    b: float
    a: float


class Point3(msgspec.Struct, frozen=True, gc=False):
    """[m]."""

    x: float
    y: float
    z: float


class SpherePrimitive(msgspec.Struct, frozen=True, gc=False):
    """`size`: its diameters [m]."""

    pose: FoxglovePose
    size: Vector3
    color: Color


class LinePrimitive(msgspec.Struct, frozen=True, gc=False):
    """`type` 0: a line through all points, 2: one between each pair; `thickness` [m]."""

    type: Int32
    pose: FoxglovePose
    thickness: float
    points: tuple[Point3, ...]
    color: Color


class TextPrimitive(msgspec.Struct, frozen=True, gc=False):
    """`billboard`: it faces the camera; `font_size`: height of a line [m]."""

    pose: FoxglovePose
    billboard: bool
    font_size: float
    color: Color
    text: str


class SceneEntity(msgspec.Struct, frozen=True, gc=False):
    """A drawing; it replaces that of the same `id`. `lifetime` 0: it stays."""

    timestamp: Timestamp
    frame_id: str
    id: str
    lifetime: Duration
    spheres: tuple[SpherePrimitive, ...] = ()
    lines: tuple[LinePrimitive, ...] = ()
    texts: tuple[TextPrimitive, ...] = ()


class SceneEntityDeletion(msgspec.Struct, frozen=True, gc=False):
    """`type` 0: the drawing of that `id` is removed, 1: all are."""

    timestamp: Timestamp
    type: Int32
    id: str


class SceneUpdate(msgspec.Struct, frozen=True, gc=False):
    """`foxglove.SceneUpdate`."""

    deletions: tuple[SceneEntityDeletion, ...]
    entities: tuple[SceneEntity, ...]


_DRAWN = (Color, Point3, SpherePrimitive, LinePrimitive, TextPrimitive, SceneEntity, SceneEntityDeletion, SceneUpdate)
_OURS = (Vector3, Quaternion, LaserScan, CompressedImage, CameraCalibration, FrameTransform, FrameTransforms, *_DRAWN)
wire.NAMES |= {kind.__name__: f"foxglove.{kind.__name__}" for kind in _OURS}
wire.NAMES |= {"Timestamp": "google.protobuf.Timestamp", "Duration": "google.protobuf.Duration"}
wire.NAMES |= {"FoxglovePose": "foxglove.Pose"}
wire.PUBLISHED |= {
    "foxglove.LaserScan": {name: 101 + i for i, name in enumerate(LaserScan.__struct_fields__[7:])},
    "foxglove.CompressedImage": {"frame_id": 4, "data": 2, "format": 3, "time": 101, "pose": 102, "intrinsics": 103},
    "foxglove.CameraCalibration": {
        "frame_id": 9,
        **{name: i for i, name in enumerate(CameraCalibration.__struct_fields__[1:8], 2)},
    },
}

wire.PUBLISHED |= {
    "foxglove.SceneEntity": {
        "timestamp": 1,
        "frame_id": 2,
        "id": 3,
        "lifetime": 4,
        "spheres": 9,
        "lines": 11,
        "texts": 13,
    },
    "foxglove.LinePrimitive": {"type": 1, "pose": 2, "thickness": 3, "points": 5, "color": 6},
    "foxglove.TextPrimitive": {"pose": 1, "billboard": 2, "font_size": 3, "color": 5, "text": 6},
}

NO_POSE = FoxglovePose(Vector3(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))


def timestamp(time: int) -> Timestamp:
    """The timestamp of a time [ns]."""
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


def calibration(intrinsics: CameraIntrinsics, time: int, frame_id: str) -> CameraCalibration:
    """The message of a camera's pinhole model."""
    return CameraCalibration(
        timestamp=timestamp(time),
        width=intrinsics.width,
        height=intrinsics.height,
        distortion_model="plumb_bob",
        D=list(intrinsics.distortion),
        K=intrinsics.matrix.ravel().tolist(),
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=(intrinsics.matrix @ np.eye(3, 4)).ravel().tolist(),
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


def scene_update(request: Draw | None, time: int) -> SceneUpdate:
    """The message of a request to draw; None: all drawings are removed."""
    at = timestamp(time)
    drawings = request.drawings if request else {}
    deletions = [SceneEntityDeletion(at, 1, "")] if request is None or request.clears else []
    deletions += [SceneEntityDeletion(at, 0, name) for name, drawing in drawings.items() if drawing is None]
    entities = tuple(_entity(name, drawing, at) for name, drawing in drawings.items() if drawing is not None)
    return SceneUpdate(tuple(deletions), entities)


def _entity(name: str, drawing: Drawing, at: Timestamp) -> SceneEntity:
    color = Color(*drawing.color)
    lifetime = Duration(*divmod(round((drawing.lifetime or 0.0) * NANOSECONDS), NANOSECONDS))
    parts: dict[str, Any] = {}
    if drawing.kind in ("path", "lines"):
        points = tuple(Point3(*point) for point in drawing.points)
        kind = 0 if drawing.kind == "path" else 2
        parts["lines"] = (LinePrimitive(kind, NO_POSE, drawing.size, points, color),)
    else:
        poses = [FoxglovePose(Vector3(*point), NO_POSE.orientation) for point in drawing.points]
        size = Vector3(drawing.size, drawing.size, drawing.size)
        if drawing.kind == "points":
            parts["spheres"] = tuple(SpherePrimitive(pose, size, color) for pose in poses)
        else:
            parts["texts"] = (TextPrimitive(poses[0], True, drawing.size, color, drawing.text),)
    return SceneEntity(at, "map", name, lifetime, **parts)


SCENE_UPDATE = WireMessage(SceneUpdate)
LASER_SCAN, COMPRESSED_IMAGE = WireMessage(LaserScan), WireMessage(CompressedImage)
CAMERA_CALIBRATION, FRAME_TRANSFORMS = WireMessage(CameraCalibration), WireMessage(FrameTransforms)
