"""Unpacks LZ4 frames of bags, which need a package that is an extra."""

from __future__ import annotations

from autodrive.base.installation import missing
from autodrive.recording.errors import RecordingError


def unpacked_lz4(data: bytes, most: int) -> bytes:
    """The content of an LZ4 frame, at most `most` bytes. Raises `RecordingError`."""
    try:
        from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415
    except ModuleNotFoundError:
        raise RecordingError(missing("lz4", "export")) from None
    try:
        return LZ4FrameDecompressor().decompress(data, most)
    except RuntimeError as error:
        raise RecordingError(f"an LZ4 frame is damaged: {error}") from None
