"""Generates the C++ structs of the messages of a client (`scripts/generate-messages`)."""

from __future__ import annotations

import inspect
import json
import textwrap
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

import msgspec
import numpy as np
from msgspec.structs import FieldInfo, fields

from autodrive.base.arrays import ArrayShape
from autodrive.protocol import native
from autodrive.protocol.codec import CODES
from autodrive.protocol.languages import Language, field_comments
from autodrive.protocol.messages import (
    WHEEL_NAMES,
    Command,
    Drawing,
    EncoderReading,
    Event,
    Frame,
    HeardVehicle,
    ObjectFrame,
    VehicleFrame,
    Weather,
)

_MESSAGES = (Command, Weather, Drawing, native.Scan, native.Picture, Frame)
"""Messages that a C++ client sends or reads as structs; all others are JSON."""
_ELEMENTS = {"<f8": "double", "<i8": "std::int64_t", "<f4": "float", "|u1": "std::uint8_t", "<u2": "std::uint16_t"}
_PLAIN = {
    int: "std::int64_t",
    float: "double",
    bool: "bool",
    str: "std::string",
    bytes: "std::vector<std::uint8_t>",
    type(None): "std::nullopt_t",
}
_INITIAL = {
    "std::int64_t": "0",
    "int": "0",
    "double": "0.0",
    "bool": "false",
    "Eigen::Quaterniond": "Eigen::Quaterniond::Identity()",
} | {f"Eigen::Vector{size}d": f"Eigen::Vector{size}d::Zero()" for size in (2, 3, 4)}
"""Type -> value of a field before a message is read; other types have a default of their own."""
_DEFAULTS: dict[tuple[type, str], str] = {(Drawing, "kind"): '"path"'}
"""Default values that only the C++ client has."""

_OTHER_NAMES: dict[type, tuple[tuple[str, str, str], ...]] = {
    EncoderReading: (("std::int64_t", "left_ticks", "ticks[0]"), ("std::int64_t", "right_ticks", "ticks[1]")),
    HeardVehicle: (("int", "headlights", "lights.headlights"), ("int", "indicators", "lights.indicators")),
    VehicleFrame: (
        ("Eigen::Vector3d", "position", "ips.position"),
        ("int", "headlights", "lights.headlights"),
        ("int", "indicators", "lights.indicators"),
        ("std::map<std::string, HeardVehicle>", "heard_vehicles", "v2x.value_or(V2xReading{}).vehicles"),
        ("std::map<std::string, HeardLight>", "heard_lights", "v2x.value_or(V2xReading{}).lights"),
    ),
    ObjectFrame: (
        ("Eigen::Vector3d", "position", "pose.position"),
        ("Eigen::Quaterniond", "orientation", "pose.orientation"),
    ),
}
"""Struct -> type, name and source of fields that repeat a field of a part: the names that C++ programs use."""
_FUNCTIONS = {
    ObjectFrame: "operator const Pose&() const { return pose; }  ///< The pose.",
    VehicleFrame: "double speed() const { return velocity.x(); }  ///< Forward speed [m/s], negative in reverse.",
}

_HEADER = """\
/// \\file
/// The messages of the native protocol. SI units and radians; x forward, y left, z up; left turns are positive. None is
/// an empty `std::optional`. See `docs/protocol.md`.
// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// Native protocol of the simulator.
namespace autodrive {

/// JSON of the library nlohmann::json.
using Json = nlohmann::json;
"""
_EVENT = """\
/// An event. If its type is not known because the simulator is newer, `value` is empty.
struct Event {{
    /// One of the events; `std::monostate` if its type is not known.
    using Value = std::variant<
        std::monostate, {kinds}>;

    std::string type;  ///< "Collision", "OffRoad", "RedLight", "StopSign", "LapCompleted" ...
    double time = 0.0;  ///< simulated time [s]
    std::string vehicle;  ///< name of the vehicle
    std::string other;  ///< name of the other object in a collision, of the traffic light, or of the stop sign
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the map [m]
    Value value;  ///< all fields

    /// The event with all its fields; null if it is not of that type: `event.as<autodrive::LapCompleted>()`.
    template <typename Kind>
    const Kind* as() const {{
        return std::get_if<Kind>(&value);
    }}
}};
"""


