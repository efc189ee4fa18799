"""What SIGINT, SIGTERM and SIGHUP do to a command; one that runs until it is stopped ends within two seconds."""

from __future__ import annotations

import contextlib
import os
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

_interrupts: list[int] = []
"""Signals that have raised a `KeyboardInterrupt`. Python drops it inside a function that C code calls."""

STOP_TIME = 1.5
"""Time in which a command ends after a signal [s]; after that the process ends at once."""


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """SIGTERM and SIGHUP do what Ctrl-C does: a `KeyboardInterrupt`, with which a command closes its files.

    Only the main thread can do this; in another one, nothing changes.
    """
    is_ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN  # as in the background of a shell script
    numbers = [signal.SIGTERM] if is_ignored else [signal.SIGINT, signal.SIGTERM]
    before = _handled(_interrupt, numbers) if threading.current_thread() is threading.main_thread() else {}
    try:
        yield
    finally:
        _interrupts.clear()
        _restore(before)


class StopSignals:
    """Calls `stop` with the name of a signal (SIGINT, SIGTERM, SIGHUP) from `catch` on; a second one ends the process.

    `report` prints what a command that has not ended after `STOP_TIME` owes to its user; it returns the exit code.
    """

    def __init__(self, stop: Callable[[str], object], report: Callable[[], int] = lambda: 0) -> None:
        self._stop = stop
        self._report = report
        self._default: dict[int, Any] = {}
        self._is_stopped = self._has_ended = False

    def catch(self) -> None:
        """Have a signal end this command from now on, also one whose `KeyboardInterrupt` was dropped."""
        self._default = _handled(self._on_signal, [signal.SIGINT, signal.SIGTERM])
        if _interrupts:
            self._on_signal(_interrupts[-1], None)

    def end(self, code: int = 0) -> None:
        """End the process at once after a signal; without one nothing happens.

        Its modules would need half a second of a processor to end by themselves, and several seconds on a busy machine.
        """
        if self._is_stopped:
            _end_process(code)

    def end_late(self) -> None:
        """End the process after `STOP_TIME` if it still runs then."""
        time.sleep(STOP_TIME)
        code = 0
        try:
            if self._has_ended:
                time.sleep(STOP_TIME)  # it prints what it owes
            else:
                code = self._report()
        finally:
            _end_process(code)

    def __enter__(self) -> StopSignals:
        return self

    def __exit__(self, *_: object) -> None:
        self._has_ended = True
        _restore(self._default)

    def _on_signal(self, number: int, _: object) -> None:
        if self._is_stopped:
            os._exit(128 + number)
        self._is_stopped = True
        _leave_closed_terminal()
        threading.Thread(target=self.end_late, name="autodrive-deadline", daemon=True).start()
        self._stop(signal.Signals(number).name)


def _handled(handler: Callable[[int, Any], object], numbers: list[signal.Signals]) -> dict[int, Any]:
    """Let `handler` have these signals, and SIGHUP unless it is ignored, as by nohup; the handlers before."""
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers = [*numbers, signal.SIGHUP]
    return {number: signal.signal(number, handler) for number in numbers}


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _interrupt(number: int, _: object) -> NoReturn:
    _interrupts.append(number)
    _leave_closed_terminal()
    raise KeyboardInterrupt


def _leave_closed_terminal() -> None:
    """Discard what is printed from now on if the terminal was closed: otherwise each line would be an error."""
    for stream in (1, 2):
        with contextlib.suppress(OSError):
            if stat.S_ISCHR(os.fstat(stream).st_mode) and not os.isatty(stream):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def _end_process(code: int) -> None:
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)
