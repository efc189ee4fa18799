"""Driver lease for each vehicle: one client drives at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from autodrive.protocol.native import Source

LEASE_TIME = 2.0
"""A lease expires when its driver sends no command for this time [s]."""


@dataclass
class _Lease:
    driver: Any
    source: Source
    expires: float


class DriverLeases:
    """The leases of all vehicles. Drivers are any objects; times are those of any steady clock [s]."""

    def __init__(self) -> None:
        self._leases: dict[str, _Lease] = {}

    def acquire(self, vehicle: str, driver: Any, source: Source, obeyed: Source | None, now: float) -> Any:
        """Acquire or renew the lease of a vehicle. Returns None, or the other driver that holds it.

        `obeyed` is the source that the vehicle obeys now: a lease for the other source no longer counts. None: any.
        """
        lease = self._leases.get(vehicle)
        if (
            lease is not None
            and lease.driver is not driver
            and lease.expires > now
            and (obeyed is None or lease.source == obeyed)
        ):
            return lease.driver
        self._leases[vehicle] = _Lease(driver, source, now + LEASE_TIME)
        return None

    def release(self, vehicle: str, driver: Any) -> bool:
        """End the lease of a vehicle if that driver holds it; whether it did."""
        lease = self._leases.get(vehicle)
        if lease is None or lease.driver is not driver:
            return False
        del self._leases[vehicle]
        return True

    def release_all(self, driver: Any) -> None:
        """End all leases of that driver."""
        self._leases = {vehicle: lease for vehicle, lease in self._leases.items() if lease.driver is not driver}

    def drivers(self, now: float) -> dict[str, Any]:
        """The driver of each vehicle that has one now."""
        return {vehicle: lease.driver for vehicle, lease in self._leases.items() if lease.expires > now}
