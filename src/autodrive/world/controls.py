"""The commands that the vehicles of a world obey, with their time-out, and the lamps and modes that commands switch."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from autodrive.base.errors import CommandError
from autodrive.base.suggest import suggest
from autodrive.protocol.commands import check_commands
from autodrive.protocol.messages import Command, Headlights, Indicators

NO_COMMAND = Command()


@dataclass
class VehicleControls:
    """What one vehicle has been commanded to do."""

    is_autonomous: bool
    command: Command = NO_COMMAND
    since: float = -math.inf
    """Tick of the latest command."""
    headlights: Headlights = Headlights.OFF
    indicators: Indicators = Indicators.OFF
    indicators_since: int = 0
    """Tick at which the indicators were switched on."""
    is_braking: bool = False
    """Whether the brake lamps are on with a throttle that is not 0, too."""

    def switch_indicators(self, indicators: Indicators, tick: int) -> None:
        """Switch the indicators at that tick; they blink on if they were on."""
        if indicators != self.indicators:
            if self.indicators == Indicators.OFF:
                self.indicators_since = tick
            self.indicators = indicators


class Controls:
    """The controls of all vehicles of a world."""

    def __init__(self, is_autonomous: Mapping[str, bool], timeout: int, *, traffic: Collection[str] = ()) -> None:
        """`is_autonomous`: driving mode of each vehicle after a reset; a command acts for `timeout` ticks.

        `traffic`: names of the vehicles that drive themselves.
        """
        self._is_autonomous = dict(is_autonomous)
        self._timeout = timeout
        self._traffic = frozenset(traffic)
        self.throttle = np.zeros(len(self._is_autonomous))
        """Throttle that the vehicles obey in this tick [-1, 1], shape (n_vehicle,); see `update`."""
        self.steering = np.zeros(len(self._is_autonomous))
        """Steering that the vehicles obey in this tick [-1, 1], left positive, shape (n_vehicle,); see `update`."""
        self.names = list(self._is_autonomous)
        self._numbers = {name: i for i, name in enumerate(self.names)}
        self.reset()

    def reset(self) -> None:
        """Forget all commands; every vehicle is in the driving mode that it starts in."""
        self.restore([VehicleControls(is_autonomous) for is_autonomous in self._is_autonomous.values()])

    def index(self, vehicle: str) -> int:
        """Number of the vehicle of that name. Raises `CommandError` if there is none."""
        number = self._numbers.get(vehicle) if isinstance(vehicle, str) else None
        if number is None:
            raise CommandError(f"vehicle '{vehicle}' is not in this world. {suggest(str(vehicle), self.names)}")
        return number

    def check_obeys(self, *vehicles: str) -> None:
        """Raises `CommandError` if one of these vehicles belongs to the traffic."""
        if not self._traffic.isdisjoint(vehicles):
            name = next(vehicle for vehicle in vehicles if vehicle in self._traffic)
            raise drives_itself(name, [driven for driven in self.names if driven not in self._traffic])

    def accept(self, commands: Mapping[str, Command], tick: int) -> None:
        """Take commands at that tick. Raises `CommandError` if one of them is wrong, and takes none of them then."""
        check_commands(commands)
        self.check_obeys(*commands)
        obeying = [(self.vehicles[self.index(name)], command) for name, command in commands.items()]
        for controls, command in obeying:
            controls.command, controls.since = command, tick
            if command.headlights is not None:
                controls.headlights = Headlights(command.headlights)
            if command.indicators is not None:
                controls.switch_indicators(Indicators(command.indicators), tick)

    def update(self, tick: int) -> None:
        """Write what the vehicles obey at that tick into `throttle` and `steering`: clamped, 0 after the time-out."""
        for i, controls in enumerate(self.vehicles):
            command = controls.command if tick - controls.since < self._timeout else NO_COMMAND
            self.throttle[i], self.steering[i] = _clamped(command.throttle), _clamped(command.steering)

    def save(self) -> Sequence[VehicleControls]:
        """Everything that the future depends on, for `restore`."""
        return [replace(controls) for controls in self.vehicles]

    def restore(self, saved: Sequence[VehicleControls]) -> None:
        """Go back to the state of `save`."""
        self.vehicles = [replace(controls) for controls in saved]


def drives_itself(vehicle: str, others: Sequence[str]) -> CommandError:
    """The error of who commands a vehicle of the traffic; `others` obey commands."""
    return CommandError(f"vehicle '{vehicle}' belongs to the traffic and drives itself; command {', '.join(others)}")


def _clamped(value: float) -> float:
    return 1.0 if value > 1.0 else -1.0 if value < -1.0 else value
