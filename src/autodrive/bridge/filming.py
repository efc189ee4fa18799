"""Scene cameras for viewers who cannot draw themselves: the latest Frame, one picture at a time for each."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

from autodrive.errors import AutodriveError
from autodrive.protocol.codec import encode
from autodrive.protocol.native import Fault, Rendered, SetCamera

if TYPE_CHECKING:
    from autodrive.bridge.viewer import Viewer
    from autodrive.protocol.messages import Frame
    from autodrive.scene_process import SceneProcess
    from autodrive.world import World

HIGHEST_RATE = 60.0
"""More pictures than that are not drawn for a viewer [Hz]."""


@dataclass
class _Shooting:
    """What a viewer wants to see, and what was drawn of it last."""

    number: int
    wish: SetCamera
    frame: Frame | None = None
    is_under_way: bool = False
    is_due_again: bool = False
    is_put_off: bool = False
    next: float = 0.0


class Filming:
    """Lives in the server's loop. `crew` makes what draws a World; it begins with the first wish."""

    def __init__(self, crew: Callable[[World], SceneProcess]) -> None:
        self._crew = crew
        self._world: World | None = None
        self._process: SceneProcess | None = None
        self._shootings: dict[Viewer, _Shooting] = {}
        self._latest: Frame | None = None
        self._count = 0

    async def set_world(self, world: World) -> None:
        """From now on that one is drawn."""
        before, self._world, self._latest = self._process, world, None
        self._process = self._crew(world) if self._shootings else None
        if before is not None:
            await asyncio.to_thread(before.close)

    async def close(self) -> None:
        """Draw no more."""
        self._shootings.clear()
        if self._process is not None:
            await asyncio.to_thread(self._process.close)

    def wish(self, viewer: Viewer, wish: SetCamera, now: float) -> None:
        """From now on that viewer is sent pictures, or none. Raises `AutodriveError`."""
        if wish.camera is None:
            self.forget(viewer)
            return
        if self._world is None:
            raise AutodriveError("the scene is not there yet")
        if self._process is None:
            self._process = self._crew(self._world)
        self._process.check(wish)
        if not 0.0 < wish.rate <= 1e6:
            raise AutodriveError(f"the rate of a SetCamera is more than 0 Hz, not {wish.rate}")
        if viewer not in self._shootings:
            self._count += 1
            self._shootings[viewer] = _Shooting(self._count, wish)
        shooting = self._shootings[viewer]
        shooting.wish, shooting.frame, shooting.next = wish, None, 0.0
        self._shoot(viewer, shooting, now)

    def forget(self, viewer: Viewer) -> None:
        """It wants no more, or is gone."""
        shooting = self._shootings.pop(viewer, None)
        if shooting is not None and self._process is not None:
            self._process.forget(shooting.number)

    def news(self, frame: Frame, now: float) -> None:
        """A new Frame."""
        self._latest = frame
        for viewer, shooting in list(self._shootings.items()):
            self._shoot(viewer, shooting, now)

    def _shoot(self, viewer: Viewer, shooting: _Shooting, now: float) -> None:
        """Have the latest Frame drawn, unless it was, or a picture is under way, or it is too early."""
        frame, process = self._latest, self._process
        if frame is None or frame is shooting.frame or process is None:
            return
        if shooting.is_under_way:
            shooting.is_due_again = True
            return
        if now < shooting.next:  # this Frame may be the last for long, for example at a pause
            if not shooting.is_put_off:
                shooting.is_put_off = True
                asyncio.get_running_loop().call_at(shooting.next, self._shoot_now, viewer, shooting)
            return
        shooting.is_under_way, shooting.frame = True, frame
        shooting.next = now + 1.0 / min(shooting.wish.rate, HIGHEST_RATE)
        loop = asyncio.get_running_loop()

        def bring(picture: Future[bytes]) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                loop.call_soon_threadsafe(self._show, viewer, shooting, frame, picture)

        process.draw(shooting.number, shooting.wish, frame).add_done_callback(bring)

    def _shoot_now(self, viewer: Viewer, shooting: _Shooting) -> None:
        shooting.is_put_off = False
        if self._shootings.get(viewer) is shooting:
            self._shoot(viewer, shooting, asyncio.get_running_loop().time())

    def _show(self, viewer: Viewer, shooting: _Shooting, frame: Frame, picture: Future[bytes]) -> None:
        shooting.is_under_way = False
        if self._shootings.get(viewer) is not shooting:
            return
        error = picture.exception()
        if error is None:
            viewer.rendered(encode(Rendered(frame.time, picture.result())))
        elif self._latest is not None:  # else it was drawn for a World that is gone
            del self._shootings[viewer]
            viewer.fault(Fault("request", str(error)))
            return
        if shooting.is_due_again:
            shooting.is_due_again = False
            self._shoot_now(viewer, shooting)
