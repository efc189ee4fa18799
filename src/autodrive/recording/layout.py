"""Encodes and decodes messages of one layout with code that is generated for it, ten times faster than field by field.

Numbers have a fixed size in our messages, so all messages with the same names, texts and optional parts have the same
bytes but for the numbers. A `Layout` is made from one message; it declines a value of another layout.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from autodrive.recording.errors import RecordingError
from autodrive.recording.wire import BYTES, Field, Message, tag_of, varint

_DOUBLE, _LONG = struct.Struct("<d"), struct.Struct("<q")


class Layout:
    """The layout of the message of a sample; `given` are values that replace attributes of the struct."""

    def __init__(self, message: Message, sample: Any, given: Mapping[str, Any]) -> None:
        self._constant = bytearray()
        self._parts: list[str] = []
        """Expressions of the bytes of a message."""
        self._guards: list[str] = []
        """Conditions under which a value has another layout."""
        self._checks: list[tuple[int, bytes]] = []
        """Places of the constant bytes."""
        self._names: dict[str, Any] = {"f8": _DOUBLE.pack, "i8": _LONG.pack, "at_f8": _DOUBLE.unpack_from}
        self._names |= {"at_i8": _LONG.unpack_from, "frombuffer": np.frombuffer}
        self._size = 0
        fields = self._fields(message, "v", sample, given)
        self._end_constant()
        encode = f"def encode(v, given):\n    if {' or '.join(self._guards) or 'False'}:\n        return None\n"
        encode += f"    data = b''.join(({', '.join(self._parts)},))\n"
        encode += f"    return data if len(data) == {self._size} else None\n"
        decode = "def decode(d):\n"
        decode += f"    return {{{', '.join(f'{name!r}: {value}' for name, value in fields)}}}\n"
        exec(encode + decode, self._names)
        self.encode = self._names["encode"]
        """The message of a value, with `given`; None if it has another layout."""
        self._decode = self._names["decode"]

    def decode(self, data: bytes) -> dict[str, Any] | None:
        """The fields of a message; None if it has another layout."""
        if len(data) != self._size or any(data[at : at + len(one)] != one for at, one in self._checks):
            return None
        return self._decode(data)

    # -- generating ------------------------------------------------------------------------------------------------

    def _fields(
        self, message: Message, of: str, sample: Any, given: Mapping[str, Any] | None = None
    ) -> list[tuple[str, str]]:
        """Adds the fields of a struct; name and decoding expression of each."""
        found: list[tuple[str, str]] = []
        for field in message.fields:
            if given is not None and field.name in given:
                path, value = f"given[{field.name!r}]", given[field.name]
            else:
                path, value = f"{of}.{field.name}", getattr(sample, field.name)
            if field.number < 0:  # the file that is read does not have it
                found.append((field.name, self._constant_of(value)))
            elif value is None:
                self._guards.append(f"{path} is not None")
                found.append((field.name, "None"))
            else:
                if field.is_optional:
                    self._guards.append(f"{path} is None")
                found.append((field.name, self._field(field, path, value)))
        return found

    def _field(self, field: Field, path: str, value: Any) -> str:
        if field.is_map:
            return self._map(field, path, value)
        if field.message is not None and not field.is_list:
            data = field.encode(value)
            self._add(tag_of(field) + varint(len(data)))
            return self._struct(field.message, path, value)
        if field.dtype in {"<f8", "<i8"} and field.wire != BYTES:
            self._add(tag_of(field))
            return self._number(field.dtype[1:], path)
        if field.dtype and field.wire == BYTES:
            return self._array(field, path, value)
        if field.dtype:  # a bool or an enumeration, one byte
            self._add(tag_of(field))
            self._end_constant()
            self._parts.append(f"bytes(({path},))")
            text = f"d[{self._size}]"
            self._size += 1
            kind = self._name(field.enum or bool)
            return f"{kind}({text})"
        self._guards.append(f"{path} != {self._name(value)}")  # a text or a list: part of the layout
        for one in field.encode(value) if field.is_list else [field.encode(value)]:
            data = bytes(one)
            self._add(tag_of(field) + (varint(len(data)) if field.wire == BYTES else b"") + data)
        return self._constant_of(value)

    def _map(self, field: Field, path: str, value: Mapping[str, Any]) -> str:
        self._guards.append(f"tuple({path}) != {self._name(tuple(value))}")
        assert field.message is not None
        item = field.message.by_number[2]
        entries: list[str] = []
        for (key, one), data in zip(value.items(), field.encode(value), strict=True):
            text = key.encode()
            self._add(tag_of(field) + varint(len(data)) + b"\x0a" + varint(len(text)) + text)
            entries.append(f"{key!r}: {self._field(item, f'{path}[{key!r}]', one)}")
        return f"{{{', '.join(entries)}}}"

    def _struct(self, message: Message, path: str, value: Any) -> str:
        fields = self._fields(message, path, value)
        return f"{self._name(message.kind)}({', '.join(f'{name}={text}' for name, text in fields)})"

    def _number(self, kind: str, path: str) -> str:
        self._end_constant()
        self._parts.append(f"{kind}({path})")
        self._size += 8
        return f"at_{kind}(d, {self._size - 8})[0]"

    def _array(self, field: Field, path: str, value: Any) -> str:
        data = field.encode(value)
        self._add(tag_of(field) + varint(len(data)))
        self._end_constant()
        is_array = isinstance(value, np.ndarray)
        self._parts.append(f"{path}.tobytes()" if is_array else f"{self._name(field.encode)}({path})")
        dtype = np.dtype(field.dtype)
        if is_array:
            self._guards.append(f"{path}.dtype is not {self._name(dtype)}")
        read = f"frombuffer(d, {self._name(dtype)}, {len(data) // dtype.itemsize}, {self._size})"
        self._size += len(data)
        return read if is_array else f"{type(value).__name__}({read}.tolist())"

    def _add(self, data: bytes) -> None:
        self._constant += data

    def _end_constant(self) -> None:
        if self._constant:
            data = bytes(self._constant)
            self._checks.append((self._size, data))
            self._parts.append(self._name(data))
            self._size += len(data)
            self._constant.clear()

    def _name(self, value: Any) -> str:
        name = f"k{len(self._names)}"
        self._names[name] = value
        return name

    def _constant_of(self, value: Any) -> str:
        return f"dict({self._name(value)})" if type(value) is dict else self._name(value)


class FastMessage:
    """A Message with a few layouts; falls back to the field by field coding of the Message."""

    def __init__(self, message: Message) -> None:
        self.message = message
        self._layouts: list[Layout] = []

    def encode(self, value: Any, given: Mapping[str, Any]) -> bytes:
        """The message of a struct, where `given` replaces attributes."""
        for layout in self._layouts:
            if (data := layout.encode(value, given)) is not None:
                return data
        self._add(value, given)
        return self.message.encode(_Replaced(value, given))

    def decode(self, data: bytes) -> dict[str, Any]:
        """The fields of a message. Raises `RecordingError`."""
        for layout in self._layouts:
            try:
                found = layout.decode(data)
            except ValueError as error:  # the number of an enumeration that is not known
                raise RecordingError(f"a message '{self.message.name}' is damaged: {error}") from None
            if found is not None:
                return found
        values = self.message.decode(data)
        if msgspec.NODEFAULT not in _scalars(list(values.values())):
            self._add(None, values)
        return values

    def _add(self, value: Any, given: Mapping[str, Any]) -> None:
        self._layouts.insert(0, Layout(self.message, value, given))
        del self._layouts[MAX_LAYOUTS:]


MAX_LAYOUTS = 4
"""Layouts of one kind of message that are kept, such as those with and without a camera that is switched on."""


def _scalars(values: Sequence[Any]) -> list[Any]:
    return [value for value in values if not isinstance(value, np.ndarray | dict | tuple)]


class _Replaced:
    """An object with other values of some attributes."""

    def __init__(self, of: Any, replaced: Mapping[str, Any]) -> None:
        self.__dict__.update(replaced)
        self._of = of

    def __getattr__(self, name: str) -> Any:
        return getattr(self._of, name)
