"""Incremental encoders on the two rear motors: counts, and the angle that they stand for (report, table 4)."""

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
"""Rear left among a vehicle's four wheels; rear right follows."""


class EncoderSpec(SensorSpec):
    """Two encoders, each on the shaft of a rear motor."""

    pulses_per_revolution: int = Field(default=16, gt=0)
    """Pulses in one revolution of the motor's shaft."""
    gear_ratio: float = Field(default=120.0, gt=0.0)
    """Revolutions of the motor's shaft in one revolution of the wheel."""
    noise: NoiseSpec = NoiseSpec()
    """Jitter of the wheel's angle [rad] before it is counted, for example the play of the gear."""


class Encoders(Sensor[EncoderReading]):
    """Counts whole pulses toward zero, never wraps; the angle is that of the counts."""

    def __init__(self, spec: EncoderSpec) -> None:
        self._noise = Noise.of((spec.noise, 2))
        super().__init__(self._noise)
        self._ticks_per_radian = spec.pulses_per_revolution * spec.gear_ratio / (2.0 * math.pi)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> EncoderReading:
        """Counts and angles since reset."""
        angles = state.wheel_rotation[4 * vehicle + REAR_LEFT : 4 * vehicle + REAR_LEFT + 2].copy()
        if self._noise is not None:
            self._noise.add(angles, time)
        ticks = (angles * self._ticks_per_radian).astype(np.int64)  # rounds toward zero
        angles = ticks / self._ticks_per_radian
        angles.setflags(write=False)
        ticks.setflags(write=False)
        return EncoderReading(time, ticks, angles)
