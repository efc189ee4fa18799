"""Reads grey images of map files: PNG of every depth and colour type, and PGM."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit
from autodrive.base.readable import readable

MAX_PIXELS = 2**24
MAX_EDGE = 2**16
"""Longest edge of an image [pixel]."""
MAX_BYTES = 100 * 2**20
"""Most bytes of a file, and of its pixels without compression."""
ROWS = 64
"""Rows that are converted to numbers at a time."""
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Colour type of a PNG -> channels."""


def read_grey(path: Path) -> Floats:
    """The mean of the colour channels of each pixel, from 0 to 255, shape (rows, columns). Raises `SpecError`.

    Pixels that are more than half transparent are white.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SpecError([f"an image must have at most {MAX_BYTES // 2**20} MiB"], str(path))
        data = readable(path).read_bytes()
    except OSError as error:
        raise SpecError([f"the image cannot be read: {error.strerror or error}"], str(path)) from None
    return grey_of(data, str(path))


def grey_of(data: bytes, path: str = "") -> Floats:
    """The grey values of a picture in the bytes of a file; see `read_grey`. They may be compressed with zlib.

    `path` is for errors.
    """
    try:
        if data[:1] == b"x":
            data = zlib.decompressobj().decompress(data, MAX_BYTES)
        if data.startswith(b"\x89PNG\r\n\x1a\n"):
            return _png(data)
        if data[:2] in (b"P2", b"P5"):
            return _pgm(data)
    except (ValueError, struct.error, zlib.error, IndexError, DeprecationWarning) as error:
        raise SpecError([f"the image cannot be read: {error}"], path) from None
    raise SpecError(["the image is neither PNG nor PGM; save it as PNG"], path)


def _png(data: bytes) -> Floats:
    at, parts, header, palette, transparent = 8, [], b"", b"", b""
    while at + 8 <= len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        at += 12 + length
        if kind == b"IHDR":
            header = body
        elif kind == b"PLTE":
            palette = body
        elif kind == b"tRNS":
            transparent = body
        elif kind == b"IDAT":
            parts.append(body)
    width, height, depth, colour_type, _, _, interlace = struct.unpack(">IIBBBBB", header)
    if interlace:
        raise ValueError("a PNG with interlacing is not supported; save the image without interlacing")
    if colour_type not in _CHANNELS or depth not in (1, 2, 4, 8, 16) or (depth < 8 and _CHANNELS[colour_type] > 1):
        raise ValueError(f"colour type {colour_type} with {depth} bits is not in the PNG standard")
    _check_size(width, height)
    channels = _CHANNELS[colour_type]
    row_bytes = (width * channels * depth + 7) // 8
    size = height * (1 + row_bytes)
    if size > MAX_BYTES:
        mib = MAX_BYTES // 2**20
        raise ValueError(f"its pixels have {size >> 20} MiB; at most {mib} are possible: save it as 8-bit grey")
    raw = zlib.decompressobj().decompress(b"".join(parts), size)
    if len(raw) != size:
        raise ValueError("it ends too early")
    lines = np.frombuffer(bytearray(raw), np.uint8).reshape(height, 1 + row_bytes)
    del raw
    if lines[:, 0].max() > 4:
        raise ValueError("unknown filter")
    unfilter(lines, max(1, channels * depth // 8))
    table = np.frombuffer(palette, np.uint8).reshape(-1, 3).astype(np.float64).mean(axis=1)
    alpha = np.full(len(table), 255)
    alpha[: len(transparent)] = np.frombuffer(transparent, np.uint8)[: len(table)]
    table = np.where(alpha < 128, 255.0, table)
    grey = np.empty((height, width))
    for first in range(0, height, ROWS):  # the numbers of a whole image would take 64 bytes a pixel
        block = lines[first : first + ROWS, 1:]
        values = _samples(block, depth, width * channels).reshape(len(block), width, channels)
        grey[first : first + ROWS] = table[values[..., 0]] if colour_type == 3 else _mean(values, depth)
    return grey


def _mean(values: NDArray[np.int64], depth: int) -> Floats:
    """Mean of the colour channels; white where an alpha channel, the second or fourth one, is transparent."""
    channels = values.shape[-1]
    scaled = values * (255.0 / (2**depth - 1))
    grey = scaled[..., : min(channels, 3) if channels > 2 else 1].mean(axis=2, dtype=np.float64)
    return np.where(scaled[..., -1] < 127.5, 255.0, grey) if channels in (2, 4) else grey


def _samples(rows: NDArray[np.uint8], depth: int, count: int) -> NDArray[np.int64]:
    """The numbers of `depth` bits in each row of bytes."""
    if depth == 16:
        return (rows[:, ::2].astype(np.int64) << 8) + rows[:, 1::2]
    if depth == 8:
        return rows.astype(np.int64)
    bits = np.unpackbits(rows, axis=1).reshape(len(rows), -1, depth).astype(np.int64)
    return (bits @ (1 << np.arange(depth)[::-1]))[:, :count]


@jit
def unfilter(lines: NDArray[np.uint8], step: int) -> None:
    """Undoes the filters of a PNG in place (its specification, section 9.2). Each line begins with its filter."""
    for y in range(lines.shape[0]):
        kind = lines[y, 0]
        for x in range(1, lines.shape[1]):
            left = int(lines[y, x - step]) if x > step else 0
            up = int(lines[y - 1, x]) if y > 0 else 0
            corner = int(lines[y - 1, x - step]) if y > 0 and x > step else 0
            added = 0
            if kind == 1:
                added = left
            elif kind == 2:
                added = up
            elif kind == 3:
                added = (left + up) // 2
            elif kind == 4:
                p = left + up - corner
                da, db, dc = abs(p - left), abs(p - up), abs(p - corner)
                added = left if da <= db and da <= dc else (up if db <= dc else corner)
            lines[y, x] = (int(lines[y, x]) + added) & 255


def _pgm(data: bytes) -> Floats:
    fields: list[int] = []
    at = 2
    while len(fields) < 3:
        while data[at : at + 1].isspace():
            at += 1
        end = at
        if data[at : at + 1] == b"#":
            at = data.index(b"\n", at)
            continue
        while data[end : end + 1].isdigit():
            end += 1
        fields.append(int(data[at:end]))
        at = end
    width, height, greatest = fields
    _check_size(width, height)
    if not 0 < greatest < 65536:
        raise ValueError(f"its greatest value is {greatest}, but must be from 1 to 65535")
    if data[:2] == b"P2":
        with warnings.catch_warnings(action="error", category=DeprecationWarning):  # what is no number
            values = np.fromstring(data[at:].decode("ascii"), np.float64, width * height, sep=" ")
    else:
        kind = np.dtype(np.uint8) if greatest < 256 else np.dtype(">u2")
        values = np.frombuffer(data, kind, min(width * height, (len(data) - at - 1) // kind.itemsize), at + 1)
    if len(values) != width * height:
        raise ValueError("it ends too early")
    return np.multiply(values.reshape(height, width), 255.0 / greatest, dtype=np.float64)


def _check_size(width: int, height: int) -> None:
    if not 0 < width * height <= MAX_PIXELS or max(width, height) > MAX_EDGE:
        text = f"{width} x {height} pixels; at most {MAX_PIXELS} are possible, and {MAX_EDGE} along an edge"
        raise ValueError(f"{text}: save a smaller image")
