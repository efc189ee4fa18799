"""Runs a World at a pace, in the thread of the caller or in a thread of its own."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, get_args

from autodrive.base.errors import CommandError, EngineError, SensorError
from autodrive.base.pace import TickPace
from autodrive.protocol.commands import check_commands, is_number
from autodrive.protocol.messages import (
    AddBox,
    CloseLoop,
    Command,
    EditMap,
    EditTrack,
    Frame,
    GenerateTrack,
    InsertModule,
    LoadScenario,
    Operation,
    Pause,
    Place,
    Redo,
    RemoveBox,
    RemoveTraffic,
    Reset,
    Resume,
    Retire,
    SaveMap,
    SaveScenario,
    SetDrivingMode,
    SetSensor,
    SetSpeed,
    Step,
    Undo,
    UseMap,
)
from autodrive.protocol.native import Source
from autodrive.world.editing.editor import Editor
from autodrive.world.observer import Observer
from autodrive.world.simulation.checks import check_driven, check_request, check_speed, check_world
from autodrive.world.simulation.paced import Call, Execution, Paced

if TYPE_CHECKING:
    from autodrive.scenario.descriptions import Descriptions
    from autodrive.world import World
    from autodrive.world.simulation.clock import Clock

NO_COMMANDS: Mapping[str, Command] = {}

SOURCES: tuple[Source, ...] = get_args(Source)

log = logging.getLogger(__name__)

SHORT = 10
"""A Step of at most this many ticks may run in the thread of the caller."""

IMAGE_POLL_PERIOD = 0.01
"""A paused World is asked this often for images that are still being rendered [s]."""


class Simulation(Paced):
    """One World at a time, ticking in real time, at another speed, or as fast as it can.

    `speed` is simulated seconds per wall second, None for as fast as possible. `load` makes the World of a scenario: by
    name for `LoadScenario`, by Spec for edits; it raises `AutodriveError` if it cannot. With `pause_on_error` an
    `EngineError` or `SensorError` pauses the simulation and is kept in `error`, and an unexpected error of a request is
    logged; otherwise both end the run. `clock` replaces the wall clock, for tests. All methods may be called from any
    thread; only one thread at a time uses the World: the simulation's own, except for Steps that run `here`.
    """

    def __init__(
        self,
        world: World,
        *,
        speed: float | None = 1.0,
        is_paused: bool = False,
        load: Callable[[str | Descriptions], World] | None = None,
        pause_on_error: bool = False,
        clock: Clock | None = None,
    ) -> None:
        check_speed(speed)
        check_world(world, type(self).__name__)
        super().__init__(world.frame, clock=clock, is_paused=is_paused, keeps_running=pause_on_error)
        self.world = world
        self.error = ""
        """Why the physics cannot continue; empty if it can. A Reset or another scenario clears it."""
        world.watch_sensors(self._clock.now)
        self._load = load
        self._editor = Editor(load)
        self._pace = TickPace(world.tick_duration, speed)
        self._observers: tuple[Observer, ...] = ()
        self._commands: dict[tuple[str, Source], Command] = {}
        self._renewable: dict[str, Command] = {}
        """The last command of a script, by vehicle."""
        self._prepared: dict[str, World] = {}
        """The World that `prepare` has made, by scenario."""
        self._world_lock = threading.Lock()
        """Held by the thread that uses the World; taken before the mailbox's lock, never after. The thread of the
        simulation releases it while it sleeps in a pause."""

    # -- state ------------------------------------------------------------------------------------------

    @property
    def speed(self) -> float | None:
        """Target of simulated seconds per wall second; None is as fast as possible."""
        return self._pace.speed

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per wall second, measured over about the last second; 0 before the first measurement."""
        return self._pace.real_time_factor

    @property
    def ticks(self) -> int:
        """Ticks run by this Simulation; a Reset does not change the count."""
        return self._pace.ticks

    @property
    def late_ticks(self) -> int:
        """Ticks that ran more than the duration of a tick too late."""
        return self._pace.late_ticks

    @property
    def simulated_time(self) -> float:
        """Simulated time that this Simulation has run [s]; a Reset does not change it."""
        return self._pace.simulated_time

    @property
    def running_time(self) -> float:
        """Wall time spent running, without pauses [s]."""
        return self._pace.running_time(self._clock.now())

    @property
    def undo_name(self) -> str:
        """The edit that an `Undo` reverts, for example 'place V1'; empty if there is none."""
        return self._editor.undo_name

    @property
    def redo_name(self) -> str:
        """The edit that a `Redo` makes again; empty if there is none."""
        return self._editor.redo_name

    # -- commands, requests and sinks ---------------------------------------------------------------------------

    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        """Set the command for the next tick; the latest of each source wins. Raises `CommandError`.

        The vehicle obeys it only if its driving mode selects this source at that tick.
        """
        check_driven(vehicle, self._frame)
        check_commands({vehicle: command})
        if source not in SOURCES:
            raise CommandError(f"the source of a command must be 'person' or 'script', not {source!r}")
        with self._mailbox:
            self._commands[vehicle, source] = command
            if source == "script":
                self._renewable[vehicle] = command

    def renew(self, vehicle: str, command: Command) -> None:
        """Drive one more tick with the command that was submitted last; see `Control.renew`.

        Headlights and indicators stay as they are.
        """
        with self._mailbox:
            if self._renewable.get(vehicle) is command:
                self._commands.setdefault((vehicle, "script"), Command(command.throttle, command.steering))

    def _end_renewal(self, vehicles: Iterable[str] | None = None) -> None:
        """The last commands of scripts, to these vehicles or to all, are not renewed any more."""
        with self._mailbox:
            for vehicle in list(self._renewable) if vehicles is None else vehicles:
                self._renewable.pop(vehicle, None)

    def request(self, request: Operation, *, here: bool = False) -> Execution:
        """Execute a request before the next tick, in the order of the calls. Raises `CommandError`.

        The result of the Future is the Frame after the request. `here`: a short Step of a paused simulation may run in
        the thread of the caller, including the sinks, which avoids two thread switches.
        """
        check_request(request, self._frame, error=self.error, can_load=self._load is not None)
        done = Execution()
        if here and isinstance(request, Step) and request.ticks <= SHORT and self._step_here(request, done):
            return done
        return self._post(request, done)

    def _step_here(self, step: Step, done: Execution) -> bool:
        """Returns False if another thread uses the World or other requests are waiting."""
        if not self._world_lock.acquire(blocking=False):
            return False
        try:
            is_free = self.is_running and self.is_paused and not self._requests and not self._is_stopping
            if not is_free or self.world.belongs_to_thread:
                return False
            try:
                self._execute(step)
            except Exception as error:
                done.set_exception(error)
            else:
                done.set_result(self._frame)
            return True
        finally:
            self._world_lock.release()

    def add_observer(self, observer: Observer) -> None:
        """Tell `observer` the Frames, the commands of each tick and the requests, in their order."""
        with self._mailbox:
            self._observers = (*self._observers, observer)
        self.add_sink(observer)

    def between_ticks(self, function: Callable[[], None]) -> None:
        """Call a function in the thread that uses the World, between two ticks; returns after it."""
        self._call(Call(function))

    def remove_observer(self, observer: Observer) -> None:
        """Tell `observer` nothing more; does nothing if it was not added."""
        with self._mailbox:
            self._observers = tuple(other for other in self._observers if other is not observer)
        self.remove_sink(observer)

    def prepare(self, name: str) -> World | None:
        """Make the World of a scenario in this thread; see `Paced.prepare`.

        It is kept until the `LoadScenario` that asks for it, the next call, or `stop`.
        """
        check_request(LoadScenario(name), self._frame, error=self.error, can_load=self._load is not None)
        assert self._load is not None
        if self.world.belongs_to_thread:
            return None
        world = self._load(name)
        if world.belongs_to_thread:
            world.close()
            return None
        self._forget_prepared()
        self._prepared[name] = world
        return world

    def _forget_prepared(self) -> None:
        for name in list(self._prepared):
            if world := self._prepared.pop(name, None):
                world.close()

    # -- running ------------------------------------------------------------------------------------------------

    def stop(self) -> None:
        """End the run after the current tick. Raises the error that ended the thread early."""
        try:
            super().stop()
        finally:
            self._forget_prepared()

    def run(self, duration: float | None = None) -> Frame:
        """Run in the caller's thread for `duration` simulated seconds (None: until `stop`); the last Frame."""
        ticks = self._ticks_in(duration)
        self._run_here(lambda: self._loop(ticks))
        return self._frame

    def start(self, duration: float | None = None) -> None:
        """Run in a thread of its own for `duration` simulated seconds (None: until `stop`)."""
        ticks = self._ticks_in(duration)
        self._start_thread(lambda: self._loop(ticks), "autodrive-simulation")

    # -- the thread ---------------------------------------------------------------------------------------------

    def _loop(self, ticks: float) -> None:
        end = self._pace.ticks + ticks
        if not self.is_paused:
            self._pace.restart(self._clock.now())
        self._world_lock.acquire()
        try:
            while not self._is_stopping and self._pace.ticks < end:
                self.execute_requests()
                if self._is_due():
                    self._tick_or_pause()
        finally:
            self._world_lock.release()
            self._pace.rest(self._clock.now())

    def _is_due(self) -> bool:
        """Whether to tick now. If not, sleeps until the tick is due, a request arrives or images are to be polled."""
        delay = None if self.is_paused else self._pace.delay(self._clock.now())
        if delay is not None and delay <= 0:
            return True
        if self.is_paused and self.world.is_looking:
            delay = IMAGE_POLL_PERIOD
            if self.world.look() is not self._frame:
                self._publish(self.world.frame)
        with self._world_released() if self.is_paused else contextlib.nullcontext():
            self._sleep(delay)
        return False

    @contextlib.contextmanager
    def _world_released(self) -> Iterator[None]:
        """Other threads may use the World meanwhile."""
        self._world_lock.release()
        try:
            yield
        finally:
            self._world_lock.acquire()

    def _tick(self, step_commands: Mapping[str, Command] = NO_COMMANDS) -> None:
        """Run one tick with the commands of the drivers, and with `step_commands`, which take precedence."""
        with self._mailbox:
            received, self._commands = self._commands, {}
        commands: dict[str, Command] = {}
        for name, vehicle in self._frame.vehicles.items():
            command = received.get((name, "script" if vehicle.is_autonomous else "person"))
            if command is not None:
                commands[name] = command
        if step_commands:
            self._end_renewal(step_commands)
        commands |= step_commands
        for observer in self._observers:
            observer.given(commands)
        self._publish(self.world.step(commands))
        if self._pace.count(self._clock.now()):
            log.warning("cannot keep up with speed %g: simulated time slows down", self.speed)

    def _tick_or_pause(self) -> None:
        try:
            self._tick()
        except (EngineError, SensorError) as error:
            if not self._keeps_running:
                raise
            log.error("%s; the simulation is paused", error)
            self.error = str(error)
            self._execute(Pause())

    def _execute(self, request: Operation) -> None:
        match request:
            case Pause():
                self._is_paused = True
                self._pace.rest(self._clock.now())
            case Resume():
                self._is_paused = False
                self._pace.restart(self._clock.now())
            case Step(ticks=ticks, commands=commands):
                self._step(ticks, commands)
            case LoadScenario(name=name):
                self._load_world(name)
                self.error = ""
            case SetSpeed(factor=factor):
                self._pace.set_speed(factor, self._clock.now())
            case Reset():
                self.world.apply(request)
                self._editor.on_reset()
                self._end_renewal()
                self.error = ""
            case Place() | AddBox() | RemoveBox() | SetSensor() | RemoveTraffic():
                self._use(self._editor.edit(self.world, request))
            case EditMap() | UseMap() | CloseLoop() | InsertModule() | EditTrack() | GenerateTrack():
                self._use(self._editor.edit(self.world, request))
            case Undo():
                self._use(self._editor.undo(self.world))
            case Redo():
                self._use(self._editor.redo(self.world))
            case SaveScenario() | SaveMap():
                pass  # the caller reads the scenario from the world; the request only waits for earlier ones
            case SetDrivingMode(vehicle=vehicle) | Retire(vehicle=vehicle):
                self.world.apply(request)
                self._end_renewal([vehicle])
            case _:
                self.world.apply(request)
        for observer in self._observers:
            observer.executed(request)
        if self.world.frame is not self._frame:
            self._publish(self.world.frame)

    def _step(self, ticks: int, commands: dict[str, Command]) -> None:
        """Run the ticks of a Step. Does nothing while the simulation is not paused."""
        for _ in range(ticks if self.is_paused else 0):
            if self._is_stopping:
                break
            self._tick(commands)
            commands = {}

    def _load_world(self, name: str) -> None:
        """Replace the World by that of another scenario; keeps the World if the other cannot be made."""
        assert self._load is not None
        self._use(self._prepared.pop(name, None) or self._load(name))
        self._editor.forget()
        with self._mailbox:
            self._commands, self._renewable = {}, {}

    def _use(self, world: World) -> None:
        """Run `world` from now on, and close the World before."""
        before, self.world = self.world, world
        if world is not before:
            before.close()
            world.watch_sensors(self._clock.now)
            self._pace.set_tick_duration(world.tick_duration, self._clock.now())

    def _ticks_in(self, duration: float | None) -> float:
        if duration is None:
            return math.inf
        if not (is_number(duration) and duration >= 0):
            raise ValueError(f"duration must be 0 or more seconds, not {duration}")
        return math.ceil(duration / self.world.tick_duration - 1e-6)  # a rounding error must not add a tick
