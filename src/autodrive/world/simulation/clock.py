"""The clock by which a Simulation paces its ticks."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class Clock(Protocol):
    """The time by which a Simulation paces its ticks."""

    def now(self) -> float:
        """Time from any origin [s]; it never goes back."""
        ...

    def wait(self, condition: threading.Condition, timeout: float | None) -> None:
        """Wait until `condition`, which is held, is notified, or for `timeout` [s] (None: without limit)."""
        ...


class WallClock:
    """The clock of this machine."""

    def now(self) -> float:
        """Time since the machine started [s]."""
        return time.perf_counter()

    def wait(self, condition: threading.Condition, timeout: float | None) -> None:
        """Wait until notified or for `timeout` [s]."""
        condition.wait(timeout)
