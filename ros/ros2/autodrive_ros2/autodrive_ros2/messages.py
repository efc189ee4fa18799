"""Converts messages of `autodrive.ros` to ROS 2 messages."""

from __future__ import annotations

import importlib
import re
from array import array
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from autodrive.connect.ros.message import Fields
from autodrive.ros import Message

CODES = {
    "float": "f",
    "double": "d",
    "int8": "b",
    "uint8": "B",
    "octet": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
}
"""Element type of a sequence -> type code of `array.array`, which rclpy accepts without checking each element."""

SEQUENCE = re.compile(r"sequence<([^,>]+)(?:, \d+)?>")
ARRAY = re.compile(r"(.+)\[\d+\]")


@cache
def message_type(name: str) -> type:
    """Class of a message type, for example 'sensor_msgs/LaserScan'. Raises ImportError if it is not installed."""
    package, _, kind = name.partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), kind)
    except AttributeError:
        raise ImportError(f"{package} has no message {kind}") from None


def build(message: Message) -> Any:
    """A ROS message; fields that are not given keep their defaults."""
    return _builder(message.type)(message.fields)


@cache
def _builder(name: str) -> Callable[[Any], Any]:
    """A function that builds messages of a type from fields; the type is inspected once."""
    kind = message_type(name)
    if name == "builtin_interfaces/Time":
        return lambda time: kind(sec=time.sec, nanosec=time.nanosec)
    converters = {field: _converter(type_) for field, type_ in kind.get_fields_and_field_types().items()}

    def make(fields: Fields | Message) -> Any:
        if isinstance(fields, Message):
            fields = fields.fields
        made = kind()
        for field, value in fields.items():
            setattr(made, field, converters[field](value))
        return made

    return make


def _converter(type_: str) -> Callable[[Any], Any]:
    """A function that converts a value to a field type."""
    if match := ARRAY.fullmatch(type_):
        return np.asarray if match[1] in CODES else list
    if match := SEQUENCE.fullmatch(type_):
        return _sequence(match[1])
    if "/" in type_:
        return _builder(type_)
    return {"float": float, "double": float, "boolean": bool, "string": str}.get(type_, int)


def _sequence(element: str) -> Callable[[Any], Any]:
    if code := CODES.get(element):
        kind = np.dtype(code)
        return lambda value: array(code, value if isinstance(value, bytes) else np.asarray(value, kind).tobytes())
    convert = _converter(element)
    return lambda values: [convert(value) for value in values]
