"""Messages of the native protocol as MessagePack, and back.

Structs are maps with their fields' names; those of a union carry their name as `type`. An array is an extension: its
values in little-endian order, with the code that `CODES` gives to their type; arrays here have one dimension.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from autodrive.protocol.messages import Event, Frame
from autodrive.protocol.native import ClientMessage, ServerMessage

CODES = {"<f8": 1, "<i8": 2, "<f4": 3, "|u1": 4}
"""Type of an array's values -> code of the MessagePack extension."""

_TYPES = {code: np.dtype(name) for name, code in CODES.items()}
_CODES = {dtype: code for code, dtype in _TYPES.items()}
_DOUBLE = np.dtype("<f8")


def _extension(value: Any) -> msgspec.msgpack.Ext:
    """Of an array; a Frame has some dozens, nearly all of doubles."""
    if isinstance(value, np.ndarray):
        code = 1 if value.dtype is _DOUBLE else _CODES.get(value.dtype)
        if code is not None:
            return msgspec.msgpack.Ext(code, value.tobytes())
    raise NotImplementedError(f"{type(value).__name__} has no place in a message")


def _array(code: int, data: memoryview) -> Any:
    if code not in _TYPES:
        raise ValueError(f"extension {code} is not known; known: {sorted(_TYPES)}")
    return np.frombuffer(bytes(data), _TYPES[code])


encode = msgspec.msgpack.Encoder(enc_hook=_extension).encode
"""Any message as bytes."""

decode_client = msgspec.msgpack.Decoder(ClientMessage, ext_hook=_array).decode
"""A client's message of its bytes. Raises `msgspec.DecodeError` (and `msgspec.ValidationError`, which is one)."""

decode_server = msgspec.msgpack.Decoder(ServerMessage, ext_hook=_array).decode
"""A server's message of its bytes; its arrays are read-only. Raises as `decode_client`."""


def streamed(frame: Frame, events: tuple[Event, ...]) -> Frame:
    """The Frame as it is streamed: scans and pictures come by themselves, and `events` are all since the last one."""
    vehicles = {name: replace(vehicle, lidar=None, cameras={}) for name, vehicle in frame.vehicles.items()}
    return replace(frame, vehicles=vehicles, events=events)
