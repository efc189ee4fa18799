"""Encodes each Frame, scan and picture once for all clients that want the same bytes."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from autodrive.protocol.codec import encode, streamed
from autodrive.protocol.messages import CameraImage, Event, Frame, LidarScan
from autodrive.protocol.native import ContactForces, Contacts, Drawn, Picture, Scan, Scene, Subscribe
from autodrive.world.contacts import shapes_of

if TYPE_CHECKING:
    from autodrive.graphics.cameras.jpeg import JpegEncoder
    from autodrive.world import World

MIN_WIDTH = 16
"""Smallest width of a picture [pixels]."""

NO_EVENTS: tuple[Event, ...] = ()


class EncodedFrames:
    """The Scene and the latest Frame, encoded when the first client wants them. Used in the server's event loop."""

    def __init__(self, jpeg_encoder: JpegEncoder | None) -> None:
        self.scene: Scene | None = None
        self.latest: Frame | None = None
        self.scene_bytes = b""
        self.drawings: dict[str, Drawn] = {}
        self.contact_forces: dict[str, ContactForces] = {}
        self._shapes: tuple[Scene | None, bytes] = None, b""
        self._contacts: tuple[dict[str, ContactForces], bytes] = {}, b""
        self.has_pictures = jpeg_encoder is not None
        self._jpeg_encoder = jpeg_encoder
        self._streamed: tuple[Frame | None, Frame | None] = None, None
        self._frame: Frame | None = None
        self._frames: dict[tuple[int, ...], tuple[tuple[Event, ...], bytes]] = {}
        self._scans: dict[str, tuple[LidarScan, bytes]] = {}
        self._drawn: dict[str, tuple[Drawn, bytes]] = {}
        self._pictures: dict[tuple[str, str], tuple[CameraImage, dict[tuple[int, int], bytes]]] = {}

    def set_scene(self, scene: Scene, world: World) -> None:
        """Replace the Scene and discard the scans and pictures of the previous one."""
        self.scene = scene
        self._world = world
        self.scene_bytes = encode(scene)
        self._scans.clear()
        self._pictures.clear()

    def streamed(self, frame: Frame, events: tuple[Event, ...]) -> Frame:
        """The Frame without scans and images, with those events."""
        if not events and not frame.events:
            if self._streamed[0] is not frame:
                self._streamed = frame, streamed(frame, NO_EVENTS)
            assert self._streamed[1] is not None
            return self._streamed[1]
        return streamed(frame, events)

    def frame_bytes(self, frame: Frame, events: tuple[Event, ...]) -> bytes:
        """The encoded Frame with those events."""
        if self._frame is not frame:
            self._frame, self._frames = frame, {}
        key = tuple(map(id, events))
        if key not in self._frames:
            self._frames[key] = events, encode(self.streamed(frame, events))
        return self._frames[key][1]

    def scan_bytes(self, scan: Scan) -> bytes:
        """The encoded scan."""
        known = self._scans.get(scan.vehicle)
        if known is None or known[0] is not scan.scan:
            known = self._scans[scan.vehicle] = scan.scan, encode(scan)
        return known[1]

    def shapes_bytes(self) -> bytes:
        """The encoded collision shapes of the Scene."""
        if self._shapes[0] is not self.scene:
            self._shapes = self.scene, encode(shapes_of(self._world.compiled))
        return self._shapes[1]

    def contacts_bytes(self) -> bytes:
        """The encoded contact forces."""
        if self._contacts[0] is not self.contact_forces:
            self._contacts = self.contact_forces, encode(Contacts(self.contact_forces))
        return self._contacts[1]

    def set_drawings(self, drawings: dict[str, Drawn]) -> bool:
        """Replace the drawings; whether they are others."""
        is_new = drawings is not self.drawings
        if is_new:
            self.drawings = drawings
            self._drawn = {name: drawn for name, drawn in self._drawn.items() if name in drawings}
        return is_new

    def drawn_bytes(self, drawn: Drawn) -> bytes:
        """The encoded drawing."""
        known = self._drawn.get(drawn.name)
        if known is None or known[0] is not drawn:
            known = self._drawn[drawn.name] = drawn, encode(drawn)
        return known[1]

    async def picture_bytes(self, vehicle: str, camera: str, image: CameraImage, wanted: Subscribe) -> bytes:
        """The encoded picture in the wanted width and quality; the JPEG is made in another thread."""
        full = image.intrinsics.width
        width = min(max(wanted.picture_width or full, MIN_WIDTH), full)
        key = width, min(max(wanted.picture_quality, 1), 100)
        known, variants = self._pictures.get((vehicle, camera), (None, {}))
        if known is not image:
            variants = {}
            self._pictures[vehicle, camera] = image, variants
        if key not in variants:
            variants[key] = await asyncio.to_thread(self._encode_picture, vehicle, camera, image, *key)
        return variants[key]

    def _encode_picture(self, vehicle: str, camera: str, image: CameraImage, width: int, quality: int) -> bytes:
        assert self._jpeg_encoder is not None
        intrinsics = image.intrinsics
        size = width, max(round(width * intrinsics.height / intrinsics.width), 1)
        jpeg = self._jpeg_encoder.encode(vehicle, camera, image, size=size, quality=quality)
        return encode(Picture(vehicle, camera, image.time, image.pose, intrinsics, jpeg))
