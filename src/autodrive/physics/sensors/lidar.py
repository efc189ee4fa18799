"""2D LIDAR: ranges in the x-y plane of the sensor frame to everything except its own vehicle (report, table 7)."""

from __future__ import annotations

import math
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit_uncounted
from autodrive.base.specs import Spec
from autodrive.physics.sensors.lidar_noise import RPLIDAR_A1M8, LidarNoise, classify
from autodrive.physics.sensors.sensor import Distance, Mount, Rate


class LidarSpec(Spec):
    """A scanning range finder; by default the RPLIDAR A1 of the report.

    The rays cover one revolution, or `angle_min_deg` to `angle_max_deg`, or are `angle_increment_deg` apart. Ray 0 has
    the bearing `angle_min_deg`; 0 is straight ahead. The index increases to the left, or to the right if angle_max is
    below angle_min or the increment is negative.
    """

    mount: Mount = Mount()
    """Centre and axes of the scan."""
    rate: Rate = 7.0
    """Scan rate [Hz]; the first scan is complete at the start."""
    rays: int = Field(default=360, ge=1, le=10_000)
    """Number of rays in a scan."""
    angle_min_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Bearing of the first ray [deg], left positive."""
    angle_max_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Bearing of the last ray [deg]."""
    angle_increment_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Angle between successive rays [deg]; alternative to `angle_max_deg`."""
    range_min: Distance = 0.15
    """A smaller range [m] is reported as -inf (REP 117)."""
    range_max: Distance = 12.0
    """A greater range [m] is reported as +inf (REP 117)."""
    intensity: float = Field(default=47.0, ge=0.0, le=1e6)
    """Constant value that is reported for every ray."""
    is_rolling: bool = False
    """False: all rays at one instant. True: each ray at its own time; the head makes one revolution per period."""
    noise: LidarNoise = LidarNoise()
    """Noise of the ranges; `realistic`: that of the data sheet."""
    data_sheet: LidarNoise = RPLIDAR_A1M8
    """Noise of the data sheet, which the preset `realistic` of a scenario selects; by default of the RPLIDAR A1M8."""

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("noise") == "realistic":
            return value | {"noise": value.get("data_sheet", RPLIDAR_A1M8)}
        return value

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.range_max <= self.range_min:
            raise ValueError(f"range_max {self.range_max:g} m must be above range_min {self.range_min:g} m")
        if self.angle_max_deg is not None and self.angle_increment_deg is not None:
            raise ValueError("a LIDAR takes angle_max_deg or angle_increment_deg, not both")
        if self.angle_max_deg is not None and self.rays == 1:
            raise ValueError("a LIDAR with one ray takes angle_min_deg only, not angle_max_deg")
        if abs(self.angle_increment) < 1e-6:
            raise ValueError("the angle between the rays must not be 0: it must be at least 1e-6 rad, or 6e-5 deg")
        if abs(self.angle_increment) * (self.rays - 1) > 2.0 * math.pi * (1.0 + 1e-9):
            spread = math.degrees(abs(self.angle_increment) * (self.rays - 1))
            raise ValueError(f"the rays must cover at most 360 deg, not {spread:g} deg")
        return self

    @property
    def angle_min(self) -> float:
        """Bearing of ray 0 [rad]."""
        return math.radians(self.angle_min_deg)

    @property
    def angle_increment(self) -> float:
        """Angle between successive rays [rad]."""
        if self.angle_max_deg is not None:
            return math.radians(self.angle_max_deg - self.angle_min_deg) / (self.rays - 1)
        if self.angle_increment_deg is not None:
            return math.radians(self.angle_increment_deg)
        return 2.0 * math.pi / self.rays

    @property
    def time_increment(self) -> float:
        """Time between successive rays [s]; 0 if all are cast at one instant."""
        return abs(self.angle_increment) / (2.0 * math.pi * self.rate) if self.is_rolling else 0.0


def scan_constants(spec: LidarSpec) -> tuple[Any, ...]:
    """The fields of a `LidarScan` that are the same in every scan: all after `ranges`."""
    intensities = np.full(spec.rays, spec.intensity)
    intensities.flags.writeable = False
    return (
        intensities,
        spec.angle_min,
        spec.angle_increment,
        spec.range_min,
        spec.range_max,
        spec.rate,
        1.0 / spec.rate,
        spec.time_increment,
    )


@jit_uncounted
def measure(inverse_range: Floats, range_min: float, range_max: float, ranges: Floats) -> None:
    """The ranges that a sensor without noise reports."""
    for i in range(len(ranges)):
        ranges[i] = classify(1.0 / inverse_range[i], range_min, range_max)
