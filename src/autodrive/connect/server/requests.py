"""Executes client requests: simulation operations, scene cameras and control of the devkit bridge."""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import CancelledError, Future
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

from autodrive.base.errors import AutodriveError
from autodrive.base.specs import joined
from autodrive.base.suggest import suggest
from autodrive.connect.server.driving import taken
from autodrive.connect.server.request_queue import (
    BURST,
    MAX_PENDING,
    MAX_PENDING_BYTES,
    Limits,
    QueuedOperation,
    RequestQueue,
)
from autodrive.protocol.messages import (
    AddBox,
    Frame,
    LoadScenario,
    Operation,
    Pause,
    Place,
    Reset,
    Resume,
    SaveMap,
    SaveScenario,
    SetSceneLight,
    SetSpeed,
    SetTimeOfDay,
    SetWeather,
    Step,
    UseMap,
    Weather,
)
from autodrive.protocol.native import (
    ConnectBridge,
    DescribeVehicle,
    DescribeWeather,
    DisconnectBridge,
    Error,
    Request,
    SetCamera,
    ViewSensor,
)
from autodrive.protocol.own_files import ExportMap, ImportTrack, ListFiles, OpenFile, OwnFile, SaveFile
from autodrive.protocol.replay import Curve, PlotRecording, SaveRecording, StartRecording, StopRecording
from autodrive.world.editing.edits import edited
from autodrive.world.editing.map_export import exported_map
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
OF_SERVER = (
    ConnectBridge,
    DisconnectBridge,
    SetCamera,
    ViewSensor,
    StartRecording,
    StopRecording,
    SaveRecording,
    PlotRecording,
    DescribeVehicle,
    ListFiles,
    SaveFile,
    ExportMap,
)
"""Operations of the server; all others are operations of the simulation, which executes one at a time."""
SHARED = {
    SetWeather: "changed the weather",
    SetTimeOfDay: "changed the time of day",
    SetSceneLight: "changed the light",
    SetSpeed: "changed the speed",
    Pause: "paused the simulation",
    Resume: "resumed the simulation",
    Reset: "reset the simulation",
    LoadScenario: "loaded a scenario",
    OpenFile: "opened a file",
    UseMap: "opened another map",
}
"""Operations that change what all clients see, and what the others are told."""
LEAST_WORK = {ConnectBridge: 0.05, SetCamera: 0.004, ViewSensor: 0.004, StartRecording: 0.05}
"""Operations that cause work elsewhere count as if they took this time [s]."""
NOT_PAUSED = "a Step needs a paused simulation; request Pause first"


class Answer(NamedTuple):
    """What a Response has besides its Frame."""

    text: str = ""
    curves: dict[str, Curve] = {}  # noqa: RUF012  nobody changes it
    files: dict[str, OwnFile] = {}  # noqa: RUF012  nobody changes it
    picture: bytes = b""


NO_ANSWER = Answer()


class Turn(NamedTuple):
    """A request that is executed now."""

    client: ConnectedClient
    queue: RequestQueue
    entry: QueuedOperation
    older: tuple[Turn, ...] = ()
    """Requests of other clients that it replaces; its answer is also theirs."""


