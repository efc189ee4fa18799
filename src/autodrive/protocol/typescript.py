"""The messages of the native protocol as TypeScript; `scripts/generate-messages` writes them for the page."""

from __future__ import annotations

import inspect
import types
from collections.abc import Iterator
from enum import IntEnum
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec.structs import fields

from autodrive.protocol import native
from autodrive.protocol.codec import CODES
from autodrive.protocol.messages import Command, Event

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
    "Ask": native.Ask,
    "Event": Event,
    "ClientMessage": native.ClientMessage,
    "ServerMessage": native.ServerMessage,
}
_FROM_CLIENT = {Command, *get_args(native.ClientMessage), *get_args(native.Ask)}
"""They may leave out what has a default; the server writes every field."""


def declarations() -> str:
    """The whole file."""
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
    ]
    return "\n\n".join(parts) + "\n"


def _written(hint: Any, known: dict[type, str]) -> str:
    """A type as TypeScript writes it; structs and enumerations that it needs are added to `known` before it."""
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
    elif origin is np.ndarray:
        written = _ARRAYS[np.dtype(get_args(parts[1])[0]).str]
    elif hint in _PLAIN:
        written = _PLAIN[hint]
    else:
        if hint not in known:
            text = _enumeration(hint) if issubclass(hint, IntEnum) else _interface(hint, known)
            known[hint] = f"{_comment(hint)}{text}"
        written = hint.__name__
    return written


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


if __name__ == "__main__":
    print(declarations(), end="")
