"""What the simulation's thread hands over to the server's: the latest Frame with all events, and requests done."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from autodrive.protocol.messages import Event, Frame

if TYPE_CHECKING:
    from autodrive.world import World

LONGEST_WAIT = 0.02
"""Frames of a long Step are handed over at least so often [s]."""


class HasWorld(Protocol):
    """What is needed of a Simulation."""

    @property
    def world(self) -> World:
        """The World that ticks now."""
        ...


@dataclass(frozen=True)
class News:
    """The latest Frame of a World, with the events of all Frames since the News before."""

    world: World
    frame: Frame
    events: tuple[Event, ...]


@dataclass(frozen=True)
class Carried:
    """A request was carried out, or refused."""

    future: Future[Frame]
    tell: Callable[[Future[Frame]], None]


class Mail:
    """In order, from the thread of the simulation to the loop of the server, which is woken once for all that waits.

    News that nobody has taken yet are replaced by newer ones, which keep their events.
    """

    def __init__(self, simulation: HasWorld, take: Callable[[], None]) -> None:
        self._simulation = simulation
        self._loop: asyncio.AbstractEventLoop | None = None
        self._take = take
        self._lock = threading.Lock()
        self._items: list[News | Carried] = []
        self._is_ringing = False
        self._rung = 0.0
        self.steps = 0
        """Steps under way (written by the loop): their Frames wait for what follows at once, that they are done."""

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """From now on `take` is called in that loop."""
        self._loop = loop
        self._items.clear()
        self._is_ringing = False

    def publish(self, frame: Frame) -> None:
        """As a Sink, in the thread of the simulation."""
        news = News(self._simulation.world, frame, frame.events)
        with self._lock:
            last = self._items[-1] if self._items else None
            if isinstance(last, News):
                if last.events and last.world is news.world:
                    news = News(news.world, frame, (*last.events, *frame.events))
                self._items[-1] = news
            else:
                self._items.append(news)
        if not self.steps or time.monotonic() - self._rung > LONGEST_WAIT:
            self._ring()

    def when_carried(self, future: Future[Frame], tell: Callable[[Future[Frame]], None]) -> None:
        """When that request is done, `tell` it in the loop, after the Frames before it."""

        def bring(done: Future[Frame]) -> None:
            with self._lock:
                self._items.append(Carried(done, tell))
            self._ring()

        future.add_done_callback(bring)

    def deliver(self) -> None:
        """What has come, without waiting for the bell; in the loop."""
        self._take()

    def take(self) -> list[News | Carried]:
        """All that has come, in order; in the loop."""
        with self._lock:
            items, self._items = self._items, []
            self._is_ringing = False
        return items

    def put_back(self, items: list[News | Carried]) -> None:
        """Before all that has come since; in the loop."""
        with self._lock:
            self._items[:0] = items

    def _ring(self) -> None:
        if not self._is_ringing and self._loop is not None:
            self._is_ringing = True
            self._rung = time.monotonic()
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                self._loop.call_soon_threadsafe(self._take)
