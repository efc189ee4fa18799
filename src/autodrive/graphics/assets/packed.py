"""An Asset and its .glb file as bytes, for the cache: the Asset can be read again, which needs no reader of glTF."""

from __future__ import annotations

from typing import Any, TypeAlias

import msgspec
import numpy as np
import simplejpeg

from autodrive.graphics.assets.asset import STRIP, Asset

JPEG_QUALITY = 92
"""JPEG quality of textures, without colour subsampling; the loss is invisible."""

_Array: TypeAlias = tuple[str, tuple[int, ...], bytes]
"""Type of the elements ('jpeg' for an image, 'strip' for `STRIP`), shape, content."""


def pack(asset: Asset, glb: bytes) -> bytes:
    """The asset and its .glb file as bytes. Only textures lose a little."""
    return _ENCODER.encode((asset, glb))


def unpack(data: bytes) -> tuple[Asset, bytes]:
    """What was packed. Raises `ValueError` for other bytes."""
    return _DECODER.decode(data)


def jpeg(image: np.ndarray) -> bytes:
    """A texture as JPEG."""
    pixels = np.ascontiguousarray(image)
    return simplejpeg.encode_jpeg(pixels, quality=JPEG_QUALITY, colorspace="RGB", colorsubsampling="444")


def _encoded(array: Any) -> _Array:
    if array.dtype == np.uint8:
        return "jpeg", array.shape, jpeg(array)
    return "strip" if array.dtype == STRIP else array.dtype.str, array.shape, array.tobytes()


def _decoded(_type: type, value: _Array) -> np.ndarray:
    dtype, shape, content = value
    if dtype == "jpeg":
        return simplejpeg.decode_jpeg(content, colorspace="RGB")
    return np.frombuffer(content, STRIP if dtype == "strip" else dtype).reshape(shape)


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encoded)
_DECODER = msgspec.msgpack.Decoder(tuple[Asset, bytes], dec_hook=_decoded)
