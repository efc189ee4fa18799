"""Types of the numpy arrays in this package, and read-only copies."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class ArrayShape(NamedTuple):
    """The number of values of a one-dimensional array, in its `Annotated` type; a quaternion is wxyz."""

    size: int
    is_quaternion: bool = False


AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


def read_only(array: AnyArray) -> AnyArray:
    """Let nobody write to an array any more; returns the array."""
    array.setflags(write=False)
    return array


def read_only_copy(array: AnyArray) -> AnyArray:
    """A copy of the array that cannot be written to."""
    return read_only(array.copy())


def element_type(hint: Any) -> type[np.generic] | None:
    """The element type in a type hint like `NDArray[np.float64]`; None if it is not an array."""
    if get_origin(hint) is np.ndarray:
        return get_args(get_args(hint)[1])[0]
    if get_origin(hint) is NDArray:  # numpy 2.5 and newer: NDArray is an alias that keeps its name
        return get_args(hint)[0]
    return None
