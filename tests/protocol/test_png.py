"""PNG files, read chunk by chunk as the standard defines, and files of another writer."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
import resvg_py

from autodrive.base.png import decode_png, encode_png


def chunks(data: bytes) -> dict[bytes, bytes]:
    """Kind -> body; checks every checksum."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found: dict[bytes, bytes] = {}
    at = 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(kind + body)
        found[kind] = body
        at += 12 + length
    return found


def random_pixels(*shape: int) -> np.ndarray:
    return np.random.default_rng(3).integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize(("shape", "colour_type"), [((5, 7), 0), ((5, 7, 3), 2), ((5, 7, 4), 6)])
def test_the_file_contains_the_pixels_row_by_row(shape: tuple[int, ...], colour_type: int) -> None:
    pixels = random_pixels(*shape)
    found = chunks(encode_png(pixels))
    assert list(found) == [b"IHDR", b"IDAT", b"IEND"]
    assert struct.unpack(">IIBBBBB", found[b"IHDR"]) == (7, 5, 8, colour_type, 0, 0, 0)
    rows = zlib.decompress(found[b"IDAT"])
    assert rows == b"".join(b"\0" + row.tobytes() for row in pixels)
    assert np.array_equal(decode_png(encode_png(pixels)).reshape(shape), pixels)


def test_the_palette_precedes_the_indices() -> None:
    indices, palette = random_pixels(4, 6) % 3, random_pixels(3, 3)
    found = chunks(encode_png(indices, palette))
    assert list(found) == [b"IHDR", b"PLTE", b"IDAT", b"IEND"]
    assert found[b"IHDR"][9] == 3
    assert found[b"PLTE"] == palette.tobytes()
    assert np.array_equal(decode_png(encode_png(indices, palette))[..., 0], indices)


def test_files_of_another_writer_can_be_read() -> None:
    """resvg uses row filters; the SVG defines the colours."""
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20"><defs><linearGradient id="g">'
        '<stop stop-color="#000"/><stop offset="1" stop-color="#fff"/></linearGradient></defs>'
        '<rect width="40" height="10" fill="url(#g)"/><rect y="10" width="40" height="10" fill="#1e90ff"/></svg>'
    )
    pixels = decode_png(resvg_py.svg_to_bytes(svg_string=svg)).astype(int)
    assert (pixels[10:] == (0x1E, 0x90, 0xFF, 255)).all()
    ramp = (np.arange(40) + 0.5) / 40 * 255
    assert np.abs(pixels[:10, :, 0] - ramp).max() <= 2  # rounding, and steps of the gradient
