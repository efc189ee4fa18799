"""Where all viewers meet: brings them the news of the simulation, and their commands and requests to it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import msgspec

from autodrive import __version__
from autodrive.bridge.errands import Errands
from autodrive.bridge.files import File, scene_files
from autodrive.bridge.filming import Filming
from autodrive.bridge.mail import Carried, Mail, News
from autodrive.bridge.rate import Allowance
from autodrive.bridge.seats import Seats
from autodrive.bridge.stream import Stream
from autodrive.bridge.viewer import Viewer
from autodrive.errors import AutodriveError
from autodrive.protocol.codec import decode_client, encode
from autodrive.protocol.native import (
    PROTOCOL,
    SUBPROTOCOL,
    ClientMessage,
    Drive,
    Fault,
    Hello,
    Please,
    Release,
    Status,
    Subscribe,
    Welcome,
)

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge
    from autodrive.jpeg import JpegEncoder
    from autodrive.scene_process import SceneProcess
    from autodrive.scenery import Scenery
    from autodrive.simulation import Simulation
    from autodrive.world import World

log = logging.getLogger(__name__)

VIEWERS = 100
"""More are sent away."""
GREETING_TIME = 5.0
"""A Hello comes within that time [s]."""
SWEEP = 0.02
"""A Frame that could not be sent yet is looked at again after that time [s]."""
STATUS = 0.25
"""Between two Status [s]."""
POLICY, TRY_LATER = 1008, 1013
"""Codes with which a WebSocket is closed (RFC 6455)."""


class Hub:
    """Lives in the server's loop, as an asynchronous context; `talk` is the conversation with one client.

    `files` are those of the scenery, by their paths. See `Server` for the rest.
    """

    def __init__(
        self,
        simulation: Simulation,
        *,
        scenery: Callable[[World], Scenery],
        bridge: DevkitBridge | None,
        scenarios: dict[str, str],
        pictures: JpegEncoder | None,
        cameras_fault: Callable[[], str],
        wants_pictures: Callable[[bool], None],
        crew: Callable[[World], SceneProcess],
    ) -> None:
        self.files: dict[str, File] = {}
        self.seats = Seats()
        self._simulation = simulation
        self._scenery = scenery
        self._scenarios = scenarios
        self._cameras_fault = cameras_fault
        self._wants_pictures = wants_pictures
        self._stream = Stream(pictures)
        self._viewers: set[Viewer] = set()
        self._mail = Mail(simulation, self._take_mail)
        self._filming = Filming(crew)
        self._errands = Errands(simulation, self._mail, self.seats, bridge, scenarios, self._filming, self._show_status)
        self._held: list[News | Carried] = []
        self._world: World | None = None
        self._drawing: asyncio.Task[None] | None = None
        self._is_sweeping = False
        self._is_status_due = False
        self._are_pictures_wanted = False

    async def __aenter__(self) -> Hub:
        self._loop = asyncio.get_running_loop()
        self._mail.open(self._loop)
        self._simulation.add_sink(self._mail)
        self._mail.publish(self._simulation.frame)
        self._clock = asyncio.create_task(self._tell_status())
        return self

    async def __aexit__(self, *_: object) -> None:
        self._simulation.remove_sink(self._mail)
        for task in (self._clock, self._drawing):
            if task is not None:
                task.cancel()
        if self._are_pictures_wanted:
            self._wants_pictures(False)
        await self._filming.close()

    @property
    def viewers(self) -> int:
        """How many are connected now; any thread may ask."""
        return len(self._viewers)

    # -- one client ---------------------------------------------------------------------------------------------

    async def talk(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        """From the Hello to the end."""
        offered = scope["subprotocols"]
        await send({"type": "websocket.accept", "subprotocol": SUBPROTOCOL if SUBPROTOCOL in offered else None})

        async def say(message: bytes) -> None:
            await send({"type": "websocket.send", "bytes": message})

        try:
            hello = await self._greeting(receive)
        except _RefusedError as error:
            await say(encode(error.fault))
            await send({"type": "websocket.close", "code": POLICY})
            return
        if hello is None:
            return
        if len(self._viewers) >= VIEWERS:
            await say(encode(Fault("rate", f"{VIEWERS} viewers are connected, and there is no room for more")))
            await send({"type": "websocket.close", "code": TRY_LATER})
            return
        viewer = Viewer(self._free_name(hello.name), self._stream)
        await say(encode(Welcome(PROTOCOL, __version__, viewer.name, self._scenarios)))
        await self._attend(viewer, receive, send, say)

    async def _attend(self, viewer: Viewer, receive: Any, send: Any, say: Any) -> None:
        self._viewers.add(viewer)
        self._show_status()
        if self._stream.latest is not None:
            viewer.news(self._stream.latest, (), self._loop.time())
        speaking = asyncio.create_task(viewer.speak(say))
        try:
            await self._listen(viewer, receive)
            with contextlib.suppress(Exception):
                await send({"type": "websocket.close", "code": POLICY})
        finally:
            speaking.cancel()
            self._viewers.discard(viewer)
            self._errands.forget(viewer)
            self._note_wishes()
            self._show_status()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await speaking

    async def _greeting(self, receive: Any) -> Hello | None:
        """None if the client went away instead."""
        try:
            async with asyncio.timeout(GREETING_TIME):
                data = await _next(receive)
        except TimeoutError:
            raise _RefusedError("message", f"no Hello came within {GREETING_TIME:g} s") from None
        if data is None:
            return None
        try:
            hello = _understood(data)
        except AutodriveError as error:
            raise _RefusedError("message", str(error)) from None
        if not isinstance(hello, Hello):
            raise _RefusedError("message", f"the first message is a Hello, not a {type(hello).__name__}")
        if hello.protocol != PROTOCOL:
            ours = f"this simulator speaks version {PROTOCOL} of the protocol, not {hello.protocol}"
            raise _RefusedError("version", ours)
        return hello

    async def _listen(self, viewer: Viewer, receive: Any) -> None:
        """Obey, until the client goes away or is to be sent away."""
        allowance = Allowance(self._loop.time())
        while (data := await _next(receive)) is not None:
            try:
                message = _understood(data)
            except AutodriveError as error:
                message = error
            if not isinstance(message, Please) and not allowance.has_room(self._loop.time()):
                if allowance.is_hopeless:
                    return
                if allowance.may_complain(self._loop.time()):
                    viewer.fault(Fault("rate", f"more than {allowance.rate:g} messages a second; some are dropped"))
                continue
            match message:
                case AutodriveError():
                    viewer.fault(Fault("message", str(message)))
                case Subscribe():
                    self._subscribe(viewer, message)
                case Drive():
                    self._errands.drive(viewer, message, self._loop.time())
                case Release(vehicle=vehicle):
                    self.seats.release(vehicle, viewer)
                    self._show_status()
                case Please():
                    self._errands.request(viewer, message, self._loop.time())
                case Hello():
                    viewer.fault(Fault("message", "a Hello comes once, at the beginning"))

    def _subscribe(self, viewer: Viewer, subscription: Subscribe) -> None:
        rate = subscription.frame_rate
        if not (rate is None or 0 <= rate < 1e6) or not 0 <= subscription.picture_rate < 1e6:
            viewer.fault(Fault("message", "a Subscribe needs rates of 0 or more Hz"))
            return
        viewer.subscribe(subscription)
        self._note_wishes()
        if self._stream.latest is not None:
            viewer.news(self._stream.latest, (), self._loop.time())

    def _note_wishes(self) -> None:
        wanted = any(viewer.subscription.picture_rate > 0 for viewer in self._viewers)
        if wanted != self._are_pictures_wanted:
            self._are_pictures_wanted = wanted
            self._wants_pictures(wanted)

    def _free_name(self, wish: str) -> str:
        name = "".join(c for c in wish if c.isprintable())[:40].strip() or "viewer"
        taken = {viewer.name for viewer in self._viewers}
        return next(one for n in range(1, VIEWERS + 2) if (one := name if n == 1 else f"{name} {n}") not in taken)

    # -- news ---------------------------------------------------------------------------------------------------

    def _take_mail(self) -> None:
        """What the simulation's thread left; the Frames of another World wait until it is known how to draw it."""
        for item in self._mail.take():
            if self._drawing is not None:
                self._hold(item)
            elif isinstance(item, Carried):
                item.tell(item.future)
            elif item.world is not self._world:
                self._hold(item)
                self._drawing = asyncio.create_task(self._draw(item.world))
            else:
                self._spread(item)

    def _hold(self, item: News | Carried) -> None:
        """Of News that follow each other only the last is kept."""
        if isinstance(item, News) and self._held and isinstance(before := self._held[-1], News):
            events = (*before.events, *item.events) if before.world is item.world else item.events
            self._held[-1] = News(item.world, item.frame, events[-1000:])
        else:
            self._held.append(item)

    def _spread(self, news: News) -> None:
        self._stream.latest = news.frame
        now = self._loop.time()
        self._filming.news(news.frame, now)
        is_early = False
        for viewer in self._viewers:
            is_early |= viewer.news(news.frame, news.events, now)
        if is_early and not self._is_sweeping:
            self._is_sweeping = True
            self._loop.call_later(SWEEP, self._sweep)

    def _sweep(self) -> None:
        """A Frame that came too early for some may be the last for long, for example at a pause."""
        self._is_sweeping = False
        if self._stream.latest is not None and self._drawing is None and self._world is not None:
            self._spread(News(self._world, self._stream.latest, ()))

    async def _draw(self, world: World) -> None:
        """Have the scenery of a World made, then tell all that has waited for it."""
        self._errands.note = "preparing the scene"
        self._show_status()
        try:
            scenery = await asyncio.to_thread(self._scenery, world)
            self.files = scene_files(scenery.files, "scene")
            self._stream.set_scene(scenery.scene)
        except Exception:
            log.exception("server: the scene cannot be drawn, and viewers see none")
        await self._filming.set_world(world)
        self._errands.note = ""
        self._world = world
        for viewer in self._viewers:
            viewer.scene_changed()
        self._drawing = None
        held, self._held = self._held, []
        self._mail.put_back(held)
        self._take_mail()
        self._show_status()

    # -- status -------------------------------------------------------------------------------------------------

    def _show_status(self) -> None:
        """Something in it was switched: send it at once, but once for all that was switched together."""
        if not self._is_status_due:
            self._is_status_due = True
            self._loop.call_soon(self._send_status)

    async def _tell_status(self) -> None:
        while True:
            self._send_status()
            await asyncio.sleep(STATUS)

    def _send_status(self) -> None:
        self._is_status_due = False
        if not self._viewers:
            return
        simulation = self._simulation
        status = encode(
            Status(
                is_paused=simulation.is_paused,
                speed=simulation.speed,
                real_time_factor=simulation.real_time_factor,
                late_ticks=simulation.late_ticks,
                viewers=len(self._viewers),
                drivers={vehicle: who.name for vehicle, who in self.seats.drivers(self._loop.time()).items()},
                bridge=self._errands.bridge_status(self._loop.time()),
                cameras_fault=self._cameras_fault() if self._are_pictures_wanted else "",
                note=self._errands.note or ("" if simulation.is_running else "the simulation is not running"),
            )
        )
        for viewer in self._viewers:
            viewer.status(status)


class _RefusedError(Exception):
    """A client that is not let in."""

    def __init__(self, code: Literal["message", "version"], text: str) -> None:
        super().__init__(text)
        self.fault = Fault(code, text)


async def _next(receive: Any) -> bytes | str | None:
    """The next message, or None at the end."""
    event = await receive()
    if event["type"] != "websocket.receive":
        return None
    return event.get("bytes") if event.get("bytes") is not None else event["text"]


def _understood(data: bytes | str) -> ClientMessage:
    if isinstance(data, str):
        raise AutodriveError("a text came; messages are binary, in MessagePack")
    try:
        return decode_client(data)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise AutodriveError(f"a message was not understood: {error}") from None
