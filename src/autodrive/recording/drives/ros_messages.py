"""Takes ROS messages apart by their definitions, with bounded work; no code is made from a definition."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from autodrive.recording.errors import RecordingError

MAX_DEFINITION = 2**18
"""Longest definition of a message that is read [characters]."""
PADDING = 7
"""Bytes behind a message at most, which fill it up [bytes]."""
MAX_DEPTH = 12
"""Deepest message in a message."""
NUMBERS = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Type of a number in a definition -> format of `struct`."""
_FIELD = re.compile(r"(?P<type>[\w/]+)(?:<=\d+)?(?P<array>\[(?:<=)?\d*\])?\s+(?P<name>\w+)\b(?!\s*=)")
_CONSTANT = re.compile(r"[\w/]+(?:<=\d+)?\s+\w+\s*=")

_HEADER = "std_msgs/Header header\n"
KNOWN = {
    "std_msgs/Header": "time stamp\nstring frame_id",
    "std_msgs/Float32": "float32 data",
    "std_msgs/Float64": "float64 data",
    "std_msgs/Bool": "bool data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/PointStamped": f"{_HEADER}geometry_msgs/Point point",
    "geometry_msgs/PoseStamped": f"{_HEADER}geometry_msgs/Pose pose",
    "geometry_msgs/PoseWithCovarianceStamped": f"{_HEADER}geometry_msgs/PoseWithCovariance pose",
    "geometry_msgs/TransformStamped": f"{_HEADER}string child_frame_id\ngeometry_msgs/Transform transform",
    "geometry_msgs/TwistStamped": f"{_HEADER}geometry_msgs/Twist twist",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Odometry": (
        f"{_HEADER}string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist"
    ),
    "sensor_msgs/Imu": (
        f"{_HEADER}geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
    ),
    "sensor_msgs/JointState": f"{_HEADER}string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    "ackermann_msgs/AckermannDrive": (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk"
    ),
    "ackermann_msgs/AckermannDriveStamped": f"{_HEADER}ackermann_msgs/AckermannDrive drive",
}
"""Definitions of messages of ROS 2, for bags that have none: those of Foxy to Humble with sqlite3."""


class MessageField(NamedTuple):
    """A field of a message."""

    name: str
    type: str
    """Number, 'string', or a message such as 'std_msgs/Header'."""
    size: int | None
    """Length of an array; -1: each message has its own length; None: no array."""


