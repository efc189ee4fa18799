"""Executes Drive messages: checks the driving mode and the driver lease, and submits the command."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

from autodrive.base.errors import AutodriveError
from autodrive.base.log_throttle import LogThrottle
from autodrive.base.suggest import suggest
from autodrive.connect.server.driver_lease import LEASE_TIME
from autodrive.protocol.native import Drive, Error, Source

if TYPE_CHECKING:
    from autodrive.connect.server.connected_client import ConnectedClient
    from autodrive.connect.server.driver_lease import DriverLeases
    from autodrive.connect.server.served import Served

ERROR_INTERVAL = 1.0
"""A client gets Errors of the same code at most once in this time [s], because commands come often."""
PAGE_NAME = re.compile(r"page( \d+)?")
"""Names of clients that are browsers with the page."""


class Driving:
    """Used in the server's event loop. `on_change` is called when a vehicle gets another driver."""

    def __init__(
        self,
        served: Served,
        leases: DriverLeases,
        on_change: Callable[[], None],
        clock: Callable[[], float],
    ) -> None:
        self._refusal = served.refusal
        self._simulation = served.simulation
        self._leases = leases
        self._on_change = on_change
        self._clock = clock
        self._throttles: dict[ConnectedClient, LogThrottle] = {}

    def drive(self, client: ConnectedClient, drive: Drive) -> None:
        """Submit a command if this client may drive that vehicle; otherwise send an Error."""
        if error := self._refusal(drive):
            self._refuse(client, Error("request", error))
            return
        vehicle = self._simulation.frame.vehicles.get(drive.vehicle)
        if vehicle is None:
            known = suggest(drive.vehicle, list(self._simulation.frame.vehicles))
            self._refuse(client, Error("request", f"vehicle '{drive.vehicle[:40]}' is not known. {known}"))
            return
        obeyed: Source = "script" if vehicle.is_autonomous else "person"
        if drive.source != obeyed:
            self._refuse(client, Error("mode", _wrong_mode(drive)))
            return
        now = self._clock()
        before = self._leases.drivers(now).get(drive.vehicle)
        other = self._leases.acquire(drive.vehicle, client, drive.source, obeyed, now)
        if other is not None:
            self._refuse(client, Error("taken", taken(drive.vehicle, other)))
            return
        try:
            self._simulation.submit(drive.vehicle, drive.command, drive.source)
        except AutodriveError as error:
            self._refuse(client, Error("request", str(error)))
        if before is not client:
            self._on_change()

    def release(self, client: ConnectedClient, vehicle: str) -> None:
        """End the lease of that vehicle if this client holds it."""
        if self._leases.release(vehicle, client):
            self._on_change()

    def forget(self, client: ConnectedClient) -> None:
        """The client disconnected."""
        self._leases.release_all(client)
        self._throttles.pop(client, None)

    def _refuse(self, client: ConnectedClient, error: Error) -> None:
        throttle = self._throttles.get(client)
        if throttle is None:
            throttle = self._throttles[client] = LogThrottle(ERROR_INTERVAL, self._clock)
        if throttle.admits(error.code):
            client.send_error(error)


def taken(vehicle: str, other: ConnectedClient) -> str:
    """The text of the Error 'taken'."""
    name, last = f"'{other.name}'", f"command of '{other.name}'"
    if PAGE_NAME.fullmatch(other.name):
        name, last = "another browser", "key of that browser"
    return f"{name} drives {vehicle}; {vehicle} is free {LEASE_TIME:g} s after the last {last}"


def _wrong_mode(drive: Drive) -> str:
    if drive.source == "script":
        return f"vehicle '{drive.vehicle}' is in manual mode and obeys a person; scripts drive it in autonomous mode"
    return f"vehicle '{drive.vehicle}' is in autonomous mode and obeys a script; a person drives it in manual mode"
