"""Whole Frames as bytes, so that two runs can be compared to the last bit."""

import hashlib
import struct
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.protocol.messages import Command, Frame
from autodrive.world import World

Driver = Callable[[Frame], dict[str, Command]]


def bytes_of(value: Any) -> Iterator[bytes]:
    """All that a message holds, every float to its last bit."""
    if isinstance(value, msgspec.Struct):
        yield type(value).__name__.encode()
        for field in value.__struct_fields__:
            yield field.encode()
            yield from bytes_of(getattr(value, field))
    elif isinstance(value, dict):
        for key, item in value.items():
            yield str(key).encode()
            yield from bytes_of(item)
    elif isinstance(value, tuple):
        yield b"(%d" % len(value)
        for item in value:
            yield from bytes_of(item)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield value.tobytes()
    elif type(value) is float:
        yield struct.pack("<d", value)
    else:
        yield repr(value).encode()


def arrays(value: Any) -> list[NDArray[Any]]:
    """All arrays in a message."""
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, msgspec.Struct):
        value = [getattr(value, field) for field in value.__struct_fields__]
    if isinstance(value, dict):
        value = list(value.values())
    return [array for item in value for array in arrays(item)] if isinstance(value, list | tuple) else []


def digest(message: Any) -> str:
    """One text for all of a message's bits."""
    return hashlib.sha256(b"|".join(bytes_of(message))).hexdigest()


def digests(world: World, ticks: int, driver: Driver) -> list[str]:
    """Digests of the Frame at hand and of those of the next ticks."""
    frames = [digest(world.frame)]
    for _ in range(ticks):
        frames.append(digest(world.step(driver(world.frame))))
    return frames
