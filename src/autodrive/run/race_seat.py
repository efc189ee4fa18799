"""What a script of a race sees and may do: its own vehicle as V1, without the signals that the rules withhold."""

from __future__ import annotations

import math
import statistics
from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.connect.bridge.one_vehicle import OneVehicle
from autodrive.protocol.messages import Command, Frame, IpsReading, Operation, RaceState, Reset, Retire, VehicleFrame

if TYPE_CHECKING:
    from autodrive.connect.bridge.script_process import ScriptProcess
    from autodrive.world.racing import RaceRules
    from autodrive.world.simulation.control import Control

MIN_COMMANDS, MIN_TICKS = 10, 3
"""A script seems to answer before its driver has a new command if most of so many commands in a row have driven so
many ticks."""
REPEATS = (
    "Most commands of the script drove {:g} ticks: the script seems to answer before its driver has a new command, and "
    "the result depends on the machine"
)


class Seat(OneVehicle):
    """Connects the bridge of one script to one vehicle of a race.

    As a sink of the simulation it passes on each Frame; in lock-step the race calls `publish` instead.
    """

    def __init__(
        self, simulation: Control, vehicle: str, rules: RaceRules, process: ScriptProcess | None = None
    ) -> None:
        """`process`: the script, if the race has started it."""
        self._process = process
        self._simulation = simulation
        self._rules = rules
        self._ticks_of_commands: deque[int] = deque(maxlen=MIN_COMMANDS)
        self._ticks = 0
        self._answered: Frame | None = None
        self.repeats = ""
        """How the script repeats its commands, as a sentence; empty if it does not.

        A bridge that answers at once, with the newest command that it has, repeats those of a driver that needs longer.
        """
        super().__init__(vehicle, simulation.frame)

    def permitted(self, vehicle: VehicleFrame) -> VehicleFrame:
        """The vehicle without the signals that the rules withhold: zeros, and laps as before the first one."""
        return permitted(vehicle, self._rules)

    def submit(self, vehicle: str, command: Command) -> None:
        """Drive the vehicle."""
        self._simulation.submit(self.vehicle, command)
        if self.frame is not self._answered:
            self._answered = self.frame
            self._look_for_repeats(command)
        super().submit(vehicle, command)

    def renew(self, vehicle: str, command: Command) -> None:
        """Drive on with the last command."""
        self._simulation.renew(self.vehicle, command)

    def _look_for_repeats(self, command: Command) -> None:
        if (command.throttle, command.steering) == (self.command.throttle, self.command.steering):
            self._ticks += 1
            return
        self._ticks_of_commands.append(self._ticks)
        self._ticks = 1
        if len(self._ticks_of_commands) == MIN_COMMANDS and not self.repeats:
            ticks = statistics.median(self._ticks_of_commands)
            self.repeats = REPEATS.format(ticks) if ticks >= MIN_TICKS else ""

    @property
    def end(self) -> str:
        """How the script has ended, if the race has started it; empty while it runs."""
        return self._process.end if self._process is not None else ""

    def forbid(self, request: Operation, request_text: str) -> object:
        """Do what the rules say. Raises `CommandError`."""
        if self._rules.on_reset == "disqualify":
            self._simulation.request(Retire(self.vehicle, f"its script requested {request_text}", is_disqualified=True))
        elif self._rules.on_reset == "allow" and isinstance(request, Reset):
            return self._simulation.request(request)
        raise CommandError(f"{request_text} is not allowed in this race")


def permitted(vehicle: VehicleFrame, rules: RaceRules) -> VehicleFrame:
    """The vehicle without the signals that the rules withhold: zeros, and laps as before the first one."""
    withheld = set(rules.withheld)
    if "position" in withheld:
        vehicle = replace(vehicle, ips=IpsReading(vehicle.ips.time, np.zeros(3)))
    if "velocity" in withheld:
        vehicle = replace(vehicle, velocity=np.zeros(3), angular_velocity=np.zeros(3))  # the IMU still measures its own
    race = vehicle.race
    if race is not None and "laps" in withheld:
        race = _without_laps(race)
    if "collisions" in withheld:
        vehicle = replace(vehicle, collision_count=0)
        race = race and replace(race, collision_count=0, penalty=0.0)
    return vehicle if race is vehicle.race else replace(vehicle, race=race)


def _without_laps(race: RaceState) -> RaceState:
    return replace(race, lap_count=0, lap_time=0.0, last_lap_time=math.inf, best_lap_time=math.inf, race_time=0.0)
