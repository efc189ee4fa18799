"""Executes client requests: simulation operations, scene cameras and control of the devkit bridge."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from concurrent.futures import Future
from typing import TYPE_CHECKING, Literal

from autodrive.errors import AutodriveError
from autodrive.protocol.messages import Frame, LoadScenario, Operation, SaveScenario, Step
from autodrive.protocol.native import ConnectBridge, DisconnectBridge, Error, Request, SetCamera
from autodrive.scenario import scenario_text
from autodrive.server.driving import taken
from autodrive.server.request_queue import MAX_PENDING, Entry, RequestQueue
from autodrive.specs import suggest

if TYPE_CHECKING:
    from autodrive.server.bridge_control import BridgeControl
    from autodrive.server.connected_client import ConnectedClient
    from autodrive.server.driver_lease import DriverLeases
    from autodrive.server.frame_queue import FrameQueue
    from autodrive.server.remote_view import RemoteViews
    from autodrive.simulation import Simulation

MAX_TICKS = 10_000
"""Longest Step."""
REST = 4.0
"""While time runs, a client's next request waits for this multiple of the time that the last one took, and longer if
other clients request something as well: all requests together use at most a fifth of the time."""
LEAST_WORK = {ConnectBridge: 0.05, SetCamera: 0.004}
"""Operations that cause work elsewhere count as if they took this time [s]."""
NOT_PAUSED = "a Step needs a paused simulation; request Pause first"


class Requests:
    """Used in the server's event loop. `on_change` is called when the Status changes."""

    def __init__(
        self,
        simulation: Simulation,
        frame_queue: FrameQueue,
        leases: DriverLeases,
        bridge: BridgeControl,
        remote_views: RemoteViews,
        *,
        scenarios: dict[str, str],
        on_change: Callable[[], None],
        clock: Callable[[], float],
    ) -> None:
        self.note = ""
        """A long operation that runs now, for the Status."""
        self._simulation = simulation
        self._frame_queue = frame_queue
        self._leases = leases
        self._bridge = bridge
        self._remote_views = remote_views
        self._scenarios = scenarios
        self._on_change = on_change
        self._clock = clock
        self._queues: dict[ConnectedClient, RequestQueue] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def execute(self, client: ConnectedClient, request: Request) -> None:
        """Execute a request after the earlier ones of this client; its Response or Error follows."""
        queue = self._queues.setdefault(client, RequestQueue())
        if isinstance(request.operation, LoadScenario) and (error := self._unknown(request.operation.name)):
            client.send_error(Error("request", error, request.id))
        elif queue.add(request):
            self._execute_next(client, queue)
        else:
            text = f"more than {MAX_PENDING} requests are pending: wait for a Response"
            client.send_error(Error("rate", text, request.id))

    def forget(self, client: ConnectedClient) -> None:
        """The client disconnected: requests that wait are dropped."""
        if queue := self._queues.pop(client, None):
            queue.clear()

    def _execute_next(self, client: ConnectedClient, queue: RequestQueue) -> None:
        now = time.perf_counter()  # exact: the time of the event loop stands still during a turn
        entry = queue.take(now)
        if entry is None:
            if queue and not queue.is_busy and not queue.is_scheduled:
                queue.is_scheduled = True
                asyncio.get_running_loop().call_later(queue.free_at - now, self._execute_scheduled, client, queue)
            return
        try:
            match entry.operation:
                case ConnectBridge(host=host, port=port):
                    self._bridge.connect(host, port)
                    self._on_change()
                    self._respond(client, queue, entry, self._simulation.frame)
                case DisconnectBridge():
                    self._start(self._disconnect(client, queue, entry))
                case SetCamera() as view:
                    self._remote_views.set_view(client, view, self._clock())
                    self._respond(client, queue, entry, self._simulation.frame)
                case operation:
                    self._submit(client, queue, entry, operation)
        except AutodriveError as error:
            self._refuse(client, queue, entry, "request", str(error))
        except _TakenError as error:
            self._refuse(client, queue, entry, "taken", str(error))

    def _execute_scheduled(self, client: ConnectedClient, queue: RequestQueue) -> None:
        queue.is_scheduled = False
        self._execute_next(client, queue)

    def _respond(
        self, client: ConnectedClient, queue: RequestQueue, entry: Entry, frame: Frame, text: str = ""
    ) -> None:
        for id in entry.ids:
            client.respond(id, frame, text)
        self._end(client, queue, entry)

    def _refuse(
        self, client: ConnectedClient, queue: RequestQueue, entry: Entry, code: Literal["request", "taken"], text: str
    ) -> None:
        for id in entry.ids:
            client.send_error(Error(code, text, id))
        self._end(client, queue, entry)

    def _end(self, client: ConnectedClient, queue: RequestQueue, entry: Entry) -> None:
        """The request was executed: choose the time of the client's next one."""
        now = time.perf_counter()
        queue.is_busy = False
        if not isinstance(entry.operation, Step) and not self._simulation.is_paused:
            work = max(now - entry.started, LEAST_WORK.get(type(entry.operation), 0.0))
            active = sum(bool(other) or other is queue for other in self._queues.values())
            queue.free_at = now + REST * work * max(active, 1)
        if queue:  # in a new turn of the event loop, so that many short Steps do not nest
            asyncio.get_running_loop().call_soon(self._execute_next, client, queue)

    def _unknown(self, name: str) -> str:
        """The error for a scenario that is not known; empty if it is."""
        known = list(self._scenarios)
        return "" if name in known else f"scenario '{name}' is not known. {suggest(name, known)}"

    def _submit(self, client: ConnectedClient, queue: RequestQueue, entry: Entry, operation: Operation) -> None:
        """Pass an operation to the simulation."""
        if isinstance(operation, Step):
            self._check_step(client, operation)
        future = self._simulation.request(operation, here=True)
        self._on_submitted(operation)

        def reply(done: Future[Frame]) -> None:
            self._on_done(operation)
            if done.cancelled():
                self._refuse(client, queue, entry, "request", "the simulation has ended")
            elif error := done.exception():
                self._refuse(client, queue, entry, "request", str(error))
            else:
                self._respond(client, queue, entry, done.result(), self._text(operation))

        self._frame_queue.call_when_done(future, reply)
        if future.done():
            self._frame_queue.deliver()

    def _text(self, operation: Operation) -> str:
        """The text of the Response: the scenario as it is now, for a `SaveScenario`."""
        if not isinstance(operation, SaveScenario):
            return ""
        world = self._simulation.world
        return scenario_text(world.spec.model_copy(update={"scene_light": world.scene_light}))

    def _check_step(self, client: ConnectedClient, step: Step) -> None:
        if not self._simulation.is_paused:
            raise AutodriveError(NOT_PAUSED)
        if step.ticks > MAX_TICKS:
            raise AutodriveError(f"a requested Step has at most {MAX_TICKS} ticks, not {step.ticks}: request several")
        now = self._clock()
        drivers = self._leases.drivers(now)
        for vehicle in step.commands:
            if drivers.get(vehicle, client) is not client:
                raise _TakenError(taken(vehicle, drivers[vehicle]))
        for vehicle in step.commands:
            self._leases.acquire(vehicle, client, "script", None, now)
            if vehicle not in drivers:
                self._on_change()

    def _on_submitted(self, operation: Operation) -> None:
        match operation:
            case Step():
                self._frame_queue.steps += 1
            case LoadScenario(name=name):
                self.note = f"loading the scenario {self._scenarios[name] or name}"
                self._on_change()
            case _:
                pass

    def _on_done(self, operation: Operation) -> None:
        match operation:
            case Step():
                self._frame_queue.steps -= 1
                return
            case LoadScenario():
                self.note = ""
            case _:
                pass
        self._on_change()

    async def _disconnect(self, client: ConnectedClient, queue: RequestQueue, entry: Entry) -> None:
        try:
            await self._bridge.disconnect()
        except AutodriveError as error:
            self._refuse(client, queue, entry, "request", str(error))
        else:
            self._respond(client, queue, entry, self._simulation.frame)
        self._on_change()

    def _start(self, work: Coroutine[object, object, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


class _TakenError(Exception):
    """Another client drives the vehicle."""
