"""What a bridge remembers for people to look at: counters, round trips, and complaints that do not flood the log."""

from __future__ import annotations

import logging
import math
import statistics
import time
from collections import deque
from dataclasses import dataclass, replace

from autodrive.bridge.engineio import Dialect

COMPLAINT_INTERVAL = 10.0
"""At least so long between two log lines of the same kind [s]."""

log = logging.getLogger(__name__)


@dataclass
class Counters:
    """What has happened since the bridge was made; `dialect` and `profile` are those of the latest connection."""

    dialect: Dialect | None = None
    profile: str | None = None
    """Era of the devkit, None if it is not known yet."""
    connections: int = 0
    """Conversations with a server that took our telemetry."""
    reconnects: int = 0
    """Those after the first."""
    telemetry_sent: int = 0
    commands_received: int = 0
    resends: int = 0
    """Telemetry sent again because for a while nothing had come, or nothing had happened."""
    refused_values: int = 0
    """Values in commands that are no finite numbers, or speak of a vehicle that is not there."""
    bad_packets: int = 0
    oversized: int = 0
    """Telemetry not sent, because even without pictures it was longer than the server takes."""
    round_trip: float = math.nan
    """Median of the last 256 times from a telemetry to the next command [s]; nan before the first."""


class Ledger:
    """Written by the bridge's thread, read by any."""

    def __init__(self) -> None:
        self.counters = Counters()
        self.fault = ""
        """Why the last attempt to connect failed; empty while there is a connection, and before the first attempt."""
        self._round_trips: deque[float] = deque(maxlen=256)
        self._next_complaint: dict[str, float] = {}
        self._silenced: dict[str, int] = {}

    def add_round_trip(self, seconds: float) -> None:
        """One more measured time from a telemetry to the next command."""
        self._round_trips.append(seconds)

    def snapshot(self) -> Counters:
        """A copy of the counters as they are now."""
        trips = list(self._round_trips)
        return replace(self.counters, round_trip=statistics.median(trips) if trips else math.nan)

    def complain(self, kind: str, text: str) -> None:
        """Log a warning, unless one of that kind was logged within the last `COMPLAINT_INTERVAL`."""
        now = time.monotonic()
        if now < self._next_complaint.get(kind, -math.inf):
            self._silenced[kind] = self._silenced.get(kind, 0) + 1
            return
        silenced = self._silenced.pop(kind, 0)
        self._next_complaint[kind] = now + COMPLAINT_INTERVAL
        log.warning("devkit bridge: %s%s", text, f" (and {silenced} more like this)" if silenced else "")
