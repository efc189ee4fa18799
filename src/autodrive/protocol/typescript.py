"""Generates TypeScript of the native protocol and the registry of signals (`scripts/generate-messages`)."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator
from enum import IntEnum
from typing import Any, get_args, get_type_hints

import msgspec
import numpy as np
from msgspec.structs import fields

from autodrive.base.arrays import ArrayShape
from autodrive.protocol import channels, native
from autodrive.protocol.channels import HudRow, Plot, Signal
from autodrive.protocol.codec import CODES
from autodrive.protocol.languages import Language
from autodrive.protocol.messages import Command, Event, MapPart
from autodrive.protocol.weather import PRESETS

_ARRAYS = {
    "<f8": "Float64Array",
    "<i8": "BigInt64Array",
    "<f4": "Float32Array",
    "|u1": "Uint8Array",
    "<u2": "Uint16Array",
}
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


class _TypeScript(Language):
    """Declares structs as interfaces."""

    def plain(self, hint: Any) -> str:
        return _PLAIN[hint]

    def literal(self, values: tuple[Any, ...]) -> str:
        return " | ".join(f"'{value}'" for value in values)

    def union(self, hint: Any, parts: list[str]) -> str:
        return " | ".join(parts)

    def mapping(self, value: str) -> str:
        return f"Record<string, {value}>"

    def fixed_tuple(self, parts: list[str]) -> str:
        return f"[{', '.join(parts)}]"

    def sequence(self, element: str) -> str:
        return f"({element})[]"

    def array(self, element: type[np.generic], shape: ArrayShape | None) -> str:
        return _ARRAYS[np.dtype(element).str]

    def enumeration(self, kind: type[IntEnum]) -> str:
        return f"{_comment(kind)}export enum {kind.__name__} {{ {', '.join(f'{m.name} = {m.value}' for m in kind)} }}"

    def struct(self, kind: type[msgspec.Struct]) -> str:
        return f"{_comment(kind)}export interface {kind.__name__} {{\n{''.join(self._members(kind))}}}"

    def _members(self, kind: type[msgspec.Struct]) -> Iterator[str]:
        if (tag := kind.__struct_config__.tag) is not None:
            yield f"  {kind.__struct_config__.tag_field}: '{tag}'\n"
        hints = self.hints(kind)
        for field in fields(kind):
            mark = "?" if kind in _FROM_CLIENT and not field.required else ""
            yield f"  {field.encode_name}{mark}: {hints[field.name]}\n"


def declarations() -> str:
    """The content of messages.ts."""
    language = _TypeScript()
    unions = [f"export type {name} = {language.written(union)}" for name, union in _UNIONS.items()]
    codes = ", ".join(f"{code}: {_ARRAYS[name]}" for name, code in CODES.items())
    parts = [
        "// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.",
        f"export const PROTOCOL = {native.PROTOCOL}",
        f"export const SUBPROTOCOL = '{native.SUBPROTOCOL}'",
        "/** MessagePack extension -> what its bytes are, little-endian. */\n"
        f"export const ARRAYS = {{ {codes} }} as const",
        *language.declared.values(),
        *unions,
        f"/** The weathers that have a name, in the order of the devkit. */\n{_weathers()}",
    ]
    return "\n\n".join(parts) + "\n"


def _comment(kind: type) -> str:
    lines = (inspect.getdoc(kind) or "").splitlines()
    return "/**\n" + "".join(f" * {line}".rstrip() + "\n" for line in lines) + " */\n"


def _weathers() -> str:
    weathers = {name: msgspec.to_builtins(weather) for name, weather in PRESETS.items()}
    return f"export const WEATHERS: Record<string, Weather> = {json.dumps(weathers, indent=2)}"


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


def _members_of_row(kind: type[HudRow | Plot]) -> list[str]:
    return [name for name in get_type_hints(kind) if name != "id"]


def _interface_of_row(name: str, kind: type[HudRow | Plot], comment: str) -> str:
    hints = get_type_hints(kind)
    members = "".join(
        f"  {member}: {'string' if member == 'unit' else _TypeScript().written(hints[member])}\n"
        for member in _members_of_row(kind)
    )
    path = "  /** Path in a VehicleFrame, for example 'imu.euler'. */\n  signal: string\n"
    path += "  /** Only some vehicles have this signal. */\n  optional: boolean\n"
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
