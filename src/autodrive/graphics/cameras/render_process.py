"""A process that draws, for callers that do not wait: it is started, watched, and started again if it dies."""

from __future__ import annotations

import contextlib
import logging
import pickle
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, NamedTuple

from autodrive.base.child_process import start_module
from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.render_worker import Failed, Ready, RenderRequest, RenderResult, Target
from autodrive.graphics.render.render_state import RenderState

if TYPE_CHECKING:
    from autodrive.graphics.cameras.rig import CameraRig
    from autodrive.protocol.messages import Frame

log = logging.getLogger(__name__)

RESTARTS, RESTART_PERIOD = 3, 3600.0
"""A worker that ends unexpectedly is started again this often in that wall time [s]."""

SHUTDOWN_TIME = 5.0
"""A worker that has not ended after that wall time is killed [s]."""

WATCH_PERIOD = 1.0
"""Wall time between two looks at whether a worker answers [s]."""

ANSWER_TIME, START_TIME = 30.0, 120.0
"""A worker that has not answered a request, or the rig, after that wall time is killed [s]."""


class Waiting(NamedTuple):
    """What a client waits for."""

    frame: Frame
    target: Target
    drawn: Future[RenderResult]


class RenderProcess:
    """Draws one request after the other, each client in turn; a thread of its own talks to the worker.

    If the worker dies, or is killed because it does not answer, a new one draws the same request, `RESTARTS` times in
    an hour. After that, or if nothing can be drawn, as without OpenGL, one line is logged and each request fails. All
    methods may be called in any thread; only `wait` and `close` wait.
    """

    def __init__(self, rig: CameraRig, subject: str, *, clock: Callable[[], float] = time.monotonic) -> None:
        """`subject`: what is unavailable if the process is, in the plural. Nothing starts yet."""
        self._rig, self._subject, self._clock = rig, subject, clock
        self._waiting: dict[int, Waiting] = {}
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._worker: _RenderWorker | None = None
        self._has_started = threading.Event()
        self._is_closed = False
        self.renderer = ""
        """OpenGL renderer; empty before the worker is ready for the first time."""
        self.error = ""
        """Why nothing is drawn any more; empty if it is."""
        self.deaths = 0
        """How often the worker has ended unexpectedly."""
        self._death_times = deque[float](maxlen=RESTARTS + 1)

    def start(self) -> None:
        """Start the worker, which `draw` does, too."""
        with self._changed:
            if self._thread is None and not self._is_closed:
                self._thread = threading.Thread(target=self._run, name=f"autodrive {self._subject}", daemon=True)
                self._thread.start()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the worker can draw or has failed; whether it can. Returns at once if it was never started."""
        if self._thread is not None:
            self._has_started.wait(timeout)
        return self.is_ready

    @property
    def is_ready(self) -> bool:
        """Whether the worker can draw, as far as is known."""
        return self._has_started.is_set() and not self.error and not self._is_closed

    @property
    def pid(self) -> int:
        """Process identifier of the worker; 0 if there is none."""
        worker = self._worker
        return worker.process.pid if worker else 0

    def draw(self, client: int, frame: Frame, target: Target) -> Future[RenderResult]:
        """Draw the state of that Frame; `client`: a number that identifies the client.

        While a request of that client is still waiting, it is replaced and the same Future is returned. The Future
        fails with an `AutodriveError` if nothing can be drawn; the call itself never raises.
        """
        self.start()
        with self._changed:
            if self._is_closed:
                return failed(Future(), self._closed)
            before = self._waiting.get(client)
            drawn = Future[RenderResult]() if before is None or before.drawn.cancelled() else before.drawn
            self._waiting[client] = Waiting(frame, target, drawn)
            self._changed.notify()
        return drawn

    def forget(self, client: int) -> None:
        """Forget a client that has left; its waiting request fails."""
        with self._changed:
            waiting = self._waiting.pop(client, None)
        if waiting is not None:
            failed(waiting.drawn, "the client has left")

    def close(self) -> None:
        """End the worker, which has no state that could be lost; requests that are waiting or being drawn fail."""
        with self._changed:
            self._is_closed = True
            if self._worker is not None:
                self._worker.process.kill()
            self._changed.notify()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(SHUTDOWN_TIME)

    # -- in the thread ----------------------------------------------------------------------------------------------

    def _run(self) -> None:
        with contextlib.suppress(AutodriveError):  # each request raises it
            self._started()
        while (waiting := self._next()) is not None:
            if waiting.drawn.set_running_or_notify_cancel():
                try:
                    waiting.drawn.set_result(
                        self._draw(RenderRequest(RenderState.of(waiting.frame).data, waiting.target))
                    )
                except Exception as error:
                    self._end_worker()  # it may still be going to answer
                    waiting.drawn.set_exception(error)
        self._end_worker()
        self._has_started.set()
        with self._changed:
            left, self._waiting = list(self._waiting.values()), {}
        for waiting in left:
            failed(waiting.drawn, self._closed)

    def _next(self) -> Waiting | None:
        """The request of the client that has waited longest; None after `close`."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._is_closed)
            return None if self._is_closed else self._waiting.pop(next(iter(self._waiting)))

    def _draw(self, request: RenderRequest) -> RenderResult:
        """Raises `AutodriveError` if nothing can be drawn."""
        while True:
            answer = self._answer(self._started(), request)
            if isinstance(answer, RenderResult):
                return answer

    def _started(self) -> _RenderWorker:
        """A worker that can draw. Raises `AutodriveError` if there cannot be one."""
        while self._worker is None:
            if self.error or self._is_closed:
                raise AutodriveError(self.error or self._closed)
            try:
                worker = _RenderWorker()
            except OSError as error:
                raise self._unavailable(f"their process cannot be started: {error.strerror}") from None
            with self._changed:
                self._worker = worker
                if self._is_closed:
                    worker.process.kill()
            answer = self._answer(worker, self._rig)
            if isinstance(answer, Ready):
                self.renderer = answer.renderer
                self._has_started.set()
        return self._worker

    def _answer(self, worker: _RenderWorker, request: RenderRequest | CameraRig) -> Ready | RenderResult | None:
        """Send a request to the worker; None if the worker has died and another can be started.

        Raises `AutodriveError` if nothing can be drawn.
        """
        answer = worker.answer(request)
        if isinstance(answer, Failed):
            self._end_worker()
            raise self._failed_for_good(answer.reason)
        if answer is not None:
            return answer
        status = worker.exit_status()
        self._end_worker()
        if self._is_closed:
            raise AutodriveError(self._closed)
        self._has_started.clear()
        self.deaths += 1
        self._death_times.append(self._clock())
        recent = sum(self._death_times[-1] - death_time < RESTART_PERIOD for death_time in self._death_times)
        if recent > RESTARTS:
            raise self._unavailable(f"their process ended unexpectedly {recent} times in an hour, now with {status}")
        text = "the process of the %s ended unexpectedly (%s); a new process is started (%d of %d)"
        log.warning(text, self._subject, status, recent, RESTARTS)
        return None

    def _end_worker(self) -> None:
        with self._changed:
            worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()

    def _unavailable(self, reason: str) -> AutodriveError:
        return self._failed_for_good(f"{self._subject} are unavailable: {reason}")

    def _failed_for_good(self, error: str) -> AutodriveError:
        """The error of every request from now on."""
        if not self._is_closed:
            self.error = error
            log.warning("%s", error)
        self._has_started.set()
        return AutodriveError(error)

    @property
    def _closed(self) -> str:
        return f"the {self._subject} of this world were closed"


