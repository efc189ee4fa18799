"""What SIGINT and SIGTERM do to a command that runs until it is stopped: it ends within two seconds."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

STOP_TIME = 1.5
"""Time in which a command ends after a signal [s]; after that the process ends at once."""


class StopSignals:
    """From `catch` on, SIGINT and SIGTERM call `stop` with their name; the second signal ends the process at once.

    `report` prints what a command that has not ended after `STOP_TIME` owes to its user; it returns the exit code.
    """

    def __init__(self, stop: Callable[[str], object], report: Callable[[], int] = lambda: 0) -> None:
        self._stop = stop
        self._report = report
        self._default: dict[int, Any] = {}
        self._is_stopped = self._has_ended = False

    def catch(self) -> None:
        """From now on, a signal ends this command."""
        for number in (signal.SIGINT, signal.SIGTERM):
            self._default[number] = signal.signal(number, self._on_signal)

    def end(self, code: int = 0) -> None:
        """After a signal, end the process, whose modules would need half a second of a processor to end by themselves.

        On a busy machine that takes several. Without a signal nothing happens.
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
        for number, handler in self._default.items():
            signal.signal(number, handler)

    def _on_signal(self, number: int, _: object) -> None:
        if self._is_stopped:
            os._exit(128 + number)
        self._is_stopped = True
        threading.Thread(target=self.end_late, name="autodrive-deadline", daemon=True).start()
        self._stop(signal.Signals(number).name)


def _end_process(code: int) -> None:
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)
