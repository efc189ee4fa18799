"""Worker processes that render: how the simulator starts one and talks to it, and the loop inside it.

The simulator sends a pickled set-up, then requests, to the worker's stdin; the worker sends messages to its stdout.
Requests and messages are lines of JSON. The worker ends when its stdin closes, so none is left behind however the
simulator ends.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Generic, TypeVar

import msgspec

from autodrive.base.errors import AutodriveError

SHUTDOWN_TIME = 5.0
"""A worker that has not ended after that wall time is killed [s]."""

WATCH_PERIOD = 1.0
"""Wall time between two looks at whether a worker answers [s]."""

RESTARTS = 3
"""A worker that ends unexpectedly is started again this often in the life of a world."""

ANSWER_TIME, START_TIME = 30.0, 120.0
"""A worker that has not answered a request, or its set-up, after that wall time is killed [s]."""

Message = TypeVar("Message", bound=msgspec.Struct)


class Ready(msgspec.Struct, tag=True):
    """The worker can draw, with the OpenGL renderer of this name."""

    renderer: str


class Failed(msgspec.Struct, tag=True):
    """The worker cannot draw, for this reason, and ends."""

    reason: str


# -- in the simulator -------------------------------------------------------------------------------------------


class Worker(Generic[Message]):
    """A running worker; `messages` is the union of the messages that it sends."""

    def __init__(self, module: str, *arguments: str, messages: Any, descriptors: Sequence[int] = ()) -> None:
        """Run `module` in a new Python, which inherits these file descriptors."""
        self._decode: Callable[[bytes], Message] = msgspec.json.Decoder(messages).decode
        self._process = subprocess.Popen(
            # -P: a file in the user's folder must not replace one of our modules
            [sys.executable, "-P", "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # graphics drivers print many warnings
            env=environment(),
            **popen_options(descriptors),
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self._requests = self._answers = 0
        self._is_late = False
        self._is_closed = threading.Event()
        threading.Thread(target=self._watch, name="autodrive-watchdog", daemon=True).start()

    @property
    def pid(self) -> int:
        """Process identifier."""
        return self._process.pid

    def send_setup(self, setup: object) -> None:
        """Send the first, pickled, object. It is answered, as each request is."""
        self._send(pickle.dumps(setup, pickle.HIGHEST_PROTOCOL))

    def send(self, request: msgspec.Struct) -> None:
        """Send a request. If the worker has just died, nothing happens: `receive` returns None."""
        self._send(line_of(request))

    def receive(self) -> Message | None:
        """Wait for the next message; None if the worker has ended."""
        try:
            line = self._stdout.readline()
        except ValueError:  # `close` was called
            return None
        self._answers += 1
        return self._decode(line) if line.endswith(b"\n") else None

    def request_end(self) -> None:
        """Close the request pipe: the worker ends after its current request."""
        with contextlib.suppress(OSError, ValueError):
            self._stdin.close()

    def kill(self) -> None:
        """End the worker at once, if it is still running."""
        self._process.kill()

    def close(self) -> None:
        """Kill the worker if it is still running, and free its pipes."""
        self._is_closed.set()
        self._process.kill()
        for pipe in (self._stdin, self._stdout):
            with contextlib.suppress(OSError, ValueError):
                pipe.close()
        self._process.wait()

    def exit_status(self) -> str:
        """How the worker ended, for an error message; waits until it has ended, or kills it."""
        try:
            code = self._process.wait(SHUTDOWN_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return "it stopped answering and was killed"
        if self._is_late:
            return "it stopped answering and was killed"
        return signal.Signals(-code).name if code < 0 else f"exit code {code}"

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
                self._process.kill()
                return

    def _send(self, data: bytes) -> None:
        self._requests += 1
        with contextlib.suppress(OSError, ValueError):
            self._stdin.write(data)
            self._stdin.flush()


def popen_options(descriptors: Sequence[int] = (), platform: str = sys.platform) -> dict[str, Any]:
    """Options of `Popen` that differ between platforms.

    Ctrl-C goes to the simulator only, which then ends the worker. On Windows no descriptors can be passed, and the
    priority is set here; elsewhere the worker lowers its own.
    """
    if platform == "win32":
        assert not descriptors
        new_process_group, below_normal_priority = (
            0x200,
            0x4000,
        )  # CREATE_NEW_PROCESS_GROUP, BELOW_NORMAL_PRIORITY_CLASS
        return {"creationflags": new_process_group | below_normal_priority}
    return {"start_new_session": True, "pass_fds": descriptors}


def line_of(message: msgspec.Struct) -> bytes:
    """A request or message as it is sent."""
    return msgspec.json.encode(message) + b"\n"


def environment() -> dict[str, str]:
    """The worker finds the package where the simulator found it."""
    root = str(Path(__file__).parents[3])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))}


# -- in the worker ----------------------------------------------------------------------------------------------


def serve(work: Callable[[BinaryIO], Iterator[msgspec.Struct]], subject: str) -> None:
    """Send what `work(stdin)` yields until it ends; an exception becomes a `Failed`.

    `subject`: what is unavailable after an unexpected exception, in the plural.
    """
    messages = _take_stdout()
    _lower_priority()
    try:
        for message in work(sys.stdin.buffer):
            messages.write(line_of(message))
            messages.flush()
    except BrokenPipeError:  # the simulator has ended
        pass
    except Exception as error:
        is_ours = isinstance(error, AutodriveError)
        reason = str(error) if is_ours else f"{subject} are unavailable: {type(error).__name__}: {error}"
        with contextlib.suppress(OSError):
            messages.write(line_of(Failed(" ".join(reason.split()))))
            messages.flush()


def _take_stdout() -> BinaryIO:
    """The pipe to the simulator. What anything else prints goes to stderr from now on."""
    messages = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return messages


def _lower_priority() -> None:
    """The physics go first. Windows has no `os.nice`: see `popen_options`."""
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(5)
