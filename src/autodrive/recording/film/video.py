"""Writes images into a video file with a codec that needs no licence: AV1 or VP9."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import AutodriveError
from autodrive.base.installation import missing
from autodrive.base.suggest import suggest
from autodrive.recording.film.encoder import BT_709, LIMITED, open_stream


@dataclass(frozen=True)
class Codec:
    """An encoder and its options, for a speed near real time on a laptop."""

    encoder: str
    options: dict[str, str]


CODECS = {
    "av1": Codec("libsvtav1", {"preset": "10", "crf": "32"}),
    "vp9": Codec("libvpx-vp9", {"deadline": "realtime", "cpu-used": "7", "crf": "32", "b": "0", "row-mt": "1"}),
}
FORMATS = {".mp4": "av1", ".webm": "vp9", ".mkv": "av1"}
"""Ends of file names, and the codec of each unless another is chosen."""

INDEX_FIRST = {"movflags": "faststart", "cues_to_front": "1"}
"""Options of MP4, and of Matroska and WebM: the index is before the images."""
LEAST, MOST = 4, 8192
"""Least and greatest width and height that all encoders accept [pixels]."""

PART = ".part"
"""End of the name of a file that is being written; it is renamed when it is complete."""


class Video:
    """A video file that appears when it is complete; `write` adds images, shape (height, width, 3), uint8, sRGB.

    Colours are BT.709 in the limited range, and tagged so. A keyframe each second, and the index before the images, let
    a player begin at any time.
    """

    def __init__(self, path: Path, size: tuple[int, int], rate: float, codec: str | None = None) -> None:
        """`size`: width and height of the images [pixels]. `rate`: images per second. Raises `AutodriveError`."""
        if path.suffix.lower() not in FORMATS:
            known = ", ".join(FORMATS)
            raise AutodriveError(f"the name of a film must end with one of {known}, not '{path.suffix}'  ({path})")
        chosen = codec or FORMATS[path.suffix.lower()]
        if chosen not in CODECS:
            raise AutodriveError(f"codec '{chosen}' is not known. {suggest(chosen, [*CODECS])}")
        if not all(LEAST <= length <= MOST for length in size):
            raise AutodriveError(f"width and height of a video must be from {LEAST} to {MOST} pixels, not {size}")
        av = _av()
        self._av: Any = av
        self.codec = chosen
        """A key of `CODECS`."""
        self.size = size[0] + size[0] % 2, size[1] + size[1] % 2
        """Width and height of the video [pixels]: even, as the colours of two by two pixels are stored once."""
        self._path = path
        self._part = path.with_name(f".{path.stem}{PART}{path.suffix}")
        with self._writing():
            self._container = av.open(str(self._part), "w", container_options=INDEX_FIRST)
            encoder = CODECS[chosen]
            rounded = Fraction(rate).limit_denominator(1001)
            self._stream = open_stream(self._container, encoder.encoder, self.size, rounded, dict(encoder.options))
        self.images = 0
        """Number of images written."""

    def write(self, image: NDArray[np.uint8]) -> None:
        """Add an image; one of another size is scaled."""
        rgb = self._av.VideoFrame.from_ndarray(padded(image), format="rgb24")
        frame = rgb.reformat(*self.size, "yuv420p", dst_colorspace=BT_709, dst_color_range=LIMITED)
        with self._writing():
            self._container.mux(self._stream.encode(frame))
        self.images += 1

    def __enter__(self) -> Video:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the file; after an error it is removed."""
        try:
            with self._writing():
                if kind is None:
                    self._container.mux(self._stream.encode(None))
                self._container.close()
                if kind is None:
                    self._part.replace(self._path)
        finally:
            with contextlib.suppress(OSError):  # the file system may be read-only
                self._part.unlink(missing_ok=True)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            reason = error.strerror or error
            raise AutodriveError(f"the video cannot be written: {reason}  ({self._path})") from None


def padded(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The image with its last row and its last column twice where the height or the width is odd."""
    height, width = image.shape[:2]
    return np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), "edge")


def _av() -> Any:
    try:
        import av  # noqa: PLC0415  an extra
    except ImportError:
        raise AutodriveError(f"a film cannot be made: {missing('av', 'film')}") from None
    return av
