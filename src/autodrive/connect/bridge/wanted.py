"""What a devkit script wants: the latest values of its keys, and the operations that follow from changes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, NamedTuple

from autodrive.protocol.devkit import DevkitCommands, environment_operations, light_operations
from autodrive.protocol.messages import Hold, Reset

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame, Operation

RESET_INTERVAL = 0.5
"""Least simulated time between two resets [s], equal to the default time-out of commands. Without it, a script that
sets and clears the key repeatedly would keep simulated time at 0."""


class Values(NamedTuple):
    """Values that a script has set; they last until it sets others."""

    holds: Mapping[str, Hold] = {}
    """Poses of co-simulated vehicles, by vehicle."""
    environment: Mapping[str, float] = {}
    """Time of day and weather, by the keys of `ENVIRONMENT`."""
    lights: Mapping[int, int] = {}
    """States of traffic lights, by number from 1."""


class Wanted:
    """What the script of one connection wants, and what of it has been requested. Uses no clock and no socket."""

    def __init__(self) -> None:
        self._wanted = self._requested = Values()
        self._held_resets: dict[str, bool] = {}
        self._is_reset_due = False
        self._has_reset = False
        self._latest_tick = 0
        self._requested_at: Frame | None = None

    def add(self, message: DevkitCommands, autonomous: Collection[str]) -> None:
        """Note the values of a message; reset and hold are obeyed for the vehicles in autonomous mode only."""
        resets = [name for name, is_held in message.resets.items() if is_held and not self._held_resets.get(name)]
        self._held_resets |= message.resets
        self._is_reset_due |= any(vehicle in autonomous for vehicle in resets)
        holds = {
            hold.vehicle: hold if hold.vehicle in autonomous else Hold(hold.vehicle, None) for hold in message.holds
        }
        self._wanted = Values(
            {**self._wanted.holds, **holds},
            {**self._wanted.environment, **message.environment},
            {**self._wanted.lights, **message.traffic_lights},
        )

    def operations(self, frame: Frame) -> list[Operation]:
        """What is to be requested now: what has changed since the last time, and nothing more at the same Frame."""
        if frame is self._requested_at:
            return []
        before, wanted, self._requested = self._requested, self._wanted, self._wanted
        if frame.tick < self._latest_tick:  # a reset has set the lights back
            before = before._replace(lights={})
        self._latest_tick = frame.tick
        operations: list[Operation] = []
        if self._is_reset_due and (not self._has_reset or frame.time >= RESET_INTERVAL):
            self._is_reset_due, self._has_reset = False, True
            operations.append(Reset())
        operations += [hold for name, hold in wanted.holds.items() if before.holds.get(name, Hold(name, None)) != hold]
        operations += environment_operations(before.environment, wanted.environment)
        operations += light_operations(before.lights, wanted.lights, list(frame.traffic_lights))
        if operations:
            self._requested_at = frame
        return operations
