"""Encodes the structs of a recording as Protocol Buffers; the schema of each message is derived from its struct."""

from __future__ import annotations

import enum
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from autodrive.base.arrays import element_type, read_only
from autodrive.base.texts import with_encodable_texts
from autodrive.recording.errors import RecordingError

_SCALARS: dict[type, str] = {
    float: "TYPE_DOUBLE",
    int: "TYPE_SFIXED64",
    bool: "TYPE_BOOL",
    str: "TYPE_STRING",
    bytes: "TYPE_BYTES",
}
_ELEMENTS = {"f8": "TYPE_DOUBLE", "f4": "TYPE_FLOAT", "i8": "TYPE_SFIXED64", "u1": "TYPE_BYTES"}
_IMPORTS = {"foxglove": ("google.protobuf", "autodrive"), "autodrive": ("google.protobuf",)}

MAX_SIZE = 2**22
"""Largest message that is read [bytes], besides those with images."""
MAX_ELEMENTS = 10_000
"""Texts or messages in a field that are read."""

Schemas: TypeAlias = Mapping[str, Any]
"""The pool of descriptors of each schema of a file, by name of the message."""

NAMES: dict[str, str] = {}
"""Structs whose message has another name than `autodrive.` and that of the struct."""
PUBLISHED: dict[str, dict[str, int]] = {}
"""Field numbers of schemas that others have published."""


@dataclass(frozen=True)
class WireInteger:
    """An integer with another type in the schema than `int` has, for schemas that others have published."""

    type: str


@dataclass(frozen=True)
class Field:
    """One field of a message. `write(message, value)` and `read(message)` are for messages of the package protobuf."""

    name: str
    number: int
    type: str
    """Name of its type in the schema."""
    write: Callable[[Any, Any], None]
    read: Callable[[Any], Any]
    default: Any
    is_repeated: bool = False
    is_map: bool = False
    is_optional: bool = False
    message: WireMessage | None = None
    enum: type[enum.IntEnum] | None = None

    @property
    def has_presence(self) -> bool:
        """Whether a message may be without it."""
        return not self.is_repeated and (self.is_optional or self.message is not None)