class _Cpp(Language):
    """Declares structs; an enumeration is a struct of constants, and its fields are `int`."""

    def plain(self, hint: Any) -> str:
        return _PLAIN[hint]

    def literal(self, values: tuple[Any, ...]) -> str:
        return "std::string"

    def union(self, hint: Any, parts: list[str]) -> str:
        if hint == Event:
            self.declared[Event] = _EVENT.format(kinds=textwrap.fill(", ".join(parts), 100, subsequent_indent=8 * " "))
            return "Event"
        (kind,) = (part for part in parts if part != "std::nullopt_t")
        return f"std::optional<{kind}>"

    def mapping(self, value: str) -> str:
        return f"std::map<std::string, {value}>"

    def fixed_tuple(self, parts: list[str]) -> str:
        if parts == ["double"] * 3:
            return "Eigen::Vector3d"
        (kind,) = set(parts)
        return f"std::array<{kind}, {len(parts)}>"

    def sequence(self, element: str) -> str:
        return f"std::vector<{element}>"

    def array(self, element: type[np.generic], shape: ArrayShape | None) -> str:
        kind = _ELEMENTS[np.dtype(element).str]
        if shape is None:
            return f"std::vector<{kind}>"
        if shape.is_quaternion:
            return "Eigen::Quaterniond"
        return f"Eigen::Vector{shape.size}d" if kind == "double" else f"std::array<{kind}, {shape.size}>"

    def reference(self, kind: type) -> str:
        return "int" if issubclass(kind, IntEnum) else kind.__name__

    def enumeration(self, kind: type[IntEnum]) -> str:
        members = ", ".join(f"{member.name} = {member.value}" for member in kind)
        return f"{_comment(kind)}struct {kind.__name__} {{\n    enum : int {{ {members} }};\n}};\n"

    def struct(self, kind: type[msgspec.Struct]) -> str:
        return f"{_comment(kind)}struct {kind.__name__} {{\n{''.join(self._members(kind))}}};\n"

    def _members(self, kind: type[msgspec.Struct]) -> Iterator[str]:
        if (tag := kind.__struct_config__.tag) is not None:
            yield f'    static constexpr const char* type = "{tag}";\n'
        hints, comments = self.hints(kind), field_comments(kind)
        for field in fields(kind):
            comment = f"  ///< {comments[field.name]}" if field.name in comments else ""
            yield f"    {hints[field.name]} {field.name}{_initial(kind, field, hints[field.name])};{comment}\n"
        for type_, name, source in _OTHER_NAMES.get(kind, ()):
            initial = f" = {_INITIAL[type_]}" if type_ in _INITIAL else ""
            yield f"    {type_} {name}{initial};  ///< `{source.replace('.value_or(V2xReading{})', '')}`\n"
        if kind in _FUNCTIONS:
            yield f"    {_FUNCTIONS[kind]}\n"


def _initial(kind: type[msgspec.Struct], field: FieldInfo, type_: str) -> str:
    value = _DEFAULTS.get((kind, field.name), _INITIAL.get(type_, "{}" if "array<" in type_ else None))
    if isinstance(field.default, int | float | str | tuple) and field.default != "":
        value = json.dumps(field.default).replace("[", "{").replace("]", "}")
    return "" if value is None else f" = {value}"


def _comment(kind: type) -> str:
    return "".join(f"/// {line}".rstrip() + "\n" for line in (inspect.getdoc(kind) or "").splitlines())


def header() -> str:
    """The content of messages.hpp."""
    language = _Cpp()
    for message in _MESSAGES:
        language.written(message)
    structs = [kind for kind in language.declared if isinstance(kind, type) and issubclass(kind, msgspec.Struct)]
    codes = "".join(
        f"template <>\ninline constexpr int array_code<{_ELEMENTS[name]}> = {code};\n" for name, code in CODES.items()
    )
    wheels = ", ".join(f'"{name}"' for name in WHEEL_NAMES)
    parts = [
        _HEADER,
        f"constexpr int PROTOCOL = {native.PROTOCOL};  ///< Version of the protocol.\n"
        f'constexpr const char* SUBPROTOCOL = "{native.SUBPROTOCOL}";  ///< Subprotocol of the WebSocket.\n'
        "/// Order of the wheels in all arrays.\n"
        f"constexpr std::array<const char*, {len(WHEEL_NAMES)}> WHEEL_NAMES = {{{wheels}}};\n",
        *language.declared.values(),
        "/// Another name of `TrafficLightFrame`.\nusing TrafficLight = TrafficLightFrame;\n",
        "}  // namespace autodrive\n",
        "/// \\cond\nnamespace autodrive::wire {\n",
        "// MessagePack extension of an array of these values; 0: there is none\n"
        f"template <typename Value>\ninline constexpr int array_code = 0;\n{codes}",
        "// Calls visit(name, value, is_required) for each field of a message.\n" + "\n".join(map(_visit, structs)),
        "// Sets the fields of a message that repeat others.\ntemplate <typename Message>\n"
        "void repeat(Message&) {}\n" + "".join(map(_repeat, _OTHER_NAMES)),
        "}  // namespace autodrive::wire\n/// \\endcond\n",
    ]
    return "\n".join(parts)


def _visit(kind: type[msgspec.Struct]) -> str:
    calls = "".join(
        f'    visit("{field.name}", m.{field.name}, {"true" if field.required else "false"});\n'
        for field in fields(kind)
    )
    return f"template <typename Visit>\nvoid visit_fields({kind.__name__}& m, Visit visit) {{\n{calls}}}\n"


def _repeat(kind: type) -> str:
    lines = "".join(f"    m.{name} = m.{source};\n" for _, name, source in _OTHER_NAMES[kind])
    return f"inline void repeat({kind.__name__}& m) {{\n{lines}}}\n"
