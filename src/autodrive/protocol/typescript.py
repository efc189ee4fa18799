"""Generates TypeScript of the native protocol and the registry of signals (`scripts/generate-messages`)."""

from __future__ import annotations

import inspect
import json
import types
from collections.abc import Iterator
from enum import IntEnum
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec.structs import fields

from autodrive.base.arrays import element_type
from autodrive.protocol import channels, native
from autodrive.protocol.channels import HudRow, Plot, Signal
from autodrive.protocol.codec import CODES
from autodrive.protocol.messages import Command, Event, MapPart
from autodrive.protocol.weather import PRESETS

_ARRAYS = {"<f8": "Float64Array", "<i8": "BigInt64Array", "<f4": "Float32Array", "|u1": "Uint8Array"}
_PLAIN = {
    int: "number",
    float: "number",
    bool: "boolean",
    str: "string",
    bytes: "Uint8Array",
    type(None): "null",
    Any: "any",
}
_UNIONS = {
    "ServerOperation": native.ServerOperation,
    "Event": Event,
    "MapPart": MapPart,
    "ClientMessage": native.ClientMessage,
    "ServerMessage": native.ServerMessage,
}
_FROM_CLIENT = {Command, *get_args(native.ClientMessage), *get_args(native.ServerOperation)}
"""Messages from the client: fields with a default are optional. The server sends every field."""


def declarations() -> str:
    """The content of messages.ts."""
    known: dict[type, str] = {}
    unions = [f"export type {name} = {_written(union, known)}" for name, union in _UNIONS.items()]
    codes = ", ".join(f"{code}: {_ARRAYS[name]}" for name, code in CODES.items())
    parts = [
        "// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.",
        f"export const PROTOCOL = {native.PROTOCOL}",
        f"export const SUBPROTOCOL = '{native.SUBPROTOCOL}'",
        "/** MessagePack extension -> what its bytes are, little-endian. */\n"
        f"export const ARRAYS = {{ {codes} }} as const",
        *known.values(),
        *unions,
        f"/** The weathers that have a name, in the order of the devkit. */\n{_weathers()}",
    ]
    return "\n\n".join(parts) + "\n"


def _written(hint: Any, known: dict[type, str]) -> str:
    """A type in TypeScript; the structs and enumerations that it refers to are added to `known` first."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in {Union, types.UnionType}:
        written = " | ".join(_written(part, known) for part in parts)
    elif origin is Literal:
        written = " | ".join(f"'{part}'" for part in parts)
    elif origin is dict:
        written = f"Record<string, {_written(parts[1], known)}>"
    elif origin is tuple and parts[-1] is not ...:
        written = f"[{', '.join(_written(part, known) for part in parts)}]"
    elif origin in {list, tuple}:
        written = f"({_written(parts[0], known)})[]"
    elif element := element_type(hint):
        written = _ARRAYS[np.dtype(element).str]
    elif hint in _PLAIN:
        written = _PLAIN[hint]
    else:
        if hint not in known:
            text = _enumeration(hint) if issubclass(hint, IntEnum) else _interface(hint, known)
            known[hint] = f"{_comment(hint)}{text}"
        written = hint.__name__
    return written


def _weathers() -> str:
    weathers = {name: msgspec.to_builtins(one) for name, one in PRESETS.items()}
    return f"export const WEATHERS: Record<string, Weather> = {json.dumps(weathers, indent=2)}"


def _enumeration(of: type[IntEnum]) -> str:
    return f"export enum {of.__name__} {{ {', '.join(f'{one.name} = {one.value}' for one in of)} }}"


def _interface(of: type[msgspec.Struct], known: dict[type, str]) -> str:
    return f"export interface {of.__name__} {{\n{''.join(_members(of, known))}}}"


def _members(of: type[msgspec.Struct], known: dict[type, str]) -> Iterator[str]:
    if (tag := of.__struct_config__.tag) is not None:
        yield f"  {of.__struct_config__.tag_field}: '{tag}'\n"
    hints = get_type_hints(of)
    for field in fields(of):
        mark = "?" if of in _FROM_CLIENT and not field.required else ""
        yield f"  {field.encode_name}{mark}: {_written(hints[field.name], known)}\n"


def _comment(of: type) -> str:
    lines = (inspect.getdoc(of) or "").splitlines()
    return "/**\n" + "".join(f" * {line}".rstrip() + "\n" for line in lines) + " */\n"


def signal_tables() -> str:
    """The registry of signals as the page needs it: `channels.ts`."""
    rows = [_row(signal, signal.hud) for signal in channels.SIGNALS if signal.hud]
    plots = [_row(signal, plot) for signal in channels.SIGNALS for plot in signal.plots]
    parts = [
        "// Generated from src/autodrive/protocol/channels.py by scripts/generate-messages: change the signals there.",
        _interface_of_row("HudRow", HudRow, "A row of the HUD that shows a signal."),
        _interface_of_row("Plot", Plot, "A curve of the plots."),
        _constant("HUD_ROWS", rows, "Record<string, HudRow>"),
        _constant("PLOTS", plots, "Record<string, Plot>"),
    ]
    return "\n\n".join(parts) + "\n"


def _row(signal: Signal, row: HudRow | Plot) -> dict[str, Any]:
    values = {name: getattr(row, name) for name in ("id", *_members_of_row(type(row)))}
    unit = signal.unit if row.unit is None else row.unit
    return values | {"unit": unit, "signal": signal.name, "optional": signal.is_optional}


def _members_of_row(of: type[HudRow | Plot]) -> list[str]:
    return [name for name in get_type_hints(of) if name != "id"]


def _interface_of_row(name: str, of: type[HudRow | Plot], comment: str) -> str:
    hints = get_type_hints(of)
    members = "".join(
        f"  {member}: {'string' if member == 'unit' else _written(hints[member], {})}\n"
        for member in _members_of_row(of)
    )
    path = "  /** Path in a VehicleFrame, for example 'imu.euler'. */\n  signal: string\n"
    path += "  /** Only some vehicles have it. */\n  optional: boolean\n"
    return f"/** {comment} */\nexport interface {name} {{\n{members}{path}}}"


def _constant(name: str, rows: list[dict[str, Any]], type_: str) -> str:
    lines = []
    for row in rows:
        members = ", ".join(f"{key}: {_literal(value)}" for key, value in row.items() if key != "id")
        lines.append(f"  {_literal(row['id'])}: {{ {members} }},\n")
    return f"export const {name} = {{\n{''.join(lines)}}} as const satisfies {type_}"


def _literal(value: str | float) -> str:
    if isinstance(value, str):
        return "'" + value.replace("'", "\\'") + "'"
    return json.dumps(value)
