"""The requests of one client, which wait in order, and the time that the requests of all clients may use."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from itertools import count
from typing import Any, Literal, NamedTuple

from autodrive.base.token_bucket import TokenBucket

MAX_PENDING, MAX_PENDING_BYTES = 64, 2**21
"""Requests of one client that wait, and bytes of their messages; more are refused."""

SHARE, BURST = 0.2, 2.0
"""Share of the time that the requests of all clients use while time runs, and what they may use at once [s]."""
EDIT_BURST = 8.0
"""What edits of the map may use at once [s], those of one client and those of all: a person makes many in a row."""


class RequestKind(NamedTuple):
    """How requests of a kind are executed."""

    share: Literal["short", "build", "map edit"] = "short"
    """The share of the time that they use. All but the short ones may make another World: short ones of the simulation
    do not wait for them."""
    is_of_server: bool = False
    """Executed by the server; all others by the simulation, which executes one at a time."""
    is_beside: bool = False
    """Executed at once, beside the queue: it takes a second, for which the next request of the client must not wait."""
    is_limited: bool = True
    """False: they may use all of the time."""
    is_replaced: bool = False
    """Several in a row are executed only once, as the last one asks; the answer is that of all."""
    is_common: bool = False
    """Several clients ask: the request is executed only once, as the newest one asks."""
    least_work: float = 0.0
    """A request counts as if it took this time or more [s]: it causes work elsewhere."""
    change: str = ""
    """The change that all clients see, and of which the others are told; empty: there is none."""

    @property
    def is_build(self) -> bool:
        """Whether it may make another World."""
        return self.share != "short"


@dataclass
class QueuedOperation:
    """An operation, and the ids of the requests that it answers."""

    operation: Any
    kind: RequestKind
    ids: list[int]
    size: int = 0
    """Size of the message [bytes]."""
    number: int = field(default_factory=count().__next__)
    """Number of the request: a newer one has a greater number."""
    started: float = 0.0
    """Time at which its turn began [s]."""
    work: float = 0.0
    """Time that its preparation and the simulation needed [s]."""


class Limits:
    """Limits of the time that each share may use. Short requests and builds may use `burst` at once [s]."""

    def __init__(self, burst: float) -> None:
        now = time.perf_counter()
        bursts = {"short": burst, "build": burst, "map edit": EDIT_BURST}
        self._buckets = {share: TokenBucket(SHARE, most, now) for share, most in bursts.items()}

    def free_at(self, kind: RequestKind) -> float:
        """Time from which a request of that kind may be executed [s]."""
        return self._buckets[kind.share].free_at

    def pay(self, kind: RequestKind, work: float, now: float) -> None:
        """A request took that time [s] and has just ended: the next ones wait for their share."""
        self._buckets[kind.share].tokens(now)
        self._buckets[kind.share].take(work)


@dataclass
class RequestQueue:
    """The requests of one client that wait. Times are those of any steady clock [s]."""

    limits: Limits = field(default_factory=lambda: Limits(0.0))
    is_busy: bool = False
    """Whether a request is being executed."""
    _entries: deque[QueuedOperation] = field(default_factory=deque)

    def add(self, entry: QueuedOperation) -> bool:
        """Add a request. Returns False if too many are waiting."""
        waiting = sum(entry.size for entry in self._entries)
        if sum(len(entry.ids) for entry in self._entries) >= MAX_PENDING or waiting + entry.size > MAX_PENDING_BYTES:
            return False
        last = self._entries[-1] if self._entries else None
        if last and entry.kind.is_replaced and type(last.operation) is type(entry.operation):
            entry.ids = [*last.ids, *entry.ids]
            self._entries.pop()
        self._entries.append(entry)
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
