"""PNG files, read chunk by chunk as the standard says, and files of another writer."""

import struct
import zlib

import numpy as np
import pytest
import resvg_py

from autodrive.render.png import decode_png, encode_png


def chunks(data):
    """Kind -> body; every checksum is right."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    found, at = {}, 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(kind + body)
        found[kind] = body
        at += 12 + length
    return found


def picture(*shape):
    return np.random.default_rng(3).integers(0, 256, shape, np.uint8)


@pytest.mark.parametrize(("shape", "colour_type"), [((5, 7), 0), ((5, 7, 3), 2), ((5, 7, 4), 6)])
def test_file_holds_the_pixels_row_by_row(shape, colour_type):
    pixels = picture(*shape)
    found = chunks(encode_png(pixels))
    assert list(found) == [b"IHDR", b"IDAT", b"IEND"]
    assert struct.unpack(">IIBBBBB", found[b"IHDR"]) == (7, 5, 8, colour_type, 0, 0, 0)
    rows = zlib.decompress(found[b"IDAT"])
    assert rows == b"".join(b"\0" + row.tobytes() for row in pixels)
    assert np.array_equal(decode_png(encode_png(pixels)).reshape(shape), pixels)


def test_palette_stands_before_the_indices():
    indices, palette = picture(4, 6) % 3, picture(3, 3)
    found = chunks(encode_png(indices, palette))
    assert list(found) == [b"IHDR", b"PLTE", b"IDAT", b"IEND"]
    assert found[b"IHDR"][9] == 3
    assert found[b"PLTE"] == palette.tobytes()
    assert np.array_equal(decode_png(encode_png(indices, palette))[..., 0], indices)


def test_files_of_another_writer_are_read():
    """resvg filters its rows; the drawing says which colour is where."""
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="40" height="20"><defs><linearGradient id="g">'
        '<stop stop-color="#000"/><stop offset="1" stop-color="#fff"/></linearGradient></defs>'
        '<rect width="40" height="10" fill="url(#g)"/><rect y="10" width="40" height="10" fill="#1e90ff"/></svg>'
    )
    pixels = decode_png(resvg_py.svg_to_bytes(svg_string=svg)).astype(int)
    assert (pixels[10:] == (0x1E, 0x90, 0xFF, 255)).all()
    ramp = (np.arange(40) + 0.5) / 40 * 255
    assert np.abs(pixels[:10, :, 0] - ramp).max() <= 2  # rounding, and the gradient's own steps
