"""One connected client: what it wants, what it was sent, and what it is to be sent next, which is always the latest."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Event, Frame
from autodrive.protocol.native import Done, Fault, Scan, Scene, Subscribe

if TYPE_CHECKING:
    from autodrive.bridge.stream import Stream

EVENTS = 1000
"""So many events are kept for a client that takes no Frames; the oldest go first."""
REPLIES = 200
"""So many Faults wait for a client that does not read; more are dropped."""

Send = Callable[[bytes], Awaitable[None]]


class Viewer:
    """A client after its Hello. Lives in the server's loop.

    `stream` encodes what is sent, once for all who want the same.
    """

    def __init__(self, name: str, stream: Stream) -> None:
        self.name = name
        self.subscription = Subscribe()
        self.pending = 0
        """Requests under way."""
        self._stream = stream
        self._wake = asyncio.Event()
        self._events: deque[Event] = deque(maxlen=EVENTS)
        self._replies: deque[tuple[bytes, Frame | None]] = deque()
        self._scene: Scene | None = None
        self._status: bytes | None = None
        self._rendered: bytes | None = None
        self._sent: Frame | None = None
        self._is_due = False
        self._next_frame = 0.0
        self._scans: dict[str, Any] = {}
        self._pictures: dict[tuple[str, str], Any] = {}
        self._next_pictures: dict[tuple[str, str], float] = {}

    # -- what is to be sent -------------------------------------------------------------------------------------

    def subscribe(self, subscription: Subscribe) -> None:
        """From now on."""
        self.subscription = subscription
        self._next_frame = 0.0
        self._next_pictures.clear()

    def fault(self, fault: Fault) -> None:
        """Say that something could not be done."""
        if len(self._replies) < REPLIES or fault.id is not None:
            self._replies.append((encode(fault), None))
            self._wake.set()

    def done(self, id: int, frame: Frame) -> None:
        """Say that a request was carried out; the Frame holds all events since the last one."""
        self._replies.append((encode(Done(id, self._stream.plain(frame, self._take_events()))), frame))
        self._sent = frame
        self._is_due = False
        self._wake.set()

    def status(self, status: bytes) -> None:
        """Send it; one that was not sent yet is forgotten."""
        self._status = status
        self._wake.set()

    def rendered(self, picture: bytes) -> None:
        """Send it; one that was not sent yet is forgotten."""
        self._rendered = picture
        self._wake.set()

    def scene_changed(self) -> None:
        """The events, scans and pictures of another scene are past."""
        self._events.clear()
        self._wake.set()

    def news(self, frame: Frame, events: tuple[Event, ...], now: float) -> bool:
        """Take note of a Frame; whether it is to be looked at again: it may only be sent later, or one before it is."""
        if events:
            self._events.extend(events)
        rate = self.subscription.frame_rate
        if self._is_due or frame is self._sent:
            pass
        elif rate != 0 and now >= self._next_frame:
            self._is_due = True
            self._wake.set()
            return False
        if self._has_new(frame, now):
            self._wake.set()
        return rate != 0 and frame is not self._sent

    # -- sending ------------------------------------------------------------------------------------------------

    async def speak(self, send: Send) -> None:
        """Send what there is, for ever; each thing is chosen when the one before has left."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            scene = self._stream.scene
            if scene is not None and scene is not self._scene:
                self._scene = scene
                self._scans.clear()
                self._pictures.clear()
                await send(self._stream.scene_bytes)
            if self._status is not None:  # it is older than the answers, and goes before them
                status, self._status = self._status, None
                await send(status)
            while self._replies:
                reply, frame = self._replies.popleft()
                if frame is not None:
                    await self._send_new(frame, send)
                await send(reply)
            if self._rendered is not None:
                rendered, self._rendered = self._rendered, None
                await send(rendered)
            if self._stream.scene is scene:
                await self._send_frame(send)

    async def _send_frame(self, send: Send) -> None:
        """The latest, if one is due, after the scans and pictures that are new in it."""
        latest, is_due = self._stream.latest, self._is_due
        if latest is None:
            return
        await self._send_new(latest, send)  # meanwhile a newer one may come, and become due
        if is_due and not self._replies and latest is not self._sent:
            self._is_due = False
            self._sent = latest
            rate = self.subscription.frame_rate
            if rate:
                now = asyncio.get_running_loop().time()
                self._next_frame = max(self._next_frame + 1.0 / rate, now - 0.5 / rate)
            await send(self._stream.frame_bytes(latest, self._take_events()))

    async def _send_new(self, frame: Frame, send: Send) -> None:
        """Scans and pictures of that Frame that this client wants and has not got."""
        if self.subscription.scans:
            for name, vehicle in frame.vehicles.items():
                scan = vehicle.lidar
                if scan is not None and self._scans.get(name) is not scan:
                    self._scans[name] = scan
                    await send(self._stream.scan_bytes(Scan(name, scan)))
        if self.subscription.picture_rate and self._stream.has_pictures:
            await self._send_pictures(frame, send)

    async def _send_pictures(self, frame: Frame, send: Send) -> None:
        wants = self.subscription
        now = asyncio.get_running_loop().time()
        encoding = []
        for key in self._new_pictures(frame, now):
            vehicle, camera = key
            image = frame.vehicles[vehicle].cameras[camera]
            self._pictures[key] = image
            self._next_pictures[key] = max(self._next_pictures.get(key, now) + 1.0 / wants.picture_rate, now)
            encoding.append(self._stream.picture_bytes(vehicle, camera, image, wants))
        for picture in await asyncio.gather(*encoding):
            await send(picture)

    def _has_new(self, frame: Frame, now: float) -> bool:
        wants = self.subscription
        if wants.scans and any(its.lidar is not self._scans.get(name) for name, its in frame.vehicles.items()):
            return True
        return bool(wants.picture_rate and self._stream.has_pictures and self._new_pictures(frame, now))

    def _new_pictures(self, frame: Frame, now: float) -> list[tuple[str, str]]:
        return [
            (name, camera)
            for name, vehicle in frame.vehicles.items()
            for camera, image in vehicle.cameras.items()
            if self._pictures.get((name, camera)) is not image and now >= self._next_pictures.get((name, camera), 0.0)
        ]

    def _take_events(self) -> tuple[Event, ...]:
        events = tuple(self._events)
        self._events.clear()
        return events
