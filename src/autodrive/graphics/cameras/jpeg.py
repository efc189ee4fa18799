"""Encodes camera images as JPEG, each once for all receivers."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import simplejpeg

from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.resize import resized

if TYPE_CHECKING:
    from autodrive.protocol.messages import CameraImage, Frame


class JpegEncoder:
    """Baseline JPEG, YCbCr 4:2:0, of `size` (width, height) [pixels] (None: that of the image), `quality` 1 to 100.

    Keeps the JPEG of the latest image of each camera, for each requested size and quality. Thread-safe.
    """

    def __init__(self, size: tuple[int, int] | None = None, quality: int = 75) -> None:
        if not 1 <= quality <= 100:
            raise AutodriveError(f"JPEG quality {quality} must be from 1 to 100; 75 is usual")
        if size is not None and min(size) < 1:
            raise AutodriveError(f"an image of {size[0]} x {size[1]} pixels is not possible; 640 x 480 is usual")
        self.size = size
        self.quality = quality
        self.encoded = 0
        """Number of images encoded so far."""
        self._lock = threading.Lock()
        self._latest: dict[tuple[str, str], _Latest] = {}

    def encode(
        self,
        vehicle: str,
        camera: str,
        image: CameraImage,
        *,
        size: tuple[int, int] | None = None,
        quality: int | None = None,
    ) -> bytes:
        """The image of that camera as JPEG; `size` and `quality` replace the defaults."""
        width, height = size or self.size or (image.rgba.shape[1], image.rgba.shape[0])
        wanted = width, height, quality or self.quality
        with self._lock:
            latest = self._latest.get((vehicle, camera))
            if latest is None or latest.image is not image:
                latest = self._latest[vehicle, camera] = _Latest(image)
        with latest.lock:  # images of two cameras can be encoded in parallel
            if wanted not in latest.jpegs:
                latest.jpegs[wanted] = _jpeg(image, *wanted)
                with self._lock:
                    self.encoded += 1
            return latest.jpegs[wanted]


@dataclass
class _Latest:
    image: CameraImage
    lock: threading.Lock = field(default_factory=threading.Lock)
    jpegs: dict[tuple[int, int, int], bytes] = field(default_factory=dict)
    """Encoded images by width, height and quality."""


def images_of(frame: Frame, share: float = 1.0, *, encoder: JpegEncoder) -> Mapping[tuple[str, str], bytes]:
    """JPEG images of a Frame by (name of the vehicle, name of the camera); `share` scales the encoder's quality."""
    quality = max(round(share * encoder.quality), 1)
    return {
        (vehicle, camera): encoder.encode(vehicle, camera, image, quality=quality)
        for vehicle, reading in frame.vehicles.items()
        for camera, image in reading.cameras.items()
    }


def _jpeg(image: CameraImage, width: int, height: int, quality: int) -> bytes:
    pixels = resized(image.rgba, width, height)
    return simplejpeg.encode_jpeg(pixels, quality=quality, colorspace="RGBX", colorsubsampling="420")
