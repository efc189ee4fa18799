"""What a devkit script wants: the latest values of its keys, and the operations that follow from changes."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TYPE_CHECKING

from autodrive.protocol.devkit import DevkitCommands, environment_operations, light_operations
from autodrive.protocol.messages import Hold, Reset

if TYPE_CHECKING:
    from autodrive.protocol.messages import Frame, Operation

RESET_INTERVAL = 0.5
"""Least simulated time between two resets [s], equal to the default time-out of commands. Without it, a script that
sets and clears the key repeatedly would keep simulated time at 0."""


class Wanted:
    """What the script of one connection wants, and what of it has been requested. Uses no clock and no socket."""

    def __init__(self) -> None:
        self._wanted = self._requested = DevkitCommands()
        self._is_reset_due = False
        self._has_reset = False
        self._latest_tick = 0
        self._requested_at: Frame | None = None

    def add(self, message: DevkitCommands, autonomous: Collection[str]) -> None:
        """Note the values of a message; reset and hold are obeyed for the vehicles in autonomous mode only."""
        before = self._wanted
        resets = {name for name, is_held in message.resets.items() if is_held and not before.resets.get(name)}
        self._is_reset_due |= not resets.isdisjoint(autonomous)
        holds = {name: hold if name in autonomous else Hold(name, None) for name, hold in message.holds.items()}
        self._wanted = DevkitCommands(
            resets=before.resets | message.resets,
            holds=before.holds | holds,
            environment=before.environment | message.environment,
            traffic_lights=before.traffic_lights | message.traffic_lights,
        )

    def operations(self, frame: Frame) -> list[Operation]:
        """What is to be requested now: what has changed since the last time, and nothing more at the same Frame."""
        if frame is self._requested_at:
            return []
        before, wanted, self._requested = self._requested, self._wanted, self._wanted
        if frame.tick < self._latest_tick:  # a reset has set the lights back
            before = replace(before, traffic_lights={})
        self._latest_tick = frame.tick
        operations: list[Operation] = []
        if self._is_reset_due and (not self._has_reset or frame.time >= RESET_INTERVAL):
            self._is_reset_due, self._has_reset = False, True
            operations.append(Reset())
        operations += [hold for name, hold in wanted.holds.items() if before.holds.get(name, Hold(name, None)) != hold]
        operations += environment_operations(before.environment, wanted.environment)
        operations += light_operations(before.traffic_lights, wanted.traffic_lights, list(frame.traffic_lights))
        if operations:
            self._requested_at = frame
        return operations
