"""Passes Frames and finished requests from the simulation's thread to the server's event loop."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING

from autodrive.protocol.messages import Event, Frame

if TYPE_CHECKING:
    from autodrive.world import World
    from autodrive.world.simulation.paced import Paced

LONGEST_WAIT = 0.02
"""Frames of a long Step wake the event loop at least once in this time [s]."""


MAX_EVENTS = 1000
"""Events that wait for the event loop; the oldest are dropped."""


@dataclass(frozen=True)
class FrameUpdate:
    """The latest Frame of a World, with the events of all Frames since the previous update."""

    world: World
    frame: Frame
    events: tuple[Event, ...]


@dataclass(frozen=True)
class Completion:
    """A request was carried out or refused."""

    future: Future[Frame]
    callback: Callable[[Future[Frame]], None]


class FrameQueue:
    """A queue in order; `on_items` is called in the event loop, once for all items that wait.

    A waiting update is replaced by a newer one, which keeps its events.
    """

    def __init__(self, simulation: Paced, on_items: Callable[[], None]) -> None:
        self._simulation = simulation
        self._loop: asyncio.AbstractEventLoop | None = None
        self._on_items = on_items
        self._lock = threading.Lock()
        self._queued: list[FrameUpdate | Completion] = []
        self._is_wakeup_pending = False
        self._last_wakeup = 0.0
        self.steps = 0
        """Pending Steps (written by the loop): their Frames do not wake the loop; the completion follows at once."""

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Call `on_items` in that loop from now on."""
        self._loop = loop
        self._queued.clear()
        self._is_wakeup_pending = False

    def publish(self, frame: Frame) -> None:
        """Add a Frame; called as a Sink in the simulation's thread."""
        update = FrameUpdate(self._simulation.world, frame, frame.events)
        with self._lock:
            last = self._queued[-1] if self._queued else None
            if isinstance(last, FrameUpdate):
                if last.events and last.world is update.world:
                    update = FrameUpdate(update.world, frame, (*last.events, *frame.events)[-MAX_EVENTS:])
                self._queued[-1] = update
            else:
                self._queued.append(update)
        if not self.steps or time.monotonic() - self._last_wakeup > LONGEST_WAIT:
            self._wake()

    def call_when_done(self, future: Future[Frame], callback: Callable[[Future[Frame]], None]) -> None:
        """Call `callback` in the loop when that request is done, after the Frames before it."""

        def add(done: Future[Frame]) -> None:
            with self._lock:
                self._queued.append(Completion(done, callback))
            self._wake()

        future.add_done_callback(add)

    def deliver(self) -> None:
        """Deliver waiting items now; called in the loop."""
        self._on_items()

    def take(self) -> list[FrameUpdate | Completion]:
        """Remove and return all items, in order; called in the loop."""
        with self._lock:
            queued, self._queued = self._queued, []
            self._is_wakeup_pending = False
        return queued

    def put_back(self, taken: list[FrameUpdate | Completion]) -> None:
        """Insert items before all others; called in the loop."""
        with self._lock:
            self._queued[:0] = taken

    def _wake(self) -> None:
        if not self._is_wakeup_pending and self._loop is not None:
            self._is_wakeup_pending = True
            self._last_wakeup = time.monotonic()
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(self._on_items)
