"""Writes pictures as PNG (W3C Portable Network Graphics, third edition): 8 bits a channel, no interlace."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_COLOUR_TYPES = {1: 0, 3: 2, 4: 6}
"""Channels -> colour type: grey, RGB, RGBA."""


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """The file's content; `pixels` uint8 of shape (height, width), (height, width, 3) or (height, width, 4)."""
    rows = np.atleast_3d(pixels)
    height, width, channels = rows.shape
    filtered = np.zeros((height, 1 + width * channels), np.uint8)  # each row begins with its filter, 0: none
    filtered[:, 1:] = rows.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, _COLOUR_TYPES[channels], 0, 0, 0)
    chunks = (b"IHDR", header), (b"IDAT", zlib.compress(filtered.tobytes(), 6)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write that file."""
    path.write_bytes(encode_png(pixels))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
