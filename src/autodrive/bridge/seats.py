"""Who holds the wheel of each vehicle: one driver at a time, others are told who."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from autodrive.protocol.native import Source

SILENCE = 2.0
"""Who gives no command for so long [s] has let go."""


@dataclass
class _Hold:
    driver: Any
    source: Source
    until: float


class Seats:
    """The wheels. Drivers are any objects; times are those of any steady clock [s]."""

    def __init__(self) -> None:
        self._holds: dict[str, _Hold] = {}

    def take(self, vehicle: str, driver: Any, source: Source, obeyed: Source | None, now: float) -> Any:
        """Take or keep the wheel; the other driver who holds it, or None if it is now `driver`'s.

        `obeyed` is the source that the vehicle obeys now: a holder of the other one no longer drives. None: any.
        """
        hold = self._holds.get(vehicle)
        if (
            hold is not None
            and hold.driver is not driver
            and hold.until > now
            and (obeyed is None or hold.source == obeyed)
        ):
            return hold.driver
        self._holds[vehicle] = _Hold(driver, source, now + SILENCE)
        return None

    def release(self, vehicle: str, driver: Any) -> None:
        """Let go, if it is that driver who holds it."""
        hold = self._holds.get(vehicle)
        if hold is not None and hold.driver is driver:
            del self._holds[vehicle]

    def leave(self, driver: Any) -> None:
        """Let go of everything."""
        self._holds = {vehicle: hold for vehicle, hold in self._holds.items() if hold.driver is not driver}

    def drivers(self, now: float) -> dict[str, Any]:
        """Who holds which wheel now."""
        return {vehicle: hold.driver for vehicle, hold in self._holds.items() if hold.until > now}
