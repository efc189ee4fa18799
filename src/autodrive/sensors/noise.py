"""Noise of sensors that report a few numbers: white noise, an offset, a bias walk, and the steps of a converter."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import NonNegativeFloat

from autodrive.descriptions import Spec
from autodrive.jit import jit
from autodrive.state import Floats


class NoiseSpec(Spec):
    """Noise of one quantity, in its own unit; every axis has its own. Nothing by default."""

    sigma: NonNegativeFloat = 0.0
    """Standard deviation of the white noise of each sample."""
    offset: NonNegativeFloat = 0.0
    """Standard deviation of the constant offset drawn at reset."""
    walk: NonNegativeFloat = 0.0
    """Density of the bias walk [unit/sqrt(s)]: after a time t its variance is walk^2 t."""
    step: NonNegativeFloat = 0.0
    """Smallest difference that the output shows; 0: none."""

    @property
    def is_silent(self) -> bool:
        """Whether it changes nothing."""
        return not (self.sigma or self.offset or self.walk or self.step)


class Noise:
    """The noise of one sensor's channels: a stream of numbers and a bias that it carries along."""

    def __init__(self, *channels: tuple[NoiseSpec, int]) -> None:
        """Each entry is a quantity and how many numbers report it."""
        self._spec = np.array([(s.sigma, s.offset, s.walk, s.step) for s, count in channels for _ in range(count)])
        self._bias = np.zeros(len(self._spec))
        self._normals = np.empty((2, len(self._spec)))
        self._time = 0.0
        self._rng = np.random.default_rng()

    @classmethod
    def of(cls, *channels: tuple[NoiseSpec, int]) -> Noise | None:
        """None where nothing is noisy."""
        return None if all(spec.is_silent for spec, _ in channels) else cls(*channels)

    def reset(self, rng: np.random.Generator) -> None:
        """Draw new offsets."""
        self._rng = rng
        self._time = 0.0
        self._bias[:] = self._spec[:, 1] * rng.standard_normal(len(self._spec))

    def add(self, values: Floats, time: float) -> None:
        """Change the true values, shape (n,), into what the sensor reports at `time` [s]."""
        self._rng.standard_normal(out=self._normals)
        _corrupt(values, self._spec, self._bias, self._normals, max(time - self._time, 0.0))
        self._time = time

    def save(self) -> Any:
        """The bias, its time, and the place in the stream."""
        return self._bias.copy(), self._time, self._rng.bit_generator.state

    def restore(self, saved: Any) -> None:
        """Go on from there."""
        bias, self._time, stream = saved
        self._bias[:] = bias
        self._rng.bit_generator.state = stream


@jit
def _corrupt(values: Floats, spec: Floats, bias: Floats, normals: Floats, elapsed: float) -> None:
    for i in range(len(values)):
        sigma, walk, step = spec[i, 0], spec[i, 2], spec[i, 3]
        bias[i] += walk * np.sqrt(elapsed) * normals[0, i]
        values[i] += bias[i] + sigma * normals[1, i]
        if step > 0.0:
            values[i] = step * np.round(values[i] / step)
