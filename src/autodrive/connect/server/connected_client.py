"""One connected client: its subscription, and the messages that it is sent, always with the latest state."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Event, Frame
from autodrive.protocol.native import ContactForces, Drawn, Error, Response, Scan, Scene, Subscribe
from autodrive.protocol.own_files import OwnFile
from autodrive.protocol.replay import Curve

if TYPE_CHECKING:
    from autodrive.connect.server.encoded_frames import EncodedFrames
    from autodrive.connect.server.ways import WayNotes

MAX_EVENTS = 1000
"""Events kept for a client that reads no Frames; the oldest are dropped."""
MAX_REPLIES, MAX_UNSENT = 200, 2**24
"""Responses and Errors that wait for a client, and their size [bytes]; a client that lets more wait is disconnected."""

Send = Callable[[bytes], Awaitable[None]]


class Answer(NamedTuple):
    """What a Response has besides its Frame."""

    text: str = ""
    curves: dict[str, Curve] = {}  # noqa: RUF012  nobody changes it
    files: dict[str, OwnFile] = {}  # noqa: RUF012  nobody changes it
    picture: bytes = b""


NO_ANSWER = Answer()


class ConnectedClient:
    """A client after its Hello. Used in the server's event loop. `encoded` and `ways` are shared by all clients.

    `abort` cuts the connection off.
    """

    def __init__(
        self, name: str, encoded: EncodedFrames, ways: WayNotes, abort: Callable[[], None] = lambda: None
    ) -> None:
        self.name = name
        self.abort = abort
        self.waits_since = math.inf
        """Time since which it has not read a message that is being sent [s], of the clock of the event loop."""
        self.subscription = Subscribe()
        self.is_overrun = False
        """Whether the client does not read its replies, so that it must be disconnected."""
        self._encoded = encoded
        self._ways = ways
        self._ways_until = -math.inf
        """Simulated time of the latest Frame that was sent [s]."""
        self._wake = asyncio.Event()
        self._events: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._replies: deque[tuple[bytes, Frame | None]] = deque()
        self._unsent = 0
        self._sent_scene: Scene | None = None
        self._sent_shapes: Scene | None = None
        self._sent_contacts: dict[str, ContactForces] = {}
        self._status: bytes | None = None
        self._rendered: dict[type, bytes] = {}
        self._sent_frame: Frame | None = None
        self._is_frame_due = False
        self._next_frame = 0.0
        self._sent_scans: dict[str, Any] = {}
        self._sent_drawings: dict[str, Drawn] = {}
        self._sent_pictures: dict[tuple[str, str], Any] = {}
        self._next_pictures: dict[tuple[str, str], float] = {}

    # -- what to send -------------------------------------------------------------------------------------------

    def subscribe(self, subscription: Subscribe) -> None:
        """Change the subscription."""
        self.subscription = subscription
        self._next_frame = 0.0
        self._next_pictures.clear()

    def send_error(self, error: Error) -> None:
        """Queue an Error."""
        self._add_reply(encode(error), None)

    def respond(self, id: int, frame: Frame, answer: Answer) -> None:
        """Queue the Response to a request; its Frame holds all events since the last Frame sent."""
        response = Response(id, self._encoded.streamed(frame, self._take_events()), *answer)
        self._sent_frame = frame
        self._is_frame_due = False
        self._add_reply(encode(response), frame)

    def _add_reply(self, reply: bytes, frame: Frame | None) -> None:
        self._unsent += len(reply)
        self.is_overrun = self.is_overrun or len(self._replies) >= MAX_REPLIES or self._unsent > MAX_UNSENT
        if not self.is_overrun:
            self._replies.append((reply, frame))
            self._wake.set()

    def set_status(self, status: bytes) -> None:
        """Queue an encoded Status; it replaces one that was not sent yet."""
        self._status = status
        self._wake.set()

    def set_rendered(self, kind: type, rendered: bytes) -> None:
        """Queue an encoded Rendered or SensorView; it replaces one of that kind that was not sent yet."""
        self._rendered[kind] = rendered
        self._wake.set()

    def on_drawings(self) -> None:
        """Send the drawings that are new, and the shapes, if it wants them."""
        if self.subscription.drawings or self.subscription.shapes:
            self._wake.set()

    def on_scene_change(self) -> None:
        """Discard the events of the previous scene and send the new one, and a Frame after it in any case."""
        self._events.clear()
        self._sent_frame = None
        self._wake.set()

    def offer(self, frame: Frame, events: tuple[Event, ...], now: float) -> bool:
        """Take note of a new Frame. Returns whether to offer it again later, because it could not be queued yet."""
        if events:
            self._events.extend(events)
        rate = self.subscription.frame_rate
        if self._is_frame_due or frame is self._sent_frame:
            pass
        elif rate != 0 and now >= self._next_frame:
            self._is_frame_due = True
            self._wake.set()
            return False
        if self._has_new_readings(frame, now):
            self._is_frame_due = self._is_frame_due or self.subscription.frames_of_readings
            self._wake.set()
        return rate != 0 and frame is not self._sent_frame

    # -- sending ------------------------------------------------------------------------------------------------

    async def send_loop(self, write: Send) -> None:
        """Send until cancelled; each message is chosen when the previous one was written."""
        clock = asyncio.get_running_loop().time

        async def send(message: bytes) -> None:
            self.waits_since = clock()
            await write(message)
            self.waits_since = math.inf

        while True:
            await self._wake.wait()
            self._wake.clear()
            scene = self._encoded.scene
            if scene is not None and scene is not self._sent_scene:
                self._sent_scene = scene
                self._ways_until = -math.inf
                self._sent_scans.clear()
                self._sent_drawings.clear()
                self._sent_pictures.clear()
                await send(self._encoded.scene_bytes)
            if self._status is not None:  # it is older than the replies, so it is sent first
                status, self._status = self._status, None
                await send(status)
            while self._replies:
                reply, frame = self._replies.popleft()
                self._unsent -= len(reply)
                if frame is not None:
                    await self._send_readings(frame, send)
                    await self._send_ways(frame, send)
                await send(reply)
            while self._rendered:
                await send(self._rendered.popitem()[1])
            if self._encoded.scene is scene:
                if self.subscription.shapes and scene is not self._sent_shapes:
                    self._sent_shapes = scene
                    await send(self._encoded.shapes_bytes())
                await self._send_drawings(send)
                await self._send_frame(send)

    async def _send_drawings(self, send: Send) -> None:
        """Send what differs from the drawings that were sent."""
        wanted = self._encoded.drawings if self.subscription.drawings else {}
        for name in [name for name in self._sent_drawings if name not in wanted]:
            del self._sent_drawings[name]
            await send(encode(Drawn(name, None, 0.0)))
        for name, drawn in wanted.items():
            if self._sent_drawings.get(name) is not drawn:
                self._sent_drawings[name] = drawn
                await send(self._encoded.drawn_bytes(drawn))

    async def _send_frame(self, send: Send) -> None:
        """Send the latest Frame if one is due, after its new scans and pictures."""
        latest, is_due = self._encoded.latest, self._is_frame_due
        if latest is None:
            return
        await self._send_readings(latest, send)  # meanwhile a newer Frame may come and become due
        if is_due and not self._replies and latest is not self._sent_frame:
            self._is_frame_due = False
            self._sent_frame = latest
            rate = self.subscription.frame_rate
            if rate:
                now = asyncio.get_running_loop().time()
                self._next_frame = max(self._next_frame + 1.0 / rate, now - 0.5 / rate)
            forces = self._encoded.contact_forces
            if self.subscription.contacts and forces is not self._sent_contacts:
                self._sent_contacts = forces
                await send(self._encoded.contacts_bytes())
            await self._send_ways(latest, send)
            await send(self._encoded.frame_bytes(latest, self._take_events()))

    async def _send_ways(self, frame: Frame, send: Send) -> None:
        """Send where the vehicles were since the last Frame."""
        start, self._ways_until = self._ways_until, frame.time
        if (
            self.subscription.ways
            and -math.inf < start < frame.time
            and (ways := self._ways.between(start, frame.time))
        ):
            await send(encode(ways))

    async def _send_readings(self, frame: Frame, send: Send) -> None:
        """Send the scans and pictures of that Frame that are subscribed and were not sent yet."""
        if self.subscription.scans:
            for name, vehicle in frame.vehicles.items():
                scan = vehicle.lidar
                if scan is not None and self._sent_scans.get(name) is not scan:
                    self._sent_scans[name] = scan
                    await send(self._encoded.scan_bytes(Scan(name, scan)))
        if self.subscription.picture_rate and self._encoded.has_pictures:
            await self._send_pictures(frame, send)

    async def _send_pictures(self, frame: Frame, send: Send) -> None:
        wanted = self.subscription
        now = asyncio.get_running_loop().time()
        encoding = []
        for key in self._new_pictures(frame, now):
            vehicle, camera = key
            image = frame.vehicles[vehicle].cameras[camera]
            self._sent_pictures[key] = image
            self._next_pictures[key] = max(self._next_pictures.get(key, now) + 1.0 / wanted.picture_rate, now)
            encoding.append(self._encoded.picture_bytes(vehicle, camera, image, wanted))
        for picture in await asyncio.gather(*encoding):
            await send(picture)

    def _has_new_readings(self, frame: Frame, now: float) -> bool:
        wanted = self.subscription
        if wanted.scans and any(
            vehicle.lidar is not self._sent_scans.get(name) for name, vehicle in frame.vehicles.items()
        ):
            return True
        return bool(wanted.picture_rate and self._encoded.has_pictures and self._new_pictures(frame, now))

    def _new_pictures(self, frame: Frame, now: float) -> list[tuple[str, str]]:
        return [
            (name, camera)
            for name, vehicle in frame.vehicles.items()
            for camera, image in vehicle.cameras.items()
            if self._sent_pictures.get((name, camera)) is not image
            and now >= self._next_pictures.get((name, camera), 0.0)
        ]

    def _take_events(self) -> tuple[Event, ...]:
        events = tuple(self._events)
        self._events.clear()
        return events