class MessageTypes:
    """The definitions of the messages of a bag."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = dict(KNOWN)
        self._fields: dict[str, tuple[MessageField, ...]] = {}

    def add(self, name: str, text: str) -> None:
        """Add the definition of a message, with those of the messages in it, as bags have it."""
        if len(text) > MAX_DEFINITION:
            raise RecordingError(f"the definition of {name} has more than {MAX_DEFINITION} characters")
        first, *others = re.split(r"^=+\s*$", text, flags=re.MULTILINE)
        parts = {name: first}
        for other in others:
            head, _, body = other.strip().partition("\n")
            parts[_plain(head.removeprefix("MSG:").strip())] = body
        self._texts |= parts

    def fields(self, name: str) -> tuple[MessageField, ...]:
        """The fields of a message. Raises `RecordingError` if its definition is not known."""
        if name not in self._fields:
            if name not in self._texts:
                raise RecordingError(f"the bag has no definition of the message {name}")
            self._fields[name] = tuple(_parsed(self._texts[name], name, self._texts))
        return self._fields[name]


def _parsed(text: str, name: str, known: Mapping[str, str]) -> list[MessageField]:
    fields: list[MessageField] = []
    for line in text.splitlines():
        content = line.partition("#")[0].strip()
        if not content or _CONSTANT.match(content):
            continue
        match = _FIELD.match(content)
        if match is None:
            raise RecordingError(f"the definition of {name} is not understood: '{content[:60]}'")
        array = match["array"]
        digits = (array or "").strip("[]").strip()
        count = None if array is None else -1 if not digits or digits.startswith("<=") else int(digits)
        fields.append(MessageField(match["name"], _full(match["type"], name, known), count))
    return fields


def _full(kind: str, owner: str, known: Mapping[str, str]) -> str:
    """The whole name of a type in the definition of a message."""
    if kind in NUMBERS or kind in {"string", "time", "duration"}:
        return kind
    plain = _plain(kind)
    if plain in {"builtin_interfaces/Time", "builtin_interfaces/Duration"}:
        return "time"
    if "/" in plain:
        return plain
    own = f"{owner.partition('/')[0]}/{plain}"
    return own if own in known else f"std_msgs/{plain}" if plain == "Header" else own


def _plain(name: str) -> str:
    """'geometry_msgs/msg/Pose' and 'geometry_msgs/Pose' are the same."""
    return name.replace("/msg/", "/")


class MessageReader:
    """Reads the bytes of messages; CDR (ROS 2) or the serialization of ROS 1."""

    def __init__(self, types: MessageTypes, *, is_cdr: bool) -> None:
        self._types = types
        self._is_cdr = is_cdr

    def read(self, type_: str, data: bytes) -> dict[str, Any]:
        """The fields of a message by name. Raises `RecordingError` if the data are too short or of another kind."""
        order, start = "<", 0
        if self._is_cdr:
            if len(data) < 4 or data[0] != 0 or data[1] not in {0, 1}:
                raise RecordingError(f"a message {type_} is not in the encoding CDR; is the bag compressed?")
            order, start = "<" if data[1] else ">", 4
        try:
            content = _Bytes(data, start, order, is_aligned=self._is_cdr)
            message = content.message(type_, self._types, 0)
            if content.left > PADDING:  # the sender has another definition
                raise ValueError
            return message
        except (struct.error, ValueError, OverflowError):
            raise RecordingError(f"a message of {len(data)} bytes is no {type_}") from None


class _Bytes:
    """Bytes of a message, and the place up to which they are read."""

    def __init__(self, data: bytes, start: int, order: str, *, is_aligned: bool) -> None:
        self._data, self._start, self._at = data, start, start
        self._order, self._is_aligned = order, is_aligned

    @property
    def left(self) -> int:
        """Bytes that are not read."""
        return len(self._data) - self._at

    def message(self, type_: str, types: MessageTypes, depth: int) -> dict[str, Any]:
        if depth > MAX_DEPTH:
            raise RecordingError(f"the message {type_} contains itself")
        return {field.name: self._field(field, types, depth) for field in types.fields(type_)}

    def _field(self, field: MessageField, types: MessageTypes, depth: int) -> Any:
        if field.size is None:
            return self._value(field.type, types, depth)
        count = self._number("I") if field.size < 0 else field.size
        if count > len(self._data):
            raise ValueError
        if field.type in NUMBERS:
            return self._numbers(NUMBERS[field.type], count)
        return [self._value(field.type, types, depth) for _ in range(count)]

    def _value(self, kind: str, types: MessageTypes, depth: int) -> Any:
        if kind in NUMBERS:
            return self._number(NUMBERS[kind])
        if kind == "string":
            length = self._number("I")
            text = self._data[self._at : self._at + length]
            if len(text) < length:
                raise ValueError
            self._at += length
            return text.rstrip(b"\0").decode(errors="replace")
        if kind in {"time", "duration"}:
            seconds, nanoseconds = self._number("i"), self._number("I")
            return seconds + 1e-9 * nanoseconds
        return self.message(kind, types, depth + 1)

    def _align(self, size: int) -> None:
        if self._is_aligned:
            self._at += -(self._at - self._start) % size

    def _number(self, code: str) -> Any:
        size = struct.calcsize(self._order + code)
        self._align(size)
        (value,) = struct.unpack_from(self._order + code, self._data, self._at)
        self._at += size
        return value

    def _numbers(self, code: str, count: int) -> Any:
        kind = np.dtype(self._order + code)
        if count:
            self._align(kind.itemsize)
        values = np.frombuffer(self._data, kind, count, self._at)
        self._at += count * kind.itemsize
        return values
