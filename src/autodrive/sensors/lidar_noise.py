"""Errors of a LIDAR's ranges: noise that grows with the range, a common scale, steps, and returns that are lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from autodrive.descriptions import Spec
from autodrive.jit import jit
from autodrive.state import Floats


class LidarNoise(Spec):
    """Noise of a LIDAR. Nothing by default. In a file, the word `realistic` stands for `LidarNoise.realistic()`."""

    sigma: NonNegativeFloat = 0.0
    """Standard deviation of each range [m], near."""
    relative_sigma: NonNegativeFloat = 0.0
    """Standard deviation of each range as a share of it, far; the two add as variances."""
    scale: NonNegativeFloat = 0.0
    """Standard deviation of a scale error that all ranges share, drawn at reset."""
    step: NonNegativeFloat = 0.0
    """Smallest difference of two ranges [m]; 0: none."""
    dropout: float = Field(default=0.0, ge=0.0, le=1.0)
    """Share of the rays whose return is lost (+inf)."""

    @classmethod
    def realistic(cls) -> LidarNoise:
        """RPLIDAR A1M8 by its data sheet (Slamtec LD108).

        Distance resolution is below 0.5 mm within 1.5 m, and below 1 % of the distance everywhere; this is read as a
        step of 0.5 mm and as three standard deviations. The sheet has no figure for lost returns; one in two hundred
        is our choice.
        """
        return cls(relative_sigma=0.01 / 3.0, step=0.5e-3, dropout=0.005)

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        return cls.realistic().model_dump() if value == "realistic" else value


class LidarErrors:
    """What one LIDAR draws its errors from."""

    def __init__(self, spec: LidarNoise, rays: int) -> None:
        self._figures = spec.sigma, spec.relative_sigma, spec.step, spec.dropout
        self._scale_sigma = spec.scale
        self._scale = 1.0
        self._normals = np.empty(rays)
        self._uniforms = np.empty(rays)
        self._rng = np.random.default_rng()

    def reset(self, rng: np.random.Generator) -> None:
        """Draw a new scale."""
        self._rng = rng
        self._scale = 1.0 + self._scale_sigma * rng.standard_normal()

    def measure(self, inverse_range: Floats, range_min: float, range_max: float, ranges: Floats) -> None:
        """Write the ranges [m] that the sensor reports, shape (n_ray,)."""
        self._rng.standard_normal(out=self._normals)
        self._rng.random(out=self._uniforms)
        _measure(inverse_range, self._scale, self._normals, self._uniforms, self._figures, range_min, range_max, ranges)

    def save(self) -> Any:
        """The scale and the place in the stream."""
        return self._scale, self._rng.bit_generator.state

    def restore(self, saved: Any) -> None:
        """Go on from there."""
        self._scale, self._rng.bit_generator.state = saved


@jit
def classify(distance: float, range_min: float, range_max: float) -> float:
    """A measured range by REP 117: -inf is too near to measure, +inf is nothing within reach."""
    if distance < range_min:
        return -math.inf
    return distance if distance <= range_max else math.inf


@jit
def _measure(
    inverse_range: Floats,
    scale: float,
    normals: Floats,
    uniforms: Floats,
    figures: tuple[float, float, float, float],
    range_min: float,
    range_max: float,
    ranges: Floats,
) -> None:
    sigma, relative_sigma, step, dropout = figures
    for i in range(len(ranges)):
        if uniforms[i] < dropout or inverse_range[i] == 0.0:
            ranges[i] = math.inf
            continue
        true = 1.0 / inverse_range[i]
        distance = true * scale + math.hypot(sigma, relative_sigma * true) * normals[i]
        if step > 0.0:
            distance = step * np.round(distance / step)
        ranges[i] = classify(distance, range_min, range_max)
