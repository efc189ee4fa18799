"""Bridge metrics: counters, round-trip times, rate-limited warnings."""

from __future__ import annotations

import logging
import math
import statistics
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

from autodrive.base.log_throttle import LogThrottle
from autodrive.connect.bridge.engineio import Dialect

WARNING_INTERVAL = 10.0
"""Minimum time between two warnings of the same kind [s]."""

MAX_KEYS = 100
"""Keys without effect that are logged; a script that invents more of them fills no log."""

MAX_TEXT = 400
"""Longest text of a warning [characters]."""

log = logging.getLogger(__name__)


@dataclass
class Counters:
    """Totals since the bridge was created; `dialect`, `profile`, `devkit` and `note` describe the latest connection."""

    dialect: Dialect | None = None
    profile: str | None = None
    """Devkit generation; None before it is detected."""
    devkit: str = ""
    """Devkit generation, keys, formats and signs in one line; empty before it is detected."""
    note: str = ""
    """What the user should know about that choice; empty if it is certain."""
    connections: int = 0
    """Connections to a server that accepted telemetry."""
    reconnects: int = 0
    """Connections after the first."""
    telemetry_sent: int = 0
    commands_received: int = 0
    resends: int = 0
    """Telemetry messages that were sent again after a timeout."""
    refused_values: int = 0
    """Command values that are not finite numbers or address an unknown vehicle."""
    bad_packets: int = 0
    oversized: int = 0
    """Telemetry messages that were not sent: even without images they exceeded the limit of the server."""
    round_trip: float = math.nan
    """Median of the last 256 times from a telemetry message to the next command [s]; nan before the first."""


class Metrics:
    """Counters and warnings of one bridge; written by the thread of the bridge, read by any thread."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.counters = Counters()
        self.error = ""
        """Why the last attempt to connect failed; empty while connected, and before the first attempt."""
        self._round_trips: deque[float] = deque(maxlen=256)
        self._throttle = LogThrottle(WARNING_INTERVAL, clock)
        self._ignored: set[str] = set()

    def add_round_trip(self, seconds: float) -> None:
        """Add a time from a telemetry message to the next command [s]."""
        self._round_trips.append(seconds)

    def snapshot(self) -> Counters:
        """A copy of the current counters."""
        trips = list(self._round_trips)
        return replace(self.counters, round_trip=statistics.median(trips) if trips else math.nan)

    def warn(self, kind: str, text: str) -> None:
        """Log a warning, unless one of that kind was logged within the last `WARNING_INTERVAL`."""
        self._log(logging.WARNING, kind, text)

    def note_ignored(self, keys: Collection[str]) -> None:
        """Log keys without effect, each once."""
        new = [key for key in keys if key not in self._ignored][: MAX_KEYS - len(self._ignored)]
        if new:
            self._ignored.update(new)
            log.warning("devkit bridge: keys of the script without effect: %s", printable(", ".join(map(repr, new))))

    def report(self, error: BaseException) -> None:
        """Log an error of the bridge itself with its traceback, as often as a warning."""
        self._log(logging.ERROR, "internal", "internal error", error)

    def _log(self, level: int, kind: str, text: str, error: BaseException | None = None) -> None:
        if not self._throttle.admits(kind):
            return
        suppressed = self._throttle.take_suppressed(kind)
        more = f" ({suppressed} similar warnings suppressed)" if suppressed else ""
        log.log(level, "devkit bridge: %s%s", printable(text), more, exc_info=error)


def printable(text: str) -> str:
    """The text on one line of bounded length: what a script sends can do nothing to a terminal."""
    return "".join(character if character.isprintable() else "?" for character in text[:MAX_TEXT])
