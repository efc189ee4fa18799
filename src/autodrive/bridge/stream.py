"""What is sent to viewers, as bytes: each Frame, scan and picture encoded once for all who want the same."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from autodrive.protocol.codec import encode, streamed
from autodrive.protocol.messages import CameraImage, Event, Frame, LidarScan
from autodrive.protocol.native import Picture, Scan, Scene, Subscribe

if TYPE_CHECKING:
    from autodrive.jpeg import JpegEncoder

NARROWEST = 16
"""Pictures are not made smaller than that [pixels]."""

NO_EVENTS: tuple[Event, ...] = ()


class Stream:
    """The Scene and the latest Frame, encoded when the first viewer wants them. Lives in the server's loop."""

    def __init__(self, pictures: JpegEncoder | None) -> None:
        self.scene: Scene | None = None
        self.latest: Frame | None = None
        self.scene_bytes = b""
        self.has_pictures = pictures is not None
        self._pictures = pictures
        self._plain: tuple[Frame | None, Frame | None] = None, None
        self._frame: Frame | None = None
        self._frames: dict[tuple[int, ...], tuple[tuple[Event, ...], bytes]] = {}
        self._scans: dict[str, tuple[LidarScan, bytes]] = {}
        self._images: dict[tuple[str, str], tuple[CameraImage, dict[tuple[int, int], bytes]]] = {}

    def set_scene(self, scene: Scene) -> None:
        """Another scene; what was of the one before is forgotten."""
        self.scene = scene
        self.scene_bytes = encode(scene)
        self._scans.clear()
        self._images.clear()

    def plain(self, frame: Frame, events: tuple[Event, ...]) -> Frame:
        """The Frame as it is streamed."""
        if not events and not frame.events:
            if self._plain[0] is not frame:
                self._plain = frame, streamed(frame, NO_EVENTS)
            assert self._plain[1] is not None
            return self._plain[1]
        return streamed(frame, events)

    def frame_bytes(self, frame: Frame, events: tuple[Event, ...]) -> bytes:
        """The Frame with those events."""
        if self._frame is not frame:
            self._frame, self._frames = frame, {}
        key = tuple(map(id, events))
        if key not in self._frames:
            self._frames[key] = events, encode(self.plain(frame, events))
        return self._frames[key][1]

    def scan_bytes(self, scan: Scan) -> bytes:
        """That scan."""
        known = self._scans.get(scan.vehicle)
        if known is None or known[0] is not scan.scan:
            known = self._scans[scan.vehicle] = scan.scan, encode(scan)
        return known[1]

    async def picture_bytes(self, vehicle: str, camera: str, image: CameraImage, wants: Subscribe) -> bytes:
        """That picture as wide and as good as is wanted; the JPEG is made in another thread."""
        full = image.intrinsics.width
        width = min(max(wants.picture_width or full, NARROWEST), full)
        key = width, min(max(wants.picture_quality, 1), 100)
        known, texts = self._images.get((vehicle, camera), (None, {}))
        if known is not image:
            texts = {}
            self._images[vehicle, camera] = image, texts
        if key not in texts:
            texts[key] = await asyncio.to_thread(self._picture, vehicle, camera, image, *key)
        return texts[key]

    def _picture(self, vehicle: str, camera: str, image: CameraImage, width: int, quality: int) -> bytes:
        assert self._pictures is not None
        own = image.intrinsics
        size = width, max(round(width * own.height / own.width), 1)
        jpeg = self._pictures.encode(vehicle, camera, image, size=size, quality=quality)
        return encode(Picture(vehicle, camera, image.time, image.pose, own, jpeg))
