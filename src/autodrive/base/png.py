"""Writes and reads PNG images (W3C, third edition): 8 bits per channel or palette index, not interlaced."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_COLOUR_TYPES = {1: 0, 3: 2, 4: 6}
"""Channels -> colour type: grey, RGB, RGBA."""
INDEXED = 3
"""Colour type of images with a palette."""


def encode_png(pixels: NDArray[np.uint8], palette: NDArray[np.uint8] | None = None) -> bytes:
    """Content of the file; `pixels` uint8 of shape (height, width), (height, width, 3) or (height, width, 4).

    With a palette (sRGB, shape (n, 3)), pixels of shape (height, width) are indices into it.
    """
    rows = np.atleast_3d(pixels)
    height, width, channels = rows.shape
    filtered = np.zeros((height, 1 + width * channels), np.uint8)  # each row starts with its filter type, 0: none
    filtered[:, 1:] = rows.reshape(height, -1)
    colour_type = _COLOUR_TYPES[channels] if palette is None else INDEXED
    header = struct.pack(">IIBBBBB", width, height, 8, colour_type, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(filtered.tobytes(), 6)), (b"IEND", b"")]
    if palette is not None:
        chunks.insert(1, (b"PLTE", palette.astype(np.uint8).tobytes()))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def decode_png(data: bytes) -> NDArray[np.uint8]:
    """Pixels of a PNG image, shape (height, width, channels); indices if it has a palette.

    Raises `ValueError` unless it has 8 bits per channel and is not interlaced.
    """
    at, parts, header = 8, [], b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        header, at = body if kind == b"IHDR" else header, at + 12 + length
        if kind == b"IDAT":
            parts.append(body)
    width, height, depth, colour_type, _, _, interlace = struct.unpack(">IIBBBBB", header)
    channels = {INDEXED: 1, **{kind: n for n, kind in _COLOUR_TYPES.items()}}.get(colour_type)
    if channels is None or depth != 8 or interlace:
        raise ValueError(f"a PNG of colour type {colour_type}, {depth} bits, interlace {interlace} is not supported")
    raw = np.frombuffer(zlib.decompress(b"".join(parts)), np.uint8).reshape(height, 1 + width * channels)
    rows = np.zeros((height + 1, width + 1, channels), np.int32)  # with zeros above and to the left
    for y, line in enumerate(raw, 1):
        _unfilter(int(line[0]), line[1:].reshape(width, channels).astype(np.int32), rows[y - 1], rows[y])
    return rows[1:, 1:].astype(np.uint8)


def _unfilter(kind: int, line: NDArray[np.int32], above: NDArray[np.int32], row: NDArray[np.int32]) -> None:
    """Fill `row` from its filtered bytes (PNG specification, section 9.2)."""
    if kind == 0:
        row[1:] = line
    elif kind == 1:
        row[1:] = np.cumsum(line, axis=0) & 255
    elif kind == 2:
        row[1:] = (line + above[1:]) & 255
    else:
        step, up = row.shape[1], above.ravel().tolist()  # Python numbers: seven times as fast as arrays of one pixel
        pixels = [0] * step
        for i, value in enumerate(line.ravel().tolist()):
            a, b, c = pixels[i], up[i + step], up[i]
            pixels.append((value + ((a + b) // 2 if kind == 3 else _paeth(a, b, c))) & 255)
        row[:] = np.reshape(pixels, row.shape)


def _paeth(a: int, b: int, c: int) -> int:
    """The Paeth predictor: left, above or upper left, the nearest to left + above - upper left."""
    p = a + b - c
    da, db, dc = abs(p - a), abs(p - b), abs(p - c)
    if da <= db and da <= dc:
        return a
    return b if db <= dc else c
