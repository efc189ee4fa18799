"""The walk over the types of the messages, from which their definitions in other languages are written."""

from __future__ import annotations

import ast
import inspect
import textwrap
import types
from abc import ABC, abstractmethod
from enum import IntEnum
from itertools import pairwise
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from autodrive.base.arrays import ArrayShape, element_type


def field_comments(kind: type) -> dict[str, str]:
    """The texts below fields of a class, by the name of the field, each in one line."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    comments = {}
    for field, text in pairwise(definition.body if isinstance(definition, ast.ClassDef) else []):
        match field, text:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(comment))):
                comments[name] = " ".join(comment.split())
    return comments


class Language(ABC):
    """Writes types in a language.

    `declared`: struct, enumeration or union -> its declaration, after those that it needs.
    """

    def __init__(self) -> None:
        self.declared: dict[Any, str] = {}

    def written(self, hint: Any) -> str:
        """A type in the language; the structs and enumerations that it refers to are declared first."""
        origin, parts = get_origin(hint), get_args(hint)
        shape = next((note for note in parts if isinstance(note, ArrayShape)), None)
        if element := element_type(parts[0] if shape else hint):
            text = self.array(element, shape)
        elif origin is Annotated:
            text = self.written(parts[0])
        elif origin in {Union, types.UnionType}:
            text = self.union(hint, [self.written(part) for part in parts])
        elif origin is Literal:
            text = self.literal(parts)
        elif origin is dict:
            text = self.mapping(self.written(parts[1]))
        elif origin is tuple and parts[-1] is not ...:
            text = self.fixed_tuple([self.written(part) for part in parts])
        elif origin in {list, tuple}:
            text = self.sequence(self.written(parts[0]))
        elif isinstance(hint, type) and issubclass(hint, IntEnum | msgspec.Struct):
            if hint not in self.declared:
                self.declared[hint] = self.enumeration(hint) if issubclass(hint, IntEnum) else self.struct(hint)
            text = self.reference(hint)
        else:
            text = self.plain(hint)
        return text

    def hints(self, kind: type[msgspec.Struct]) -> dict[str, str]:
        """The types of the fields of a struct in the language, by name."""
        return {name: self.written(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}

    def reference(self, kind: type) -> str:
        """A struct or enumeration that is declared, as the type of a field."""
        return kind.__name__

    @abstractmethod
    def plain(self, hint: Any) -> str:
        """A type without parts, such as `float`, `None` or `Any`."""

    @abstractmethod
    def literal(self, values: tuple[Any, ...]) -> str:
        """One of several texts."""

    @abstractmethod
    def union(self, hint: Any, parts: list[str]) -> str:
        """One of several types; `hint` is the union in Python."""

    @abstractmethod
    def mapping(self, value: str) -> str:
        """Values by name."""

    @abstractmethod
    def fixed_tuple(self, parts: list[str]) -> str:
        """A tuple of a fixed length."""

    @abstractmethod
    def sequence(self, element: str) -> str:
        """Any number of elements."""

    @abstractmethod
    def array(self, element: type[np.generic], shape: ArrayShape | None) -> str:
        """An array; `shape` None: of any length."""

    @abstractmethod
    def enumeration(self, kind: type[IntEnum]) -> str:
        """The declaration of an enumeration, with its comment."""

    @abstractmethod
    def struct(self, kind: type[msgspec.Struct]) -> str:
        """The declaration of a struct, with its comment."""
