"""Processes that make the same file take turns, so that one makes it and the others read it."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


class Turns:
    """Processes that make the same file of a cache take turns, where the file system has locks.

    The system ends the turn of a process that ends.
    """

    LIMIT = 300.0
    """Longest wait for another process [s]; then both make the file."""
    INTERVAL = 0.05
    """Time between two looks whether the turn of the other has ended [s]."""

    def __init__(self) -> None:
        self._locks: dict[Path, int] = {}

    def take(self, path: Path) -> bool:
        """Begin a turn, after that of another process; whether there was one, which probably has made the file."""
        if path in self._locks or fcntl is None:
            return False
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = os.open(path.with_suffix(".lock"), os.O_CREAT | os.O_RDWR)
        except OSError:
            return False
        self._locks[path] = lock
        deadline, has_waited = time.monotonic() + self.LIMIT, False
        while time.monotonic() < deadline:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                has_waited = True
                time.sleep(self.INTERVAL)
            except OSError:
                break
            else:
                break
        return has_waited

    def end(self, path: Path) -> None:
        """End the turn."""
        if (lock := self._locks.pop(path, None)) is not None:
            with contextlib.suppress(OSError):
                path.with_suffix(".lock").unlink()
            os.close(lock)
