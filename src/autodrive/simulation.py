"""Runs a World against the wall clock: mailbox in, pace, pause, sinks out. The only threads, the only wall clock."""

from __future__ import annotations

import contextlib
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING, Protocol

from autodrive.descriptions import suggest
from autodrive.errors import AutodriveError, CommandError
from autodrive.pace import Pace
from autodrive.protocol.messages import (
    Command,
    Frame,
    Headlights,
    Indicators,
    LoadScenario,
    Pause,
    Request,
    Reset,
    Resume,
    SetDrivingMode,
    SetSceneLight,
    SetSpeed,
    Step,
    Teleport,
)
from autodrive.protocol.native import Source

if TYPE_CHECKING:
    from autodrive.world import World

NO_ORDERS: Mapping[str, Command] = {}

log = logging.getLogger(__name__)

SHORT = 10
"""A Step of no more ticks is over before others notice."""

LOOK = 0.01
"""How often a World that stands still is asked for pictures that are still to come [s]."""


class Sink(Protocol):
    """Whoever wants every Frame, for example a recorder or a bridge."""

    def publish(self, frame: Frame) -> None:
        """Take a Frame, in the thread of the simulation: be quick, keep a reference, do the work elsewhere."""


class Simulation:
    """One World at a time, ticking in real time, at another speed, or as fast as it can.

    `speed` is simulated seconds per wall second, None for as fast as possible. `load` makes the World of a scenario's
    name, for `LoadScenario`, and raises `AutodriveError` where it cannot. All methods may be called from any thread;
    only one at a time touches the World: the simulation's own, but for Steps that are carried out `here`.
    """

    def __init__(
        self,
        world: World,
        *,
        speed: float | None = 1.0,
        is_paused: bool = False,
        load: Callable[[str], World] | None = None,
    ) -> None:
        _check_speed(speed)
        self.world = world
        self._load = load
        self._is_paused = is_paused
        self._pace = Pace(world.tick_duration, speed)
        self._frame = world.frame
        self._sinks: tuple[Sink, ...] = ()
        self._commands: dict[tuple[str, Source], Command] = {}
        self._requests: deque[tuple[Request, Future[Frame]]] = deque()
        self._mail = threading.Condition()
        self._turn = threading.Lock()
        """Whoever has it may touch the World; taken before the mailbox's, never after. The simulation's thread lets go
        of it while it sleeps in a pause."""
        self._thread: threading.Thread | None = None
        self._is_stopping = False
        self._error: BaseException | None = None

    # -- what is known ------------------------------------------------------------------------------------------

    @property
    def frame(self) -> Frame:
        """The latest Frame."""
        return self._frame

    @property
    def speed(self) -> float | None:
        """Simulated seconds per wall second that were asked for; None is as fast as possible."""
        return self._pace.speed

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per wall second that were reached during about the last second; 0 before any."""
        return self._pace.real_time_factor

    @property
    def ticks(self) -> int:
        """Ticks done since this Simulation was made; a Reset does not take them back."""
        return self._pace.ticks

    @property
    def late_ticks(self) -> int:
        """Ticks that were done more than a tick's time later than they should have been."""
        return self._pace.late_ticks

    @property
    def simulated_time(self) -> float:
        """Simulated time that has passed here [s]; a Reset does not take it back."""
        return self._pace.simulated_time

    @property
    def running_time(self) -> float:
        """Wall time spent running, without pauses [s]."""
        return self._pace.running_time(time.perf_counter())

    @property
    def is_paused(self) -> bool:
        """Whether simulated time stands still until a Resume."""
        return self._is_paused

    @property
    def is_running(self) -> bool:
        """Whether its thread, or a `run`, is at work (paused counts as at work)."""
        return self._thread is not None

    # -- the mailbox --------------------------------------------------------------------------------------------

    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        """Leave a command for the next tick; the latest of each source wins. Raises `CommandError`.

        It is obeyed only if the vehicle's driving mode names its source at that tick.
        """
        self._check_vehicle(vehicle)
        _check_command(vehicle, command)
        with self._mail:
            self._commands[vehicle, source] = command

    def request(self, request: Request, *, here: bool = False) -> Future[Frame]:
        """Ask for something to be done before the next tick, in the order asked. Raises `CommandError`.

        The result of the Future is the Frame after it was done; nobody needs to wait for it. `here`: a short Step of a
        paused simulation may be carried out in the caller's thread, sinks and all, which spares waking up two threads.
        """
        self._check_request(request)
        done: Future[Frame] = Future()
        if here and isinstance(request, Step) and request.ticks <= SHORT and self._step_here(request, done):
            return done
        with self._mail:
            self._requests.append((request, done))
            self._mail.notify_all()
        return done

    def _step_here(self, step: Step, done: Future[Frame]) -> bool:
        """Whether it could be done: nobody else is at it, or was there before."""
        if not self._turn.acquire(blocking=False):
            return False
        try:
            is_free = self.is_running and self.is_paused and not self._requests and not self._is_stopping
            if not is_free or self.world.belongs_to_thread:
                return False
            try:
                self._carry_out(step)
            except Exception as error:
                done.set_exception(error)
            else:
                done.set_result(self._frame)
            return True
        finally:
            self._turn.release()

    def add_sink(self, sink: Sink) -> None:
        """Give `sink` every Frame from now on. A sink that raises is told to the log and dropped."""
        with self._mail:
            self._sinks = (*self._sinks, sink)

    def remove_sink(self, sink: Sink) -> None:
        """Give `sink` no more Frames; a sink that is not there is no fault."""
        with self._mail:
            self._sinks = tuple(other for other in self._sinks if other is not sink)

    # -- running ------------------------------------------------------------------------------------------------

    def run(self, duration: float | None = None) -> Frame:
        """Run in the caller's thread for `duration` simulated seconds (None: until `stop`); the last Frame."""
        ticks = self._ticks_in(duration)
        self._claim(threading.current_thread())
        try:
            self._loop(ticks)
        finally:
            self._release()
        return self._frame

    def start(self, duration: float | None = None) -> None:
        """Run in a thread of its own for `duration` simulated seconds (None: until `stop`)."""
        ticks = self._ticks_in(duration)
        thread = threading.Thread(target=self._run_thread, args=(ticks,), name="autodrive-simulation", daemon=True)
        self._claim(thread)
        thread.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the run ends; False if `timeout` [s] came first. Raises what ended the thread early."""
        with self._mail:
            if self._thread is not threading.current_thread():
                self._mail.wait_for(lambda: self._thread is None, timeout)
            error, self._error = self._error, None
        if error is not None:
            raise error
        return not self.is_running

    def stop(self) -> None:
        """End the run after the current tick. Raises what ended the thread early."""
        with self._mail:
            self._is_stopping = True
            self._mail.notify_all()
        self.wait()

    def __enter__(self) -> Simulation:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    # -- the thread ---------------------------------------------------------------------------------------------

    def _claim(self, thread: threading.Thread) -> None:
        with self._mail:
            if self.is_running:
                raise RuntimeError("this Simulation is running already")
            self._thread = thread
            self._is_stopping = False

    def _release(self) -> None:
        with self._mail:
            self._thread = None
            self._mail.notify_all()

    def _run_thread(self, ticks: float) -> None:
        try:
            self._loop(ticks)
        except BaseException as error:  # handed to whoever waits
            self._error = error
        finally:
            self._release()

    def _loop(self, ticks: float) -> None:
        end = self._pace.ticks + ticks
        if not self.is_paused:
            self._pace.restart(time.perf_counter())
        self._turn.acquire()
        try:
            while not self._is_stopping and self._pace.ticks < end:
                self._carry_out_requests()
                if self._is_due():
                    self._tick()
        finally:
            self._turn.release()
            self._pace.rest(time.perf_counter())

    def _is_due(self) -> bool:
        """Whether to tick now. If not, sleeps until then, until there is mail, or for a look at pictures to come."""
        delay = None if self.is_paused else self._pace.delay(time.perf_counter())
        if delay is not None and delay <= 0:
            return True
        if self.is_paused and self.world.is_looking:
            delay = LOOK
            if self.world.look() is not self._frame:
                self._publish(self.world.frame)
        with self._turn_left() if self.is_paused else contextlib.nullcontext(), self._mail:
            if not self._requests and not self._is_stopping:
                self._mail.wait(delay)
        return False

    @contextlib.contextmanager
    def _turn_left(self) -> Iterator[None]:
        """Others may touch the World meanwhile."""
        self._turn.release()
        try:
            yield
        finally:
            self._turn.acquire()

    def _tick(self, orders: Mapping[str, Command] = NO_ORDERS) -> None:
        """One tick with the mail of those who drive, and with `orders`, which count for more."""
        with self._mail:
            mail, self._commands = self._commands, {}
        commands: dict[str, Command] = {}
        for name, vehicle in self._frame.vehicles.items():
            command = mail.get((name, "script" if vehicle.is_autonomous else "person"))
            if command is not None:
                commands[name] = command
        self._publish(self.world.step({**commands, **orders}))
        if self._pace.count(time.perf_counter()):
            log.warning("cannot keep up with speed %g: simulated time slows down", self.speed)

    def _publish(self, frame: Frame) -> None:
        self._frame = frame
        for sink in self._sinks:
            try:
                sink.publish(frame)
            except Exception:
                log.exception("%s raised and gets no more Frames", type(sink).__name__)
                self.remove_sink(sink)

    def _carry_out_requests(self) -> None:
        while self._requests:
            with self._mail:
                request, done = self._requests.popleft()
            if not done.set_running_or_notify_cancel():
                continue
            try:
                self._carry_out(request)
            except Exception as error:
                done.set_exception(error)
                if not isinstance(error, AutodriveError):
                    raise
            else:
                done.set_result(self._frame)

    def _carry_out(self, request: Request) -> None:
        match request:
            case Pause():
                self._is_paused = True
                self._pace.rest(time.perf_counter())
            case Resume():
                self._is_paused = False
                self._pace.restart(time.perf_counter())
            case Step(ticks=ticks, commands=commands):
                self._step(ticks, commands)
            case LoadScenario(name=name):
                self._load_world(name)
            case SetSpeed(factor=factor):
                self._pace.set_speed(factor, time.perf_counter())
            case Reset(seed=seed):
                self.world.reset(seed)
            case Teleport(vehicle=vehicle, x=x, y=y, yaw=yaw):
                self.world.teleport(vehicle, x, y, yaw)
            case SetSceneLight(enabled=enabled):
                self.world.set_scene_light(enabled)
            case SetDrivingMode(vehicle=vehicle, is_autonomous=is_autonomous):
                self.world.set_driving_mode(vehicle, is_autonomous)
        if self.world.frame is not self._frame:
            self._publish(self.world.frame)

    def _step(self, ticks: int, commands: dict[str, Command]) -> None:
        """Ticks of a Step, at once. While running there is nothing to do: time passes anyway."""
        for _ in range(ticks if self.is_paused else 0):
            if self._is_stopping:
                break
            self._tick(commands)
            commands = {}

    def _load_world(self, name: str) -> None:
        """The World of another scenario in the place of this one, which stays if the other cannot be made."""
        assert self._load is not None
        before, self.world = self.world, self._load(name)
        before.close()
        with self._mail:
            self._commands = {}
        self._pace.set_tick_duration(self.world.tick_duration, time.perf_counter())

    # -- checks at the door -------------------------------------------------------------------------------------

    def _ticks_in(self, duration: float | None) -> float:
        if duration is None:
            return math.inf
        if not duration >= 0:
            raise ValueError(f"duration must be 0 or more seconds, not {duration}")
        return math.ceil(duration / self.world.tick_duration - 1e-6)  # a multiple of the tick is not one tick more

    def _check_vehicle(self, vehicle: str) -> None:
        if vehicle not in self._frame.vehicles:
            raise CommandError(f"vehicle '{vehicle}' is not known. {suggest(vehicle, list(self._frame.vehicles))}")

    def _check_request(self, request: Request) -> None:
        match request:
            case SetSpeed(factor=factor):
                _check_speed(factor)
            case Step(ticks=ticks, commands=commands):
                if ticks < 1:
                    raise CommandError(f"a Step runs 1 tick or more, not {ticks}")
                for vehicle, command in commands.items():
                    self._check_vehicle(vehicle)
                    _check_command(vehicle, command)
            case LoadScenario() if self._load is None:
                raise CommandError("this Simulation was made for one World and loads no other scenario")
            case SetDrivingMode(vehicle=vehicle):
                self._check_vehicle(vehicle)
            case Teleport(vehicle=vehicle, x=x, y=y, yaw=yaw):
                self._check_vehicle(vehicle)
                if not all(map(math.isfinite, (x, y, yaw))):
                    raise CommandError(f"a Teleport needs finite x, y [m] and yaw [rad], not {x}, {y}, {yaw}")


def _check_command(vehicle: str, command: Command) -> None:
    for name, value in (("throttle", command.throttle), ("steering", command.steering)):
        if not math.isfinite(value):
            raise CommandError(f"{name} of vehicle '{vehicle}' must be a finite number in [-1, 1], not {value}")
    for name, value, lamps in (
        ("headlights", command.headlights, Headlights),
        ("indicators", command.indicators, Indicators),
    ):
        if value is not None and value not in tuple(lamps):
            known = ", ".join(f"{int(lamp)} {lamp.name.lower()}" for lamp in lamps)
            raise CommandError(f"{name} of vehicle '{vehicle}' must be one of {known}, not {value}")


def _check_speed(speed: float | None) -> None:
    if speed is not None and not (math.isfinite(speed) and speed > 0):
        raise CommandError(f"speed must be a positive number, or None for as fast as possible, not {speed}")
