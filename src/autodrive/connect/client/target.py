"""Where a client connects, and which simulators it accepts there."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass

from autodrive.base.cache import user_name
from autodrive.base.errors import AutodriveError
from autodrive.connect.client.client_socket import Address, NotListeningError
from autodrive.connect.client.last_run import RunNote, last_run
from autodrive.protocol.native import RunOrigin
from autodrive.protocol.ports import PORT, PORT_VARIABLE


@dataclass(frozen=True)
class Target:
    """An address, and the run that must be there; None: any run, of any user if `is_chosen`."""

    address: Address
    run: RunNote | None = None
    is_chosen: bool = True
    """Whether the user has chosen the address."""

    def refusal(self, origin: RunOrigin | None) -> str:
        """Why a client must not use the simulator of that origin; empty if it may."""
        expected = ""
        if self.run is not None and (origin is None or origin.id != self.run.origin.id):
            expected = f"not the last run in this folder, {described(self.run.origin)}"
        elif not self.is_chosen and origin is not None and origin.user != user_name():
            expected = f"not a simulator of the user '{user_name()}', who has no run in this folder"
        if not expected:
            return ""
        return f"the simulator at {self.address}, {described(origin)}, is {expected}: {_give(self.address)}"


def default_target(token: str | None = None) -> Target:
    """The target of a client without an address: the port `AUTODRIVE_PORT`, else the last run, else the default port.

    Raises `NotListeningError` if that run has no address yet, and `AutodriveError` if the port is not that of the run.
    """
    run, port = last_run(), port_of_environment()
    if run is not None and not run.address:
        raise NotListeningError("the simulator in this folder does not listen yet")
    address = None if run is None else Address.of(run.address, token)
    if address is not None and port not in (None, address.port):
        raise AutodriveError(
            f"{PORT_VARIABLE} is {port}, but the last run in this folder is at {address}: change {PORT_VARIABLE}, or "
            + _give(address)
        )
    return Target(address or Address("127.0.0.1", port or PORT, token=token), run, port is not None)


def port_of_environment() -> int | None:
    """The port in the environment variable `AUTODRIVE_PORT`; None if it is not set. Raises `AutodriveError`."""
    text = os.environ.get(PORT_VARIABLE, "")
    if text and not (text.isascii() and text.isdecimal() and 0 < int(text[:6]) < 65536):
        raise AutodriveError(f"{PORT_VARIABLE} must be a port, 1 to 65535, not '{text[:80]}'")
    return int(text) if text else None


def described(origin: RunOrigin | None) -> str:
    """Who started a simulator, and when: 'started by alice at 2026-01-31 10:20:30'."""
    if origin is None:
        return "started by an unknown user"
    return f"started by {origin.user} at {time.strftime('%Y-%m-%d %H:%M:%S', time.localtime(origin.started))}"


def _give(address: Address) -> str:
    return f"give the address of the simulator that you want, such as Client('{address}')"
