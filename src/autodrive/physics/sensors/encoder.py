"""Incremental encoders on the two rear motors: counts, and the corresponding wheel angles (report, table 4)."""

from __future__ import annotations

import math

from pydantic import Field

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.sensor import SensorSpec

REAR_LEFT = 2
"""Index of the rear left wheel; the rear right wheel is next."""


class EncoderSpec(SensorSpec):
    """Two encoders, one on the shaft of each rear motor."""

    pulses_per_revolution: int = Field(default=16, ge=1, le=1_000_000)
    """Pulses per revolution of the motor shaft."""
    gear_ratio: float = Field(default=120.0, ge=1e-3, le=1e6)
    """Revolutions of the motor shaft per revolution of the wheel."""
    noise: NoiseSpec = NoiseSpec()
    """Noise of the wheel angle [rad] before it is quantised, for example gear backlash."""

    @property
    def ticks_per_radian(self) -> float:
        """Pulses per angle of the wheel [1/rad]."""
        return self.pulses_per_revolution * self.gear_ratio / (2.0 * math.pi)


@jit_uncounted
def count(angles: Floats, ticks_per_radian: float, ticks: Integers) -> None:
    """Write the counts of the wheel angles, and replace each angle [rad] by that of its count.

    Counts are rounded toward zero and never wrap.
    """
    for side in range(2):
        ticks[side] = int(angles[side] * ticks_per_radian)  # rounds toward zero
        angles[side] = ticks[side] / ticks_per_radian
