"""The requests of one client: one is executed at a time, the others wait in order."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from autodrive.protocol.messages import LoadScenario, Reset, SetSceneLight, SetSpeed, SetTimeOfDay
from autodrive.protocol.native import ConnectBridge, Request, ServerOperation, SetCamera

MAX_PENDING = 64
"""Requests of one client that wait; more are refused."""

REPLACED = (Reset, LoadScenario, SetSpeed, SetSceneLight, SetTimeOfDay, SetCamera, ConnectBridge)
"""Of several such requests in a row only the last one is executed; it answers all of them."""


@dataclass
class Entry:
    """An operation, and the ids of the requests that it answers."""

    operation: ServerOperation
    ids: list[int]
    started: float = 0.0
    """Time at which its execution began [s]."""


@dataclass
class RequestQueue:
    """The requests of one client that wait. Times are those of any steady clock [s]."""

    is_busy: bool = False
    """Whether a request is being executed."""
    free_at: float = 0.0
    """Earliest time of the next execution."""
    is_scheduled: bool = False
    """Whether the next execution is scheduled for `free_at`."""
    _entries: deque[Entry] = field(default_factory=deque)

    def add(self, request: Request) -> bool:
        """Add a request. Returns False if too many are waiting."""
        if sum(len(entry.ids) for entry in self._entries) >= MAX_PENDING:
            return False
        last = self._entries[-1] if self._entries else None
        if last and isinstance(request.operation, REPLACED) and type(last.operation) is type(request.operation):
            last.operation = request.operation
            last.ids.append(request.id)
        else:
            self._entries.append(Entry(request.operation, [request.id]))
        return True

    def take(self, now: float) -> Entry | None:
        """Remove and return the next request, if it can be executed now."""
        if self.is_busy or not self._entries or now < self.free_at:
            return None
        self.is_busy = True
        entry = self._entries.popleft()
        entry.started = now
        return entry

    def clear(self) -> None:
        """Drop all requests that wait."""
        self._entries.clear()

    def __len__(self) -> int:
        """Number of operations that wait."""
        return len(self._entries)