class _RenderWorker:
    """A running `render_worker`."""

    def __init__(self) -> None:
        self.process = start_module("autodrive.graphics.cameras.render_worker")
        self._requests = self._answers = 0
        self._is_late = False
        self._is_closed = threading.Event()
        threading.Thread(target=self._watch, name="autodrive-watchdog", daemon=True).start()

    def answer(self, request: object) -> Ready | RenderResult | Failed | None:
        """Send a request and wait for its answer; None if the worker has died."""
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None
        assert stdout is not None
        self._requests += 1
        try:
            pickle.dump(request, stdin, pickle.HIGHEST_PROTOCOL)
            stdin.flush()
            answer = pickle.load(stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            return None
        self._answers += 1
        return answer

    def exit_status(self) -> str:
        """How the worker ended, for an error message; waits until it has ended, or kills it."""
        try:
            code = self.process.wait(SHUTDOWN_TIME)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return "the process stopped answering and was killed"
        if self._is_late:
            return "the process stopped answering and was killed"
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

    def close(self) -> None:
        """Kill the worker if it is still running, and free its pipes."""
        self._is_closed.set()
        self.process.kill()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        self.process.wait()

    def _watch(self) -> None:
        """Kill a worker that does not answer, for example because the graphics driver hangs.

        Counts its own waits instead of reading a clock: time in which this process or the machine sleeps is not late.
        """
        waited, answers = 0.0, 0
        while not self._is_closed.wait(WATCH_PERIOD):
            is_waiting = self._requests > self._answers == answers
            waited = waited + WATCH_PERIOD if is_waiting else 0.0
            answers = self._answers
            if is_waiting and waited > (ANSWER_TIME if answers else START_TIME):
                self._is_late = True
                self.process.kill()
                return


def failed(drawn: Future[RenderResult], reason: str) -> Future[RenderResult]:
    """Set this error in a Future, unless it was cancelled, and return the Future."""
    if drawn.set_running_or_notify_cancel():
        drawn.set_exception(AutodriveError(reason))
    return drawn
