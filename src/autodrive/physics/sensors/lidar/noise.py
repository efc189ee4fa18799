"""Noise of LIDAR ranges: white noise that grows with the range, a scale error, resolution, and dropouts."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit_uncounted
from autodrive.base.specs import Spec
from autodrive.physics.sensors.noise import Deviation
from autodrive.physics.sensors.random_stream import Stream, normal, uniform


class LidarNoise(Spec):
    """Noise of a LIDAR, none by default. In a file, `realistic` means that of the LIDAR's `data_sheet`."""

    sigma: Deviation = 0.0
    """Standard deviation of each range [m], independent of the range."""
    relative_sigma: Deviation = 0.0
    """Standard deviation of each range relative to the range; the variances of both are added."""
    scale: Deviation = 0.0
    """Standard deviation of the scale error of all ranges, drawn at reset."""
    step: Deviation = 0.0
    """Resolution of the ranges [m]; 0: unlimited."""
    dropout: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a ray has no return (+inf)."""

    def scaled(self, factor: float) -> LidarNoise:
        """`factor` times the noise; the resolution stays."""
        return self.model_copy(
            update={
                "sigma": factor * self.sigma,
                "relative_sigma": factor * self.relative_sigma,
                "scale": factor * self.scale,
                "dropout": min(1.0, factor * self.dropout),
            }
        )


RPLIDAR_A1M8 = LidarNoise(relative_sigma=0.01 / 3.0, step=0.5e-3, dropout=0.005)
"""Noise of the RPLIDAR A1M8 (data sheet Slamtec LD108).

The distance resolution is below 0.5 mm within 1.5 m, and below 1 % of the distance everywhere. We use a step of 0.5 mm,
and 1 % as three standard deviations. The data sheet has no value for dropouts; 1 in 200 is our choice.
"""


@jit_uncounted
def classify(distance: float, range_min: float, range_max: float) -> float:
    """A measured range as in REP 117: -inf below the minimum range, +inf for no return within the maximum range."""
    if distance < range_min:
        return -math.inf
    return distance if distance <= range_max else math.inf


@jit_uncounted
def measure_with_noise(
    inverse_range: Floats,
    scale: float,
    stream: Stream,
    figures: tuple[float, float, float, float],
    range_min: float,
    range_max: float,
    ranges: Floats,
) -> None:
    """The ranges that a sensor with the noise `figures` (sigma, relative_sigma, step, dropout) reports."""
    sigma, relative_sigma, step, dropout = figures
    for i in range(len(ranges)):
        is_lost, error = uniform(stream) < dropout, normal(stream)
        if is_lost or inverse_range[i] == 0.0:
            ranges[i] = math.inf
            continue
        true = 1.0 / inverse_range[i]
        deviation = relative_sigma * true
        deviation = math.sqrt(sigma * sigma + deviation * deviation)
        distance = true * scale + deviation * error
        if step > 0.0:
            distance = step * np.round(distance / step)
        ranges[i] = classify(distance, range_min, range_max)
