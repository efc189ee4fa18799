"""Executes client requests: simulation operations, scene cameras and control of the devkit bridge."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Coroutine
from concurrent.futures import CancelledError, Future
from typing import TYPE_CHECKING, Any

from autodrive.base.errors import AutodriveError
from autodrive.base.specs import joined
from autodrive.base.suggest import suggest
from autodrive.connect.server.connected_client import NO_ANSWER, Answer
from autodrive.connect.server.driving import taken
from autodrive.connect.server.operations import ServerOperations
from autodrive.connect.server.request_queue import MAX_PENDING, MAX_PENDING_BYTES, QueuedOperation
from autodrive.connect.server.scheduler import Scheduler, Turn
from autodrive.protocol.messages import (
    AddBox,
    Frame,
    LoadScenario,
    Operation,
    Place,
    SaveMap,
    SaveScenario,
    Step,
    UseMap,
)
from autodrive.protocol.native import Error, Request, SetCamera, ViewSensor
from autodrive.protocol.own_files import ImportTrack, OpenFile
from autodrive.world.editing.edits import edited
from autodrive.world.editing.track_edits import imported_track
from autodrive.world.placement import warnings_about

if TYPE_CHECKING:
    from autodrive.connect.server.bridge_control import BridgeControl
    from autodrive.connect.server.broadcast import Broadcast
    from autodrive.connect.server.connected_client import ConnectedClient
    from autodrive.connect.server.driver_lease import DriverLeases
    from autodrive.connect.server.served import Served
    from autodrive.protocol.native import ServerOperation

log = logging.getLogger(__name__)

MAX_TICKS = 10_000
"""Longest Step."""
NOT_PAUSED = "a Step needs a paused simulation; request Pause first"


class Requests:
    """Used in the server's event loop. `on_change` is called when the Status changes."""

    def __init__(
        self,
        served: Served,
        broadcast: Broadcast,
        leases: DriverLeases,
        bridge: BridgeControl,
        *,
        on_change: Callable[[], None],
        clock: Callable[[], float],
    ) -> None:
        self.note = ""
        """A long operation that runs now, for the Status."""
        self.change, self.changes = "", 0
        """The latest change that all clients see and who requested it, for the Status, and the number of changes."""
        self._served = served
        self._simulation = served.simulation
        self._broadcast = broadcast
        self._frame_queue = broadcast.queue
        self._leases = leases
        self._operations = ServerOperations(served, bridge)
        self._scheduler = Scheduler(self._begin, lambda: self._simulation.is_paused)
        self._on_change = on_change
        self._clock = clock
        self._tasks: set[asyncio.Task[None]] = set()

    def execute(self, client: ConnectedClient, request: Request, size: int = 0) -> bool:
        """Execute a request after the earlier ones of this client; its Response or Error follows.

        `size` of its message [bytes].

        Returns False if the request is refused because too many are waiting.
        """
        operation, id = request.operation, request.id
        if error := self._served.refusal(operation) or self._unknown(operation):
            client.send_error(Error("request", error, id))
        elif not self._scheduler.add(client, QueuedOperation(operation, self._operations.kind(operation), [id], size)):
            text = (
                f"more than {MAX_PENDING} requests, or {MAX_PENDING_BYTES >> 20} MiB, are pending: wait for a Response"
            )
            client.send_error(Error("rate", text, id))
            return False
        return True

    def forget(self, client: ConnectedClient) -> None:
        """The client disconnected: requests that wait are dropped."""
        self._scheduler.forget(client)

    def _unknown(self, operation: ServerOperation) -> str:
        """The error for a scenario that is not known; empty if it is, or if none is to be loaded."""
        scenarios = self._served.scenarios
        if not isinstance(operation, LoadScenario) or operation.name in scenarios:
            return ""
        return f"scenario '{operation.name}' is not known. {suggest(operation.name, list(scenarios))}"

    def _begin(self, turn: Turn) -> None:
        operation = turn.entry.operation
        try:
            if execute := self._operations.table.get(type(operation)):
                if len(self._tasks) >= MAX_PENDING:
                    raise AutodriveError("too many clients connect the bridge, record, plot or ask at the same time")
                self._keep(self._execute_in_server(turn, execute))
            elif isinstance(operation, SetCamera | ViewSensor):
                self._broadcast.remote_views.set_view(turn.client, operation, self._clock())
                self._respond(turn, self._broadcast.latest)
            elif isinstance(operation, LoadScenario | AddBox | ImportTrack | OpenFile):
                if isinstance(operation, LoadScenario):
                    self.note = f"loading the scenario {self._served.scenarios[operation.name] or operation.name}"
                    self._on_change()
                self._keep(self._submit_prepared(turn, operation))
            else:
                self._submit(turn, operation)
        except Exception as error:
            self._refuse(turn, error)

    def _respond(self, turn: Turn, frame: Frame, answer: Answer = NO_ANSWER) -> None:
        try:
            for client, id in turn.answers:
                client.respond(id, frame, answer)
        except Exception as error:  # it cannot be encoded
            self._refuse(turn, error)
            return
        if change := turn.entry.kind.change:
            self.change, self.changes = f"{turn.client.name} has {change}", self.changes + 1
        self._end(turn)

    def _refuse(self, turn: Turn, error: BaseException) -> None:
        if not isinstance(error, AutodriveError | _TakenError):
            log.error("server: a %s failed", type(turn.entry.operation).__name__, exc_info=error)
        code = "taken" if isinstance(error, _TakenError) else "request"
        try:
            for client, id in turn.answers:
                client.send_error(Error(code, str(error), id))
        finally:
            self._end(turn)

    def _end(self, turn: Turn) -> None:
        if isinstance(turn.entry.operation, LoadScenario):
            self.note = ""
        if not isinstance(turn.entry.operation, SetCamera | ViewSensor | Step):  # these do not change the Status
            self._on_change()
        self._scheduler.end(turn)

    # -- operations of the server -------------------------------------------------------------------------------

    async def _execute_in_server(self, turn: Turn, execute: Callable[[Any], Awaitable[Answer | None]]) -> None:
        try:
            answer = await execute(turn.entry.operation)
        except Exception as error:
            self._refuse(turn, error)
        else:
            self._respond(turn, self._broadcast.latest, answer or NO_ANSWER)

    def _keep(self, execution: Coroutine[Any, Any, None]) -> None:
        """Execute a coroutine; the event loop itself keeps no reference to its task."""
        task = asyncio.create_task(execution)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    # -- operations of the simulation ---------------------------------------------------------------------------

    async def _submit_prepared(self, turn: Turn, operation: LoadScenario | AddBox | ImportTrack | OpenFile) -> None:
        """Make what takes long while time goes on in the present World, then pass the operation to the simulation."""
        try:
            self._submit(turn, *await asyncio.to_thread(self._prepare, operation))
        except Exception as error:
            self._refuse(turn, error)

    def _prepare(self, operation: Operation | ImportTrack | OpenFile) -> tuple[Operation, str]:
        """Make a World and its scene, the mesh of a box, or a track; the first one takes seconds.

        Returns the operation of the simulation, and warnings. Raises `AutodriveError`.
        """
        if self._served.replay is not None:  # it refuses them
            return operation if isinstance(operation, LoadScenario | AddBox) else UseMap("a file"), ""
        if isinstance(operation, ImportTrack):
            return imported_track(operation)
        if isinstance(operation, OpenFile):
            operation = self._served.own_files.opened(operation, self._simulation.world)
        if isinstance(operation, LoadScenario):
            if world := self._simulation.prepare(operation.name):
                self._broadcast.prepare(world)
        elif isinstance(operation, AddBox):
            from autodrive.world.views.scene_files import box_file  # noqa: PLC0415  imports what draws meshes

            world = self._simulation.world
            edited(world.spec, world.boxes, operation)
            box_file(operation.size)
        return operation, ""

    def _submit(self, turn: Turn, operation: Operation, warnings: str = "") -> None:
        """Pass an operation to the simulation."""
        is_step = isinstance(operation, Step)
        if is_step:
            self._check_step(turn.client, operation)
        prepared = time.perf_counter() - turn.entry.started
        future = self._simulation.request(operation, here=True)
        self._frame_queue.steps += is_step

        def note_work(_: Future[Frame]) -> None:
            turn.entry.work = prepared + time.perf_counter() - future.began

        def reply(done: Future[Frame]) -> None:
            self._frame_queue.steps -= is_step
            try:
                frame = done.result()
                text = self._text(operation)
            except CancelledError:
                self._refuse(turn, AutodriveError("the simulation has ended"))
            except Exception as error:
                self._refuse(turn, error)
            else:
                self._respond(turn, frame, Answer(text or warnings))

        future.add_done_callback(note_work)
        self._frame_queue.call_when_done(future, reply)
        if future.done():
            self._frame_queue.deliver()

    def _text(self, operation: Operation) -> str:
        """The text of the Response: the scenario or map as it is now, or a warning about a vehicle or box."""
        match operation:
            case SaveScenario(title=title):
                return self._simulation.scenario_text(title)
            case SaveMap(title=title):
                return self._simulation.map_text(title)
            case Place(name=name) | AddBox(name=name):
                return "\n".join(joined(warnings_about(name, self._simulation.world.warnings), {}))
        return ""

    def _check_step(self, client: ConnectedClient, step: Step) -> None:
        if not self._simulation.is_paused:
            raise AutodriveError(NOT_PAUSED)
        if step.ticks > MAX_TICKS:
            raise AutodriveError(
                f"a requested Step has at most {MAX_TICKS} ticks, not {step.ticks}: request several Steps"
            )
        if step.commands.keys() - self._simulation.frame.vehicles.keys():
            return  # the simulation refuses it
        now = self._clock()
        drivers = self._leases.drivers(now)
        for vehicle in step.commands:
            if drivers.get(vehicle, client) is not client:
                raise _TakenError(taken(vehicle, drivers[vehicle]))
        for vehicle in step.commands:
            self._leases.acquire(vehicle, client, "script", None, now)
            if vehicle not in drivers:
                self._on_change()


class _TakenError(Exception):
    """Another client drives the vehicle."""
