"""Link frames of a vehicle from its URDF: fixed frames, and frames that move with steering and wheels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple
from xml.etree import ElementTree

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.base.transforms import (
    Quaternion,
    Vector,
    compose,
    inverse,
    quaternion_from_euler,
    quaternion_from_rotation_vector,
    rotate,
)
from autodrive.connect.ros.message import Message, Time


class Transform(NamedTuple):
    """Pose of the frame `child` in the frame `parent`: position [m] and quaternion wxyz."""

    parent: str
    child: str
    position: Vector
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)

    def message(self, stamp: Time) -> Message:
        """The transform as a geometry_msgs/TransformStamped."""
        return Message(
            "geometry_msgs/TransformStamped",
            {
                "header": {"stamp": stamp, "frame_id": self.parent},
                "child_frame_id": self.child,
                "transform": {"translation": xyz(self.position), "rotation": xyzw(self.orientation)},
            },
        )


def xyz(vector: Iterable[float]) -> dict[str, float]:
    """Fields of a Vector3 or a Point."""
    return dict(zip("xyz", map(float, vector), strict=True))


def xyzw(orientation: Iterable[float]) -> dict[str, float]:
    """Fields of a Quaternion, from wxyz."""
    w, x, y, z = map(float, orientation)
    return {"x": x, "y": y, "z": z, "w": w}


def quaternion(message: Any) -> Quaternion:
    """A geometry_msgs/Quaternion as wxyz, with the length 1. Raises CommandError if it is no rotation."""
    components = message.w, message.x, message.y, message.z
    length = math.hypot(*components)
    if not 1e-6 < length < math.inf:
        w, x, y, z = components
        raise CommandError(
            f"the orientation x {x:g}, y {y:g}, z {z:g}, w {w:g} is not a rotation: set w to 1 for no rotation"
        )
    return tuple(part / length for part in components)  # type: ignore[return-value]


def in_parent(frame: Transform, position: Vector, orientation: Quaternion) -> tuple[Vector, Quaternion]:
    """A pose in the frame as a pose in its parent."""
    x, y, z = (a + b for a, b in zip(frame.position, rotate(frame.orientation, position), strict=True))
    return (x, y, z), compose(frame.orientation, orientation)


def relative(frame: Transform, base: Transform) -> tuple[Vector, Quaternion]:
    """Pose of the child of `frame` in the child of `base`; both have the same parent."""
    back = inverse(base.orientation)
    offset = tuple(a - b for a, b in zip(frame.position, base.position, strict=True))
    return rotate(back, offset), compose(back, frame.orientation)  # type: ignore[arg-type]


@dataclass(frozen=True)
class UrdfJoint:
    """A joint of the URDF: `frame` is the pose of its child at angle 0; `axis` is a unit vector, None if fixed."""

    name: str
    frame: Transform
    axis: Vector | None


class Robot:
    """The joints of a URDF; '' has none. Raises AutodriveError if the text is not a URDF."""

    def __init__(self, urdf: str) -> None:
        try:
            joints = [_joint(joint) for joint in ElementTree.fromstring(urdf or "<robot/>").iterfind("joint")]
        except (ElementTree.ParseError, AttributeError, KeyError, ValueError) as error:
            raise AutodriveError(f"the robot_description is not a valid URDF: {error}") from None
        self.fixed = [joint.frame for joint in joints if joint.axis is None]
        """Fixed frames."""
        self.moving = [joint for joint in joints if joint.axis is not None]

    def transforms(self, angles: Mapping[str, float]) -> list[Transform]:
        """Moving frames at these joint angles [rad]; the default angle is 0."""
        return [_turned(joint, angles.get(joint.name, 0.0)) for joint in self.moving]


def _turned(joint: UrdfJoint, angle: float) -> Transform:
    assert joint.axis is not None
    x, y, z = joint.axis
    turn = quaternion_from_rotation_vector((angle * x, angle * y, angle * z))
    return joint.frame._replace(orientation=compose(joint.frame.orientation, turn))


def _joint(joint: ElementTree.Element) -> UrdfJoint:
    origin, axis = joint.find("origin"), joint.find("axis")
    place, turn = ("0 0 0", "0 0 0") if origin is None else (origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"))
    frame = Transform(
        joint.find("parent").attrib["link"],  # type: ignore[union-attr]
        joint.find("child").attrib["link"],  # type: ignore[union-attr]
        _three(place),
        quaternion_from_euler(*_three(turn)),
    )
    if joint.attrib["type"] == "fixed":
        return UrdfJoint(joint.attrib["name"], frame, None)
    direction = _three("1 0 0" if axis is None else axis.attrib["xyz"])
    length = math.hypot(*direction)
    return UrdfJoint(joint.attrib["name"], frame, tuple(part / length for part in direction))  # type: ignore[arg-type]


def _three(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return x, y, z
