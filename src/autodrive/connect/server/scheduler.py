"""Decides when the requests of clients are executed: in turns, and within their share of the time."""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable, Iterator
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from autodrive.connect.server.request_queue import BURST, Limits, QueuedOperation, RequestQueue

if TYPE_CHECKING:
    from autodrive.connect.server.connected_client import ConnectedClient


class Turn(NamedTuple):
    """A request that is executed now."""

    client: ConnectedClient
    queue: RequestQueue
    entry: QueuedOperation
    older: tuple[Turn, ...] = ()
    """Requests of other clients that it replaces; its answer is also theirs."""

    @property
    def answers(self) -> Iterator[tuple[ConnectedClient, int]]:
        """Each client that gets the answer, and the id of its request."""
        return ((turn.client, id) for turn in (self, *self.older) for id in turn.entry.ids)


class Scheduler:
    """Calls `begin` for each request when it is executed; the caller calls `end` after that. It knows no messages.

    While time runs (`is_paused()` is False), edits of a map use at most `SHARE` of the time, and so do other builds and
    short requests, those of a client and those of all clients together. The types of operations take turns: however
    many clients build, a request of another type is executed soon. Of each type the clients take turns; one that
    connects again waits like the others. The simulation has one build and one short request at a time.
    """

    def __init__(self, begin: Callable[[Turn], None], is_paused: Callable[[], bool]) -> None:
        self._begin = begin
        self._is_paused = is_paused
        self._queues: dict[ConnectedClient, RequestQueue] = {}
        """The queue of each client; the client whose turn is next comes first."""
        self._limits = Limits(BURST)
        self._turns: dict[type, int] = {}
        """Type of operation -> number of its latest turn."""
        self._count = count(1)
        self._busy: set[bool] = set()
        """What the simulation executes: True: a build, False: a short request."""
        self._timer: asyncio.Handle | None = None

    def add(self, client: ConnectedClient, entry: QueuedOperation) -> bool:
        """Execute a request after the earlier ones of this client. Returns False if too many of them are waiting."""
        if entry.kind.is_beside:
            self._begin(Turn(client, RequestQueue(), entry))
            return True
        queue = self._queues.setdefault(client, RequestQueue())
        was_idle = queue.is_idle
        if not queue.add(entry):
            return False
        if was_idle:
            self._execute_next()
        return True

    def forget(self, client: ConnectedClient) -> None:
        """The client disconnected: requests that wait are dropped."""
        self._queues.pop(client, None)

    def end(self, turn: Turn) -> None:
        """The request was executed: choose the time of the client's next one, and execute the next request soon."""
        now, entry, kind = time.perf_counter(), turn.entry, turn.entry.kind
        is_limited = kind.is_limited and not self._is_paused()
        for ended in (turn, *turn.older):
            ended.queue.is_busy = False
            if is_limited:
                took = now - entry.started if kind.is_of_server or kind.is_build else entry.work  # with its scene files
                ended.queue.limits.pay(kind, max(took, kind.least_work), now)
        if not kind.is_of_server:
            self._busy.discard(kind.is_build)
            if is_limited:
                self._limits.pay(kind, entry.work, now)
        self._stop_timer()  # in a new turn of the event loop, so that many short requests do not nest
        self._timer = asyncio.get_running_loop().call_soon(self._execute_next)

    def _execute_next(self) -> None:
        """Execute what may be executed now: the clients in turn, and one operation of the simulation at a time."""
        self._stop_timer()
        now = time.perf_counter()  # exact: the time of the event loop stands still during a turn
        earliest = math.inf
        for client, queue, _ in sorted(self._waiting(), key=lambda waiting: self._turns.get(type(waiting[2]), 0)):
            if (entry := queue.next) is None:  # it was executed with a request of another client
                continue
            free_at = queue.limits.free_at(entry.kind)
            if not entry.kind.is_of_server:
                if entry.kind.is_build in self._busy:
                    continue
                if not self._is_paused():
                    free_at = max(free_at, self._limits.free_at(entry.kind))
            if now < free_at:
                earliest = min(earliest, free_at)
                continue
            self._queues[client] = self._queues.pop(client)  # next time it is the turn of the others
            self._turns[type(entry.operation)] = next(self._count)
            turn = self._turn(client, queue, now)
            if not entry.kind.is_of_server:
                self._busy.add(entry.kind.is_build)
            self._begin(turn)
        if earliest < math.inf:
            self._timer = asyncio.get_running_loop().call_later(earliest - now, self._execute_next)

    def _waiting(self) -> list[tuple[ConnectedClient, RequestQueue, object]]:
        """Each client whose next request can be executed, its queue, and the operation."""
        return [(client, queue, entry.operation) for client, queue in self._queues.items() if (entry := queue.next)]

    def _turn(self, client: ConnectedClient, queue: RequestQueue, now: float) -> Turn:
        """The next request of a client, or the newest one if several clients wait for a request that is common."""
        turn = Turn(client, queue, queue.take(now))
        if not turn.entry.kind.is_common:
            return turn
        same = type(turn.entry.operation)
        waiting = [(client, queue) for client, queue, operation in self._waiting() if type(operation) is same]
        turns = [turn, *(Turn(client, queue, queue.take(now)) for client, queue in waiting)]
        *older, newest = sorted(turns, key=lambda turn: turn.entry.number)
        return newest._replace(older=tuple(older))

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