class WireMessage:
    """The Protocol Buffers message of a struct. Field numbers are the order of the fields, from 1.

    `name`: that of the schema. `replaced`: other types of fields, by name. `schemas`: those of a file that is read; a
    field that the file does not have has its default. `max_size`: of a message that is read [bytes].
    """

    def __init__(
        self,
        kind: type[msgspec.Struct],
        *,
        name: str = "",
        replaced: Mapping[str, Any] | None = None,
        schemas: Schemas | None = None,
        max_size: int = MAX_SIZE,
    ) -> None:
        self.kind = kind
        self._max_size = max_size
        self.name = name or NAMES.get(kind.__name__, f"autodrive.{kind.__name__}")
        self._schemas = schemas or {}
        hints = get_type_hints(kind, include_extras=True) | dict(replaced or {})
        known = PUBLISHED.get(self.name, {})
        self.fields = [
            _field(field.name, known.get(field.name, number), hints[field.name], _default(field))
            for number, field in enumerate(msgspec.structs.fields(kind), 1)
        ]
        self.by_name = {field.name: field for field in self.fields}
        self._writers = [(field.name, field.write) for field in self.fields]

    def encode(self, value: Any, replacing: Mapping[str, Any] | None = None) -> bytes:
        """The message of a struct, or of any object with these attributes; values of `replacing` replace attributes."""
        replacing = replacing or {}
        try:
            return self._encoded(value, replacing)
        except UnicodeEncodeError:
            return self._encoded(with_encodable_texts(value), with_encodable_texts(replacing))

    def _encoded(self, value: Any, replacing: Mapping[str, Any]) -> bytes:
        message = self._class()
        for name, write in self._writers:
            content = replacing[name] if name in replacing else getattr(value, name)
            if content is not None:
                write(message, content)
        return message.SerializeToString()

    def decode(self, data: bytes) -> dict[str, Any]:
        """The values of the fields, by name; a field that is missing in the file has the default of the struct.

        Raises `RecordingError`.
        """
        return self._parsed([data], self.values)[0]

    def struct(self, data: bytes) -> Any:
        """The struct of a message. Raises `RecordingError`."""
        return self._parsed([data], self.read)[0]

    def columns(self, paths: Sequence[Sequence[str]], messages: Sequence[bytes]) -> list[list[Any]]:
        """Values of each path of fields, one for each message; None where it is missing. Raises `RecordingError`."""
        rows = self._parsed(messages, lambda message: [self._value(path, message) for path in paths])
        return [list(column) for column in zip(*rows, strict=True)] or [[] for _ in paths]

    def _parsed(self, messages: Sequence[bytes], read: Callable[[Any], Any]) -> list[Any]:

        parse = self._class.FromString
        if (size := max(map(len, messages), default=0)) > self._max_size:
            raise RecordingError(f"a message '{self.name}' has {size} bytes; at most {self._max_size} are read")
        try:
            return [read(parse(message)) for message in messages]
        except (DecodeError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise RecordingError(f"a message '{self.name}' is damaged: {error}") from None

    # -- messages of the package protobuf --------------------------------------------------------------------------

    def write(self, message: Any, value: Any) -> None:
        """Write the fields of a struct into a message."""
        for name, write in self._writers:
            content = getattr(value, name)
            if content is not None:
                write(message, content)

    def values(self, message: Any) -> dict[str, Any]:
        """The values of the fields of a message."""
        known = message.DESCRIPTOR.fields_by_name
        return {
            field.name: _read(field, message) if field.name in known else _copied(field.default)
            for field in self.fields
        }

    def read(self, message: Any) -> Any:
        """The struct of a message. Raises `TypeError`."""
        values = self.values(message)
        return self.kind(**{name: value for name, value in values.items() if value is not msgspec.NODEFAULT})

    def _value(self, path: Sequence[str], message: Any) -> Any:
        field = self.by_name[path[0]]
        if field.name not in message.DESCRIPTOR.fields_by_name:
            return None if field.default is msgspec.NODEFAULT else field.default
        if field.has_presence and not message.HasField(field.name):
            return None
        if len(path) == 1:
            return field.read(message)
        assert field.message is not None
        return field.message._value(path[1:], getattr(message, field.name))

    @cached_property
    def _class(self) -> Any:
        """The class of its messages, from the schema of the file, or else from the struct."""
        own = pool_of(descriptor(self)).FindMessageTypeByName(self.name)
        if self.name not in self._schemas:
            return message_factory.GetMessageClass(own)
        try:
            foreign = self._schemas[self.name].FindMessageTypeByName(self.name)
        except KeyError:
            raise RecordingError(
                f"the schema of '{self.name}' is damaged: the schema does not describe '{self.name}'"
            ) from None
        _check_types(foreign, own, set())
        return message_factory.GetMessageClass(foreign)


# -- schemas -------------------------------------------------------------------------------------------------------


def pool_of(schema: bytes) -> Any:
    """The pool of the descriptors of a `google.protobuf.FileDescriptorSet`. Raises `RecordingError`."""
    pool = descriptor_pool.DescriptorPool()
    try:
        for file in descriptor_pb2.FileDescriptorSet.FromString(schema).file:
            for message in file.message_type:
                for nested in message.nested_type:
                    nested.options.ClearField("map_entry")  # the entries of a map keep their order
            pool.Add(file)
    except (DecodeError, TypeError, ValueError, KeyError) as error:
        raise RecordingError(f"a schema is damaged: {error}") from None
    return pool


def _check_types(foreign: Any, own: Any, seen: set[str]) -> None:
    """Raises `RecordingError` if a field of a message of a file has another type than here."""
    if own.full_name in seen:
        return
    seen.add(own.full_name)
    foreign_types, own_types = _types(foreign), _types(own)
    for name in foreign_types.keys() & own_types.keys():
        if foreign_types[name] != own_types[name]:
            raise RecordingError(f"in the file, the field '{name}' of '{own.full_name}' has another type than here")
        inner = own.fields_by_name[name].message_type
        if inner is not None:
            _check_types(foreign.fields_by_name[name].message_type, inner, seen)


def _types(descriptor: Any) -> dict[str, tuple[int, bool]]:
    """Type of each field of a message, and whether it is repeated."""
    described = descriptor_pb2.DescriptorProto()
    descriptor.CopyToProto(described)
    return {field.name: (field.type, field.label == field.LABEL_REPEATED) for field in described.field}


def descriptor(message: WireMessage) -> bytes:
    """The schema of a message: a serialized `google.protobuf.FileDescriptorSet` with all messages that it contains."""
    files: dict[str, Any] = {}
    _describe(message, files, set())
    for package, file in files.items():
        file.dependency.extend(files[imported].name for imported in _IMPORTS.get(package, ()) if imported in files)
    order = ["google.protobuf", "autodrive", "foxglove"]
    ordered = [files[package] for package in sorted(files, key=order.index)]
    return descriptor_pb2.FileDescriptorSet(file=ordered).SerializeToString()


def _describe(message: WireMessage, files: dict[str, Any], seen: set[str]) -> None:
    """Add a message, and those that it contains, to the file of its package."""
    package, _, name = message.name.rpartition(".")
    if message.name in seen:
        return
    seen.add(message.name)
    described = descriptor_pb2.DescriptorProto(name=name)
    for field in message.fields:
        _describe_field(described, field, f".{message.name}", files, seen)
    _file(package, files).message_type.append(described)


def _describe_field(described: Any, field: Field, parent: str, files: dict[str, Any], seen: set[str]) -> None:

    label = "LABEL_REPEATED" if field.is_repeated else "LABEL_OPTIONAL"
    added = described.field.add(
        name=field.name,
        number=field.number,
        label=descriptor_pb2.FieldDescriptorProto.Label.Value(label),
        type=descriptor_pb2.FieldDescriptorProto.Type.Value(field.type),
    )
    if field.is_map:
        assert field.message is not None
        entry = described.nested_type.add(name="".join(part.capitalize() for part in field.name.split("_")) + "Entry")
        entry.options.map_entry = True
        added.type_name = f"{parent}.{entry.name}"
        for inner_field in field.message.fields:
            _describe_field(entry, inner_field, added.type_name, files, seen)
    elif field.message is not None:
        _describe(field.message, files, seen)
        added.type_name = f".{field.message.name}"
    elif field.enum is not None:
        added.type_name = f".autodrive.{field.enum.__name__}"
        if added.type_name not in seen:
            seen.add(added.type_name)
            values = _file("autodrive", files).enum_type.add(name=field.enum.__name__).value
            for inner_field in field.enum:
                values.add(name=f"{field.enum.__name__.upper()}_{inner_field.name}", number=int(inner_field))
    if field.has_presence and field.message is None:
        added.proto3_optional, added.oneof_index = True, len(described.oneof_decl)
        described.oneof_decl.add(name=f"_{field.name}")


def _file(package: str, files: dict[str, Any]) -> Any:

    if package not in files:
        name = f"{package.replace('.', '/')}.proto"
        files[package] = descriptor_pb2.FileDescriptorProto(name=name, package=package, syntax="proto3")
    return files[package]


# -- fields --------------------------------------------------------------------------------------------------------


def _field(name: str, number: int, hint: Any, default: Any) -> Field:
    is_optional = get_origin(hint) in {Union, types.UnionType} and type(None) in get_args(hint)
    if is_optional:
        (hint,) = (argument for argument in get_args(hint) if argument is not type(None))
        default = None if default is msgspec.NODEFAULT else default
    if get_origin(hint) is Annotated:
        integers = [argument for argument in get_args(hint)[1:] if isinstance(argument, WireInteger)]
        hint = integers[0] if integers else get_args(hint)[0]

    def field(type_: str, write: Callable[[Any, Any], None], read: Callable[[Any], Any], **more: Any) -> Field:
        return Field(name, number, type_, write, read, default, is_optional=is_optional, **more)

    def set_(message: Any, value: Any) -> None:
        setattr(message, name, value)

    def get(message: Any) -> Any:
        return getattr(message, name)

    if (kind := element_type(hint)) is not None:
        return _array(field, name, np.dtype(kind))
    if get_origin(hint) is Literal:
        hint = str
    if isinstance(hint, type) and issubclass(hint, enum.IntEnum):
        kind = hint
        return field("TYPE_ENUM", set_, lambda message: kind(get(message)), enum=kind)
    if isinstance(hint, type) and issubclass(hint, msgspec.Struct):
        inner = WireMessage(hint)

        def write_struct(message: Any, value: Any) -> None:
            part = getattr(message, name)
            part.SetInParent()
            inner.write(part, value)

        return field("TYPE_MESSAGE", write_struct, lambda message: inner.read(get(message)), message=inner)
    if hint is bool:
        return field("TYPE_BOOL", lambda message, value: set_(message, bool(value)), get)
    if isinstance(hint, WireInteger) or hint in _SCALARS:
        return field(hint.type if isinstance(hint, WireInteger) else _SCALARS[hint], set_, get)
    return _collection(field, name, hint)


def _array(field: Callable[..., Field], name: str, dtype: np.dtype[Any]) -> Field:
    type_ = _ELEMENTS[dtype.str[1:]]
    if type_ == "TYPE_BYTES":
        return field(
            type_,
            lambda message, value: setattr(message, name, np.asarray(value, dtype).tobytes()),
            lambda message: np.frombuffer(getattr(message, name), dtype),
        )
    return field(
        type_,
        lambda message, value: getattr(message, name).extend(value.tolist()),
        lambda message: read_only(np.array(getattr(message, name), dtype)),
        is_repeated=True,
    )


def _collection(field: Callable[..., Field], name: str, hint: Any) -> Field:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is dict:
        entry = WireMessage.__new__(WireMessage)
        entry.fields = [_field("key", 1, str, ""), _field("value", 2, arguments[1], None)]
        value = entry.fields[1]

        def write_map(message: Any, content_by_key: Mapping[str, Any]) -> None:
            add = getattr(message, name).add
            for key, content in content_by_key.items():
                value.write(add(key=key), content)

        def read_map(message: Any) -> dict[str, Any]:
            return {part.key: value.read(part) for part in _few(getattr(message, name))}

        return field("TYPE_MESSAGE", write_map, read_map, is_repeated=True, is_map=True, message=entry)
    kind_of_value: Any = arguments[0] if arguments else float
    kind = tuple if origin is tuple else list
    if kind_of_value in _SCALARS and all(argument in (kind_of_value, Ellipsis) for argument in arguments):
        return field(
            _SCALARS[kind_of_value],
            lambda message, values: getattr(message, name).extend(values),
            lambda message: kind(_few(getattr(message, name), kind_of_value)),
            is_repeated=True,
        )
    if isinstance(kind_of_value, type) and issubclass(kind_of_value, msgspec.Struct):
        inner = WireMessage(kind_of_value)

        def write_all(message: Any, values: Sequence[Any]) -> None:
            for value in values:
                inner.write(getattr(message, name).add(), value)

        return field(
            "TYPE_MESSAGE",
            write_all,
            lambda message: kind(map(inner.read, _few(getattr(message, name)))),
            is_repeated=True,
            message=inner,
        )
    raise TypeError(f"the type {hint} of field '{name}' cannot be recorded")


def _few(values: Any, kind: type = object) -> Any:
    """The values of a repeated field, which need much more memory than in the file. Raises `ValueError`."""
    if len(values) > MAX_ELEMENTS and kind not in {int, float, bool}:
        raise ValueError(f"a field has {len(values)} elements; at most {MAX_ELEMENTS} are read")
    return values


def _read(field: Field, message: Any) -> Any:
    """The value of a field of a message; its default if the message is without it."""
    if field.has_presence and not message.HasField(field.name):
        return field.default
    return field.read(message)


def _default(field: Any) -> Any:
    return field.default_factory() if field.default_factory is not msgspec.NODEFAULT else field.default


def _copied(default: Any) -> Any:
    return dict(default) if isinstance(default, dict) else default
