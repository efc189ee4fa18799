"""What a Simulation and the Player of a recording have in common: requests that wait, a thread, and its end."""

from __future__ import annotations

import contextlib
import logging
import reprlib
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import Command, Frame, Operation
from autodrive.protocol.native import Source
from autodrive.scenario.files import map_text, scenario_text
from autodrive.world.editing.map_edits import saved_map
from autodrive.world.simulation.clock import Clock, WallClock
from autodrive.world.simulation.control import Publisher

if TYPE_CHECKING:
    from autodrive.world import World

log = logging.getLogger(__name__)

CALL_CHECK = 0.1
"""Who waits for a call looks this often whether the run has ended [s]."""


class Call(NamedTuple):
    """A function that is called between two ticks."""

    function: Callable[[], None]


class Execution(Future[Frame]):
    """The Frame after a request; `began`: when its execution did, by `time.perf_counter` [s]."""

    def __init__(self) -> None:
        super().__init__()
        self.began = time.perf_counter()

    def set_running_or_notify_cancel(self) -> bool:
        """Called when the execution begins."""
        self.began = time.perf_counter()
        return super().set_running_or_notify_cancel()


class Paced(Publisher, ABC):
    """Frames at a pace. Its methods may be called from any thread.

    `keeps_running`: an unexpected error of a request is logged; otherwise it ends the run. `clock` replaces the wall
    clock, for tests.
    """

    world: World
    """The World that the Frames belong to."""
    error = ""
    """Why time cannot go on; empty if it can."""

    def __init__(self, frame: Frame, *, clock: Clock | None, is_paused: bool, keeps_running: bool) -> None:
        super().__init__(frame)
        self._clock: Clock = clock or WallClock()
        self._is_paused = is_paused
        self._keeps_running = keeps_running
        self._requests: deque[tuple[Operation | Call, Execution]] = deque()
        self._mailbox = threading.Condition()
        self._thread: threading.Thread | None = None
        self._is_stopping = False
        self._thread_error: BaseException | None = None

    @property
    @abstractmethod
    def speed(self) -> float | None:
        """Target of seconds of the Frames per wall second; None is as fast as possible."""

    @property
    @abstractmethod
    def real_time_factor(self) -> float:
        """Seconds of the Frames per wall second, measured over about the last second; 0 before that."""

    @property
    def late_ticks(self) -> int:
        """Ticks that ran more than the duration of a tick too late."""
        return 0

    @property
    def undo_name(self) -> str:
        """The edit that an `Undo` reverts, for example 'place V1'; empty if there is none."""
        return ""

    @property
    def redo_name(self) -> str:
        """The edit that a `Redo` makes again; empty if there is none."""
        return ""

    @property
    def is_paused(self) -> bool:
        """Whether time is stopped until a Resume."""
        return self._is_paused

    @property
    def is_running(self) -> bool:
        """Whether the thread of the simulation, or a `run`, is active (also while paused)."""
        return self._thread is not None

    @abstractmethod
    def submit(self, vehicle: str, command: Command, source: Source = "script") -> None:
        """Set the command for the next tick. Raises `CommandError`."""

    @abstractmethod
    def request(self, request: Operation, *, here: bool = False) -> Execution:
        """Execute a request before the next tick, in the order of the calls. Raises `CommandError`.

        The result of the Future is the Frame after the request.
        """

    def prepare(self, name: str) -> World | None:
        """Make the World of a `LoadScenario` in this thread, beside the running time; that request then starts it.

        None: the request makes it. Raises `AutodriveError`.
        """
        return None

    def scenario_text(self, title: str = "") -> str:
        """The scenario as it is now, as the text of a YAML file, with that title if there is one."""
        world = self.world
        changes: dict[str, Any] = {"scene_light": world.scene_light, "title": title or world.spec.title}
        if not isinstance(world.spec.map, str):
            changes["map"] = saved_map(world)
        return scenario_text(world.spec.model_copy(update=changes))

    def map_text(self, title: str = "") -> str:
        """The map as it is now, as the text of a YAML file, with that title. Raises `CommandError` for a race track."""
        return map_text(saved_map(self.world, title))

    @abstractmethod
    def start(self) -> None:
        """Run in a thread of its own until `stop`."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the run ends; False if `timeout` [s] came first. Raises the error that ended the thread early."""
        with self._mailbox:
            if self._thread is not threading.current_thread():
                self._mailbox.wait_for(lambda: self._thread is None, timeout)
            error, self._thread_error = self._thread_error, None
        if error is not None:
            raise error
        return not self.is_running

    def stop(self) -> None:
        """End the run after the current tick. Raises the error that ended the thread early."""
        with self._mailbox:
            self._is_stopping = True
            self._mailbox.notify_all()
        self.wait()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    # -- for the subclass ---------------------------------------------------------------------------------------

    @abstractmethod
    def _execute(self, request: Operation) -> None:
        """Execute a request; called in the thread."""

    def _call(self, call: Call) -> None:
        """Call the function between two ticks, and return after it; it does not wait for a run that has ended."""
        done = Execution()
        if self.is_running and self._thread is not threading.current_thread():
            self._post(call, done)
            while self.is_running:
                with contextlib.suppress(TimeoutError):
                    done.result(CALL_CHECK)
                    return
            if not done.cancel():
                done.result()
                return
        call.function()

    def _run_here(self, loop: Callable[[], None]) -> None:
        """Run in the caller's thread."""
        self._claim(threading.current_thread())
        try:
            loop()
        finally:
            self._release()

    def _start_thread(self, loop: Callable[[], None], name: str) -> None:
        thread = threading.Thread(target=self._run_thread, args=(loop,), name=name, daemon=True)
        self._claim(thread)
        thread.start()

    def _post(self, request: Operation | Call, done: Execution) -> Execution:
        """Leave a request for the thread."""
        with self._mailbox:
            self._requests.append((request, done))
            self._mailbox.notify_all()
        return done

    def _sleep(self, delay: float | None) -> None:
        """Wait for a request or the end of the run, at most `delay` [s] (None: without limit)."""
        with self._mailbox:
            if not self._requests and not self._is_stopping:
                self._clock.wait(self._mailbox, delay)

    def execute_requests(self) -> None:
        """Execute what waits, in this thread, which must be the one that runs the simulation, if it runs.

        What is requested meanwhile waits until the next call, so that there is a tick between.
        """
        for _ in range(len(self._requests)):
            with self._mailbox:
                request, done = self._requests.popleft()
            if not done.set_running_or_notify_cancel():
                continue
            try:
                if isinstance(request, Call):
                    request.function()
                else:
                    self._execute(request)
            except Exception as error:
                done.set_exception(error)
                if not isinstance(error, AutodriveError):
                    if not self._keeps_running:
                        raise
                    log.exception("a request failed: %s", reprlib.repr(request))
            else:
                done.set_result(self._frame)

    # -- the thread ---------------------------------------------------------------------------------------------

    def _claim(self, thread: threading.Thread) -> None:
        with self._mailbox:
            if self.is_running:
                raise RuntimeError(f"this {type(self).__name__} is running already")
            self._thread = thread
            self._is_stopping = False

    def _release(self) -> None:
        with self._mailbox:
            self._thread = None
            self._mailbox.notify_all()

    def _run_thread(self, loop: Callable[[], None]) -> None:
        try:
            loop()
        except BaseException as error:  # raised by wait()
            self._thread_error = error
        finally:
            self._release()
