"""What a script of a race sees and may do: its own vehicle as V1, without the signals that the rules withhold."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.protocol.messages import (
    Command,
    Frame,
    Hold,
    IpsReading,
    Operation,
    RaceState,
    Reset,
    Retire,
    VehicleFrame,
)

if TYPE_CHECKING:
    from autodrive.world.racing import RaceRules
    from autodrive.world.simulation.control import Control, Sink

OWN = "V1"
"""Name of a vehicle for its script."""


class Seat:
    """Connects the bridge of one script to one vehicle; stands for the Simulation towards the bridge.

    As a sink of the simulation it passes on each Frame; in lock-step the race calls `publish` instead. All methods may
    be called from any thread.
    """

    def __init__(self, simulation: Control, vehicle: str, rules: RaceRules) -> None:
        self.vehicle = vehicle
        self.answers = 0
        """Number of commands received for the vehicle."""
        self.answered_at = time.monotonic()
        """Wall time of the last command [s], or of the start."""
        self.news = threading.Condition()
        """Notified with each command."""
        self._simulation = simulation
        self._rules = rules
        self._sinks: tuple[Sink, ...] = ()
        self._frame = self._seen(simulation.frame)

    # -- towards the simulation ---------------------------------------------------------------------------------

    def publish(self, frame: Frame) -> None:
        """Show a Frame to the script."""
        self._frame = self._seen(frame)
        for sink in self._sinks:
            sink.publish(self._frame)

    # -- towards the bridge -------------------------------------------------------------------------------------

    @property
    def frame(self) -> Frame:
        """The latest Frame, as the script sees it."""
        return self._frame

    def submit(self, vehicle: str, command: Command) -> None:
        """Drive the vehicle."""
        self._simulation.submit(self.vehicle, command)
        with self.news:
            self.answers += 1
            self.answered_at = time.monotonic()
            self.news.notify_all()

    def request(self, request: Operation) -> object:
        """Refuse what the rules forbid. Raises `CommandError`."""
        if isinstance(request, Hold) and request.position is None:
            return None
        if isinstance(request, Reset | Hold):
            what = "a reset" if isinstance(request, Reset) else "a pose of its vehicle"
            if self._rules.on_reset == "disqualify":
                self._simulation.request(Retire(self.vehicle, f"its script requested {what}", is_disqualified=True))
            elif self._rules.on_reset == "allow" and isinstance(request, Reset):
                return self._simulation.request(request)
            raise CommandError(f"{what} is not allowed in this race")
        return None  # time of day and weather are those of the race

    def add_sink(self, sink: Sink) -> None:
        """Call `sink.publish(frame)` with each Frame."""
        self._sinks = (*self._sinks, sink)

    def remove_sink(self, sink: Sink) -> None:
        """Stop calling the sink."""
        self._sinks = tuple(other for other in self._sinks if other is not sink)

    def _seen(self, frame: Frame) -> Frame:
        """The Frame with its own vehicle only."""
        own = permitted(frame.vehicles[self.vehicle], self._rules)
        return replace(frame, vehicles={OWN: own}, objects={}, events=())


def permitted(vehicle: VehicleFrame, rules: RaceRules) -> VehicleFrame:
    """The vehicle with zeros for the signals that the rules withhold."""
    withheld = set(rules.withheld)
    if "position" in withheld:
        vehicle = replace(vehicle, ips=IpsReading(vehicle.ips.time, np.zeros(3)))
    if "velocity" in withheld:
        vehicle = replace(vehicle, velocity=np.zeros(3))
    race = vehicle.race
    if race is not None and "laps" in withheld:
        race = _without_laps(race)
    if "collisions" in withheld:
        vehicle = replace(vehicle, collision_count=0)
        race = race and replace(race, collision_count=0, penalty=0.0)
    return vehicle if race is vehicle.race else replace(vehicle, race=race)


def _without_laps(race: RaceState) -> RaceState:
    return replace(race, lap_count=0, lap_time=0.0, last_lap_time=0.0, best_lap_time=0.0, race_time=0.0)
