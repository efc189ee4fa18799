"""Incremental encoders on the two rear motors: counts, and the corresponding wheel angles (report, table 4)."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from autodrive.model import Shapes
from autodrive.protocol.messages import EncoderReading
from autodrive.sensors.noise import Noise, NoiseSpec
from autodrive.sensors.sensor import Sensor, SensorSpec
from autodrive.state import State

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


class Encoders(Sensor[EncoderReading]):
    """Counts are rounded toward zero and never wrap; angles are computed from the counts."""

    def __init__(self, spec: EncoderSpec) -> None:
        self._noise = Noise.of((spec.noise, 2))
        super().__init__(self._noise)
        self._ticks_per_radian = spec.pulses_per_revolution * spec.gear_ratio / (2.0 * math.pi)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> EncoderReading:
        """Counts and angles since reset."""
        angles = state.wheel_rotation[4 * vehicle + REAR_LEFT : 4 * vehicle + REAR_LEFT + 2]
        if self._noise is not None:
            angles = angles.copy()
            self._noise.add(angles, time)
        left, right = angles.tolist()
        counts = int(left * self._ticks_per_radian), int(right * self._ticks_per_radian)  # rounds toward zero
        ticks = np.array(counts)
        angles = np.array((counts[0] / self._ticks_per_radian, counts[1] / self._ticks_per_radian))
        ticks.setflags(write=False)
        angles.setflags(write=False)
        return EncoderReading(time, ticks, angles)
