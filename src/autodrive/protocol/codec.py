"""Encodes and decodes the messages of the native protocol as MessagePack.

A struct is a map with the names of its fields; a message also has its name as `type`. A one-dimensional array is an
extension: its code is the type of the values (`CODES`), its data are the values in little-endian order.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
from msgspec.structs import replace

from autodrive.base.texts import total
from autodrive.protocol.messages import Event, Frame
from autodrive.protocol.native import ClientMessage, ServerMessage

CODES = {"<f8": 1, "<i8": 2, "<f4": 3, "|u1": 4, "<u2": 5}
"""Type of the values of an array -> code of the MessagePack extension."""

_TYPES = {code: np.dtype(name) for name, code in CODES.items()}
_CODES = {dtype: code for code, dtype in _TYPES.items()}
_DOUBLE = np.dtype("<f8")


def _extension(value: Any) -> msgspec.msgpack.Ext:
    """The extension of an array. Nearly all arrays of a Frame are float64, which is checked first."""
    if isinstance(value, np.ndarray):
        code = 1 if value.dtype is _DOUBLE else _CODES.get(value.dtype)
        if code is not None:
            return msgspec.msgpack.Ext(code, value.tobytes())
    raise NotImplementedError(f"{type(value).__name__} cannot be part of a message")


def _array(code: int, data: memoryview) -> Any:
    if code not in _TYPES:
        raise ValueError(f"extension {code} is not known; known: {sorted(_TYPES)}")
    return np.frombuffer(bytes(data), _TYPES[code])


encode = total(msgspec.msgpack.Encoder(enc_hook=_extension).encode)
"""Encode a message."""

decode_client = msgspec.msgpack.Decoder(ClientMessage, ext_hook=_array).decode
"""Decode a message of a client. Raises `msgspec.DecodeError`, of which `msgspec.ValidationError` is a subclass."""

decode_server = msgspec.msgpack.Decoder(ServerMessage, ext_hook=_array).decode
"""Decode a message of the server; its arrays are read-only. Raises as `decode_client`."""


def streamed(frame: Frame, events: tuple[Event, ...]) -> Frame:
    """The Frame as it is streamed: without scans and images, and with `events` since the last one."""
    vehicles = {name: replace(vehicle, lidar=None, cameras={}) for name, vehicle in frame.vehicles.items()}
    return replace(frame, vehicles=vehicles, events=events)
