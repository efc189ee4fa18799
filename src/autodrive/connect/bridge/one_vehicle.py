"""One vehicle of a simulation as its script sees it: as V1, alone."""

from __future__ import annotations

import threading
import time

from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.protocol.messages import Command, Frame, Hold, Operation, Reset, VehicleFrame
from autodrive.world.simulation.control import Publisher

OWN = "V1"
"""Name of a vehicle for its script."""


class OneVehicle(Publisher):
    """Stands for the Simulation towards the bridge of one script; `publish` shows it a Frame.

    A subclass passes the commands on. All methods may be called from any thread.
    """

    def __init__(self, vehicle: str, frame: Frame) -> None:
        self.vehicle = vehicle
        self.answers = 0
        """Number of commands received for the vehicle."""
        self.answered_at = time.monotonic()
        """Wall time of the last command [s], or of the start."""
        self.command = Command()
        """The last command."""
        self._news = threading.Condition()
        super().__init__(self._seen(frame))

    def publish(self, frame: Frame) -> None:
        """Show a Frame to the script."""
        self._publish(self._seen(frame))

    def wait_for_answer(self, before: int, timeout: float) -> bool:
        """Wait for more than `before` commands, at most `timeout` [s]; whether there are more."""
        with self._news:
            return self._news.wait_for(lambda: self.answers > before, timeout)

    def permitted(self, vehicle: VehicleFrame) -> VehicleFrame:
        """What the script may see of its vehicle."""
        return vehicle

    def forbid(self, request: Operation, request_text: str) -> object:
        """Refuse a request of the script, a reset or a pose; `request_text` names it. Raises `CommandError`."""
        raise CommandError(f"a script cannot request {request_text} here")

    # -- towards the bridge -------------------------------------------------------------------------------------

    def submit(self, vehicle: str, command: Command) -> None:
        """Take an answer of the script."""
        with self._news:
            self.command = command
            self.answers += 1
            self.answered_at = time.monotonic()
            self._news.notify_all()

    def renew(self, vehicle: str, command: Command) -> None:
        """Do nothing: who steps the vehicle in lock-step repeats `command` itself."""

    def request(self, request: Operation) -> object:
        """Time of day and weather are those of the simulation. Raises `CommandError`."""
        if isinstance(request, Reset):
            return self.forbid(request, "a reset")
        if isinstance(request, Hold) and request.position is not None:
            return self.forbid(request, "a pose of its vehicle")
        return None

    def _seen(self, frame: Frame) -> Frame:
        """The Frame with its own vehicle only."""
        own = self.permitted(frame.vehicles[self.vehicle])
        return replace(frame, vehicles={OWN: own}, objects={}, events=())
