"""The requests of one client, which wait in order, and the time that the requests of all clients may use."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from itertools import count

from autodrive.base.token_bucket import TokenBucket
from autodrive.protocol.messages import (
    AddBox,
    CloseLoop,
    EditMap,
    EditTrack,
    GenerateTrack,
    LoadScenario,
    Place,
    Redo,
    RemoveBox,
    Reset,
    Seek,
    SetSceneLight,
    SetSensor,
    SetSpeed,
    SetTimeOfDay,
    SetWeather,
    Undo,
    UseMap,
)
from autodrive.protocol.native import ConnectBridge, Request, ServerOperation, SetCamera, ViewSensor
from autodrive.protocol.own_files import ImportTrack, OpenFile

MAX_PENDING, MAX_PENDING_BYTES = 64, 2**21
"""Requests of one client that wait, and bytes of their messages; more are refused."""

SHARE, BURST = 0.2, 2.0
"""Share of the time that the requests of all clients use while time runs, and what they may use at once [s]."""
MAP_EDITS, EDIT_BURST = (EditMap, UseMap, CloseLoop, EditTrack, GenerateTrack), 8.0
"""Requests that edit the map, and what they may use at once [s], those of one client and those of all: a person makes
many edits in a row, so that they have a share of their own. Other requests of a client wait for their share each."""
BUILDS = (*MAP_EDITS, AddBox, RemoveBox, Place, SetSensor, LoadScenario, ImportTrack, OpenFile, Undo, Redo)
"""Requests that may make another World, for which the short ones do not wait. They have a share of their own, too."""

REPLACED = (
    Reset,
    LoadScenario,
    Seek,
    SetSpeed,
    SetSceneLight,
    SetTimeOfDay,
    SetWeather,
    SetCamera,
    ViewSensor,
    ConnectBridge,
)
"""Requests of which several in a row are executed only once, as the last one asks; the answer is that of all."""


@dataclass
class QueuedOperation:
    """An operation, and the ids of the requests that it answers."""

    operation: ServerOperation
    ids: list[int]
    size: int = 0
    """Size of the message [bytes]."""
    number: int = field(default_factory=count().__next__)
    """Number of the request: a newer one has a greater number."""
    started: float = 0.0
    """Time at which its turn began [s]."""
    work: float = 0.0
    """Time that its preparation and the simulation needed [s]."""

    @property
    def is_build(self) -> bool:
        """Whether it may make another World."""
        return isinstance(self.operation, BUILDS)


class Limits:
    """Limits of the time that edits of a map, other builds and short requests use.

    Builds and short requests may use `burst` at once [s].
    """

    def __init__(self, burst: float) -> None:
        now = time.perf_counter()
        self._edits = TokenBucket(SHARE, EDIT_BURST, now)
        self._builds = TokenBucket(SHARE, burst, now)
        self._others = TokenBucket(SHARE, burst, now)

    def of(self, operation: ServerOperation) -> TokenBucket:
        """The limit of an operation."""
        if isinstance(operation, MAP_EDITS):
            return self._edits
        return self._builds if isinstance(operation, BUILDS) else self._others

    def pay(self, operation: ServerOperation, work: float, now: float) -> None:
        """An operation took that time [s] and has just ended: the next ones wait for their share."""
        self.of(operation).tokens(now)
        self.of(operation).take(work)


@dataclass
class RequestQueue:
    """The requests of one client that wait. Times are those of any steady clock [s]."""

    limits: Limits = field(default_factory=lambda: Limits(0.0))
    is_busy: bool = False
    """Whether a request is being executed."""
    _entries: deque[QueuedOperation] = field(default_factory=deque)

    def add(self, request: Request, size: int = 0) -> bool:
        """Add a request, whose message has that size [bytes]. Returns False if too many are waiting."""
        waiting = sum(entry.size for entry in self._entries)
        if sum(len(entry.ids) for entry in self._entries) >= MAX_PENDING or waiting + size > MAX_PENDING_BYTES:
            return False
        last = self._entries[-1] if self._entries else None
        if last and isinstance(request.operation, REPLACED) and type(last.operation) is type(request.operation):
            self._entries[-1] = QueuedOperation(request.operation, [*last.ids, request.id], size)
        else:
            self._entries.append(QueuedOperation(request.operation, [request.id], size))
        return True

    @property
    def is_idle(self) -> bool:
        """Whether no request waits or is being executed."""
        return not self._entries and not self.is_busy

    @property
    def next(self) -> QueuedOperation | None:
        """The request that is executed next; None if none waits, or while one is being executed."""
        return self._entries[0] if self._entries and not self.is_busy else None

    def take(self, now: float) -> QueuedOperation:
        """Remove and return the next request, to execute it now."""
        self.is_busy = True
        entry = self._entries.popleft()
        entry.started = now
        return entry

    def clear(self) -> None:
        """Drop all requests that wait."""
        self._entries.clear()
