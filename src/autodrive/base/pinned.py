"""Many arrays as one argument of compiled code.

Numba takes apart each array of an argument at each call from Python: 33 ns for each, 6 us for the 180 arrays of a
World. A `Pinned` is taken apart once. Compiled code gets the address of its words, and `held` reads them there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Generic, TypeVar

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.pythonapi import NativeValue
from numba.extending import (
    lower_builtin,
    models,
    register_model,
    type_callable,
    typeof_impl,
    unbox,
)

Tables = TypeVar("Tables", bound=tuple[Any, ...])


class Pinned(Generic[Tables]):
    """A NamedTuple of arrays, whole numbers, floats and such tuples; see `held`.

    The arrays stay the same objects with the same memory; what is written into them is seen by compiled code. The
    numbers are those of the time when this object was made.
    """

    def __init__(self, tables: Tables) -> None:
        self.tables = tables
        self.type = PinnedType(numba.typeof(tables))
        self._words = np.array([*_words(tables)], np.int64)
        self.address = self._words.ctypes.data
        """Address of the words of all values, in the order in which Numba lays them out."""


def held(pinned: Pinned[Tables]) -> Tables:
    """The tables of a `Pinned`, also in compiled code."""
    return pinned.tables


def _words(value: Any) -> Iterator[int]:
    """The words of a value as `numba.core.datamodel` lays it out."""
    if isinstance(value, tuple):
        for part in value:
            yield from _words(part)
    elif isinstance(value, np.ndarray):
        # without an owner, which only code that counts references needs
        yield from (0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides)
    elif isinstance(value, float):
        yield int(np.float64(value).view(np.int64))
    elif isinstance(value, int) and not isinstance(value, bool):  # a bool has one byte
        yield value
    else:
        raise TypeError(f"a Pinned holds arrays, whole numbers, floats and tuples, not {type(value).__name__}")


class PinnedType(types.Type):
    """Type of a `Pinned` with tables of that type."""

    def __init__(self, tables: types.Type) -> None:
        self.tables = tables
        super().__init__(f"Pinned({tables})")


@register_model(PinnedType)
class _PinnedModel(models.PrimitiveModel):
    """An address."""

    def __init__(self, dmm: Any, fe_type: PinnedType) -> None:
        super().__init__(dmm, fe_type, cgutils.intp_t)


@typeof_impl.register(Pinned)
def _type_of(value: Pinned[Any], _: object) -> PinnedType:
    return value.type


@unbox(PinnedType)
def _unbox(_: PinnedType, value: Any, c: Any) -> NativeValue:
    attribute = c.pyapi.object_getattr_string(value, "address")
    address = c.pyapi.number_as_ssize_t(attribute)
    c.pyapi.decref(attribute)
    return NativeValue(address, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@type_callable(held)
def _type_held(_: object) -> Any:
    def typed(pinned: types.Type) -> types.Type | None:
        return pinned.tables if isinstance(pinned, PinnedType) else None

    return typed


@lower_builtin(held, PinnedType)
def _lower_held(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    words = context.get_value_type(signature.return_type).as_pointer()
    return builder.load(builder.inttoptr(arguments[0], words))
