"""Options of an export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from autodrive.base.suggest import suggest, suggesting
from autodrive.recording import Moment, Recording, RecordingError


@suggesting
@dataclass(frozen=True)
class ExportOptions:
    """Options of an export. Not every format uses all of them."""

    vehicle: str = ""
    """The vehicle that is exported; empty: all, or the first one in formats for one vehicle."""
    rate: float | None = None
    """Rate of the rows [Hz]; None: that of the format, or of the recording."""
    start: float | None = None
    """First time [s]; None: the start of the recording."""
    end: float | None = None
    """Last time [s]; None: the end."""

    def vehicles(self, recording: Recording) -> tuple[str, ...]:
        """Names of the vehicles that are exported. Raises `RecordingError`."""
        if not self.vehicle:
            return recording.vehicles
        if self.vehicle not in recording.vehicles:
            known = suggest(self.vehicle, [*recording.vehicles])
            raise RecordingError(f"vehicle '{self.vehicle}' is not in the recording. {known}")
        return (self.vehicle,)

    def includes(self, times: Any) -> Any:
        """Whether a time, or which times of an array [s], are from `start` to `end`."""
        start = -np.inf if self.start is None else self.start
        end = np.inf if self.end is None else self.end
        return (times >= start) & (times <= end)

    def moments(self, recording: Recording, rate: float | None) -> Iterator[Moment]:
        """The Frames from `start` to `end`, at most `rate` of them in a second; None: all.

        A Frame that a request made between two ticks is replaced by the one after it, so that times increase.
        """
        due: float | None = None
        last: Moment | None = None
        for moment in recording.moments(self.start, self.end):
            if last is not None and moment.time > last.time and (due is None or last.time >= due - 1e-9):
                yield last
                period = 0.0 if rate is None else 1.0 / rate
                due = (last.time if due is None else max(due, last.time - period)) + period
            last = moment
        if last is not None and (due is None or last.time >= due - 1e-9):
            yield last