class Requests:
    """Used in the server's event loop. `on_change` is called when the Status changes.

    While time runs, edits of a map use at most `SHARE` of the time, and so do other builds and short requests, those of
    a client and those of all clients together. The kinds of operations take turns: however many clients build, a
    request of another kind is executed soon. In each kind the clients take turns; one that connects again waits like
    the others. The simulation has one build and one short request at a time.
    """

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
        """The latest of the `SHARED` operations and who requested it, for the Status, and their number."""
        self._simulation = served.simulation
        self._broadcast = broadcast
        self._frame_queue = broadcast.queue
        self._leases = leases
        self._bridge = bridge
        self._scenarios = served.scenarios
        self._recording = served.recording
        self._replay = served.replay
        self._own_files = served.own_files
        self._refusal = served.refusal
        self._recording_lock = asyncio.Lock()
        self._weather_lock = asyncio.Lock()
        self._described: tuple[object, str] = (None, "")
        """The weather, ground and light that were described last, and the text."""
        self._on_change = on_change
        self._clock = clock
        self._queues: dict[ConnectedClient, RequestQueue] = {}
        """The queue of each client; the client whose turn is next comes first."""
        self._limits = Limits(BURST)
        self._turns: dict[type, int] = {}
        """Kind of operation -> number of its latest turn."""
        self._count = count(1)
        self._busy: set[bool] = set()
        """What the simulation executes: True: a build, False: a short request."""
        self._timer: asyncio.Handle | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    def execute(self, client: ConnectedClient, request: Request, size: int = 0) -> bool:
        """Execute a request after the earlier ones of this client; its Response or Error follows.

        `size` of its message [bytes].

        Returns False if the request is refused because too many are waiting.
        """
        queue = self._queues.setdefault(client, RequestQueue())
        was_idle = queue.is_idle
        if error := self._refusal(request.operation) or self._unknown(request.operation):
            client.send_error(Error("request", error, request.id))
        elif isinstance(request.operation, DescribeWeather):
            self._describe_weather(client, request.id)
        elif not queue.add(request, size):
            text = (
                f"more than {MAX_PENDING} requests, or {MAX_PENDING_BYTES >> 20} MiB, are pending: wait for a Response"
            )
            client.send_error(Error("rate", text, request.id))
            return False
        elif was_idle:
            self._execute_next()
        return True

    def forget(self, client: ConnectedClient) -> None:
        """The client disconnected: requests that wait are dropped."""
        if queue := self._queues.pop(client, None):
            queue.clear()

    def _execute_next(self) -> None:
        """Execute what may be executed now: the clients in turn, and one operation of the simulation at a time."""
        self._stop_timer()
        now = time.perf_counter()  # exact: the time of the event loop stands still during a turn
        earliest = math.inf
        waiting = [(client, queue) for client, queue in self._queues.items() if queue.next]
        for client, queue in sorted(waiting, key=lambda client_and_queue: self._latest_turn(client_and_queue[1])):
            if (entry := queue.next) is None:  # it was executed with a request of another client
                continue
            free_at = queue.limits.of(entry.operation).free_at
            if not isinstance(entry.operation, OF_SERVER):
                if entry.is_build in self._busy:
                    continue
                if not self._simulation.is_paused:
                    free_at = max(free_at, self._limits.of(entry.operation).free_at)
            if now < free_at:
                earliest = min(earliest, free_at)
                continue
            self._queues[client] = self._queues.pop(client)  # next time it is the turn of the others
            self._turns[type(entry.operation)] = next(self._count)
            self._begin(self._turn(client, queue, now))
        if earliest < math.inf:
            self._timer = asyncio.get_running_loop().call_later(earliest - now, self._execute_next)

    def _latest_turn(self, queue: RequestQueue) -> int:
        """Number of the latest turn of the kind of its next operation; 0: there was none."""
        return self._turns.get(type(queue.next.operation), 0) if queue.next else 0

    def _turn(self, client: ConnectedClient, queue: RequestQueue, now: float) -> Turn:
        """The next request of a client, or the newest LoadScenario if that is what several clients wait for."""
        turn = Turn(client, queue, queue.take(now))
        if not isinstance(turn.entry.operation, LoadScenario):
            return turn
        waiting = [
            (who, queue)
            for who, queue in self._queues.items()
            if queue.next and isinstance(queue.next.operation, LoadScenario)
        ]
        turns = [turn, *(Turn(who, queue, queue.take(now)) for who, queue in waiting)]
        *older, newest = sorted(turns, key=lambda turn: turn.entry.number)
        return newest._replace(older=tuple(older))

    def _execute_soon(self) -> None:
        """Execute the next request in a new turn of the event loop, so that many short Steps do not nest."""
        self._stop_timer()
        self._timer = asyncio.get_running_loop().call_soon(self._execute_next)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _begin(self, turn: Turn) -> None:
        try:
            match turn.entry.operation:
                case ConnectBridge(host=host, port=port):
                    self._start(turn, lambda: _no_answer(self._bridge.connect(host, port)))
                case DisconnectBridge():
                    self._start(turn, lambda: _no_answer(self._bridge.disconnect()))
                case StartRecording() | StopRecording() | SaveRecording() as operation:
                    self._start(turn, lambda: self._record(operation))
                case ListFiles() | SaveFile() | ExportMap() as operation:
                    self._start(turn, lambda: asyncio.to_thread(self._file_answer, operation))
                case DescribeVehicle(vehicle=vehicle):
                    self._start(turn, lambda: asyncio.to_thread(self._described_vehicle, vehicle))
                case PlotRecording() as plot:
                    self._start(turn, lambda: self._plot(plot))
                case SetCamera() | ViewSensor() as view:
                    self._broadcast.remote_views.set_view(turn.client, view, self._clock())
                    self._respond(turn, self._broadcast.latest)
                case LoadScenario() | AddBox() | ImportTrack() | OpenFile() as operation:
                    self._busy.add(turn.entry.is_build)
                    if isinstance(operation, LoadScenario):
                        self.note = f"loading the scenario {self._scenarios[operation.name] or operation.name}"
                        self._on_change()
                    self._keep(asyncio.create_task(self._submit_prepared(turn, operation)))
                case DescribeWeather():
                    raise AssertionError("it is answered beside the queue")
                case operation:
                    self._busy.add(turn.entry.is_build)
                    self._submit(turn, operation)
        except Exception as error:
            self._refuse(turn, error)

    def _respond(self, turn: Turn, frame: Frame, answer: Answer = NO_ANSWER) -> None:
        try:
            for answered in (turn, *turn.older):
                for id in answered.entry.ids:
                    answered.client.respond(id, frame, *answer)
        except Exception as error:  # it cannot be encoded
            self._refuse(turn, error)
            return
        if text := SHARED.get(type(turn.entry.operation)):
            self.change, self.changes = f"{turn.client.name} has {text}", self.changes + 1
            self._on_change()
        self._end(turn)

    def _refuse(self, turn: Turn, error: BaseException) -> None:
        if not isinstance(error, AutodriveError | _TakenError):
            log.error("server: a %s failed", type(turn.entry.operation).__name__, exc_info=error)
        code = "taken" if isinstance(error, _TakenError) else "request"
        try:
            for refused in (turn, *turn.older):
                for id in refused.entry.ids:
                    refused.client.send_error(Error(code, str(error), id))
        finally:
            self._end(turn)

    def _end(self, turn: Turn) -> None:
        """The request was executed: choose the time of the client's next one."""
        now, entry = time.perf_counter(), turn.entry
        is_of_server = isinstance(entry.operation, OF_SERVER)
        is_limited = not isinstance(entry.operation, Step) and not self._simulation.is_paused
        for ended in (turn, *turn.older):
            ended.queue.is_busy = False
            if is_limited:
                took = now - entry.started if is_of_server or entry.is_build else entry.work  # with its scene files
                work = max(took, LEAST_WORK.get(type(entry.operation), 0.0))
                ended.queue.limits.pay(entry.operation, work, now)
        if is_limited and not is_of_server:
            self._limits.pay(entry.operation, entry.work, now)
        if isinstance(entry.operation, LoadScenario):
            self.note = ""
            self._on_change()
        if not is_of_server:
            self._busy.discard(entry.is_build)
        self._execute_soon()

    def _unknown(self, operation: ServerOperation) -> str:
        """The error for a scenario that is not known; empty if it is, or if none is to be loaded."""
        if not isinstance(operation, LoadScenario) or operation.name in self._scenarios:
            return ""
        return f"scenario '{operation.name}' is not known. {suggest(operation.name, list(self._scenarios))}"

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
        if self._replay is not None:  # it refuses them
            return operation if isinstance(operation, LoadScenario | AddBox) else UseMap("a file"), ""
        if isinstance(operation, ImportTrack):
            return imported_track(operation)
        if isinstance(operation, OpenFile):
            operation = self._own_files.opened(operation, self._simulation.world)
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
        if isinstance(operation, Step):
            self._check_step(turn.client, operation)
        prepared = time.perf_counter() - turn.entry.started
        future = self._simulation.request(operation, here=True)
        if isinstance(operation, Step):
            self._frame_queue.steps += 1

        def note_work(_: Future[Frame]) -> None:
            turn.entry.work = prepared + time.perf_counter() - future.began

        def reply(done: Future[Frame]) -> None:
            if isinstance(operation, Step):
                self._frame_queue.steps -= 1
            else:
                self._on_change()
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
            raise AutodriveError(f"a requested Step has at most {MAX_TICKS} ticks, not {step.ticks}: request several")
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

    def _start(self, turn: Turn, work: Callable[[], Awaitable[Answer]]) -> None:
        """Let the server work on a request, and respond after that."""
        if len(self._tasks) >= MAX_PENDING:
            raise AutodriveError("too many clients connect the bridge, record or plot at the same time")

        async def execute() -> None:
            try:
                answer = await work()
            except Exception as error:
                self._refuse(turn, error)
            else:
                self._respond(turn, self._broadcast.latest, answer)
            self._on_change()

        self._keep(asyncio.create_task(execute()))

    def _keep(self, task: asyncio.Task[None]) -> None:
        """The event loop itself keeps no reference to a task."""
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _record(self, operation: StartRecording | StopRecording | SaveRecording) -> Answer:
        async with self._recording_lock:
            match operation:
                case StartRecording(keep=keep):
                    await asyncio.to_thread(self._recording.start, keep)
                    return NO_ANSWER
                case StopRecording():
                    return Answer(await asyncio.to_thread(self._recording.stop))
                case SaveRecording():
                    return Answer(await asyncio.to_thread(self._recording.save))

    def _describe_weather(self, client: ConnectedClient, id: int) -> None:
        """Beside the queue: the first answer takes a second, for which the next weather must not wait."""
        if len(self._tasks) >= MAX_PENDING:
            client.send_error(Error("rate", "too many requests are pending: wait for a Response", id))
            return

        async def answer() -> None:
            async with self._weather_lock:
                try:
                    text = await asyncio.to_thread(self._weather_text, self._broadcast.latest)
                    client.respond(id, self._broadcast.latest, *Answer(text))
                except Exception as error:
                    log.exception("server: a weather could not be described")
                    client.send_error(Error("request", str(error), id))

        self._keep(asyncio.create_task(answer()))

    def _weather_text(self, frame: Frame) -> str:
        """Text of the weather in numbers; made in another thread, one at a time, and once for each weather."""
        from autodrive.world.views.weather_numbers import weather_numbers  # noqa: PLC0415  it imports the batch

        is_day = None if frame.time_of_day is None else frame.scene_light
        weather, ground = frame.weather or Weather(), self._simulation.world.map.ground
        if (weather, ground, is_day) != self._described[0]:
            self._described = (weather, ground, is_day), weather_numbers(weather, ground, is_day=is_day)
        return self._described[1]

    def _file_answer(self, operation: ListFiles | SaveFile | ExportMap) -> Answer:
        """The answer to a request for files, made in another thread: the world that it sees is the present one."""
        match operation:
            case ListFiles():
                return Answer(files=self._own_files.listed())
            case SaveFile(name=name, kind=kind, title=title, replaces=replaces):
                simulation = self._simulation
                text = simulation.map_text(title) if kind == "map" else simulation.scenario_text(title)
                return Answer(self._own_files.save(name, text, replaces=replaces))
            case ExportMap(name=name, resolution=resolution):
                text, picture = exported_map(self._simulation.world.map, name, resolution)
                return Answer(text, picture=picture)

    def _described_vehicle(self, name: str) -> Answer:
        """The answer with the URDF of a vehicle, made in another thread."""
        from autodrive.world.views.scene_files import vehicle_urdf  # noqa: PLC0415  imports what draws meshes

        world = self._simulation.world
        if name not in world.vehicle_specs:
            raise AutodriveError(f"vehicle '{name}' is not known. {suggest(name, list(world.vehicle_specs))}")
        return Answer(vehicle_urdf(world, name))

    async def _plot(self, request: PlotRecording) -> Answer:
        if self._replay is None:
            raise AutodriveError("a simulation has no recording to plot: use 'autodrive replay FILE'")
        curves, missing = await asyncio.to_thread(self._replay.curves, request)
        return Answer(missing, curves)


async def _no_answer(work: Awaitable[None]) -> Answer:
    await work
    return NO_ANSWER


class _TakenError(Exception):
    """Another client drives the vehicle."""
