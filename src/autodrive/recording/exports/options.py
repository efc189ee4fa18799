"""Options of an export."""

from __future__ import annotations

from dataclasses import dataclass

from autodrive.base.suggest import suggest
from autodrive.recording import Recording, RecordingError


@dataclass(frozen=True)
class ExportOptions:
    """Options of an export. Not every format uses all of them."""

    vehicle: str = ""
    """Only this vehicle; empty: all, or the first one in formats for one vehicle."""
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
