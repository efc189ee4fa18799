"""Incremental encoders on the two rear motors: counts, and the corresponding wheel angles (report, table 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from autodrive.base.arrays import Floats, read_only_copy
from autodrive.base.jit import inlined
from autodrive.physics.sensors.columns import Due, Memory, ReadingColumns, add_noise
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.sensor import Reader, Sampled, SensorSpec
from autodrive.protocol.messages import EncoderReading

REAR_LEFT = 2
"""Index of the rear left wheel; the rear right wheel is next."""


@inlined
def sample(due: Due, values: Floats, row: Any, memory: Memory) -> None:
    """The angles of both wheels with noise, then their counts, and the angles [rad] of these counts.

    Counts are rounded toward zero and never wrap.
    """
    for side in range(2):
        values[side] = memory.motion.wheel_rotation[4 * due.i + REAR_LEFT + side]
    add_noise(due, memory, values)
    ticks, ticks_per_radian = memory.readings.encoder_ticks[due.k, due.i], row["ticks_per_radian"]
    for side in range(2):
        ticks[side] = int(values[side] * ticks_per_radian)  # rounds toward zero
        values[side] = ticks[side] / ticks_per_radian


class EncoderSpec(SensorSpec, Sampled):
    """Two encoders, one on the shaft of each rear motor."""

    VALUES: ClassVar[int] = 2
    NOISY_VALUES: ClassVar[int] = 2
    COLUMNS: ClassVar[Mapping[str, Any]] = {"ticks_per_radian": np.float64}
    STRONG: ClassVar[float] = 0.05
    sample: ClassVar[Any] = sample

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

    def parameters(self, gravity: float) -> dict[str, Any]:
        """Values of this sensor's columns in `SensorTables.vehicles`, by name."""
        return {"ticks_per_radian": self.ticks_per_radian}

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes an `EncoderReading` from time and values, see `Sampled.reader`."""
        ticks, angles = readings.encoder_ticks[0, vehicle], slice(first, first + 2)
        return lambda time, values: EncoderReading(time, read_only_copy(ticks), values[angles])
