"""Noise of sensors that report a few numbers: white noise, offset, bias walk and resolution."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Field

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit_uncounted
from autodrive.base.specs import Spec
from autodrive.physics.sensors.random_stream import Stream, normal

Deviation: TypeAlias = Annotated[float, Field(ge=0.0, le=1e6)]
"""A standard deviation or a resolution, in the unit of the quantity."""


class NoiseSpec(Spec):
    """Noise of one quantity, in the unit of the quantity and independent for each axis. None by default."""

    sigma: Deviation = 0.0
    """Standard deviation of the white noise of each sample."""
    offset: Deviation = 0.0
    """Standard deviation of the constant offset drawn at reset."""
    walk: Deviation = 0.0
    """Density of the bias walk [unit/sqrt(s)]: after a time t its variance is walk^2 t."""
    step: Deviation = 0.0
    """Resolution of the output; 0: unlimited."""

    @property
    def is_silent(self) -> bool:
        """Whether there is no noise."""
        return not (self.sigma or self.offset or self.walk or self.step)

    def scaled(self, factor: float) -> NoiseSpec:
        """`factor` times the noise; the resolution stays."""
        scaled = {"sigma": factor * self.sigma, "offset": factor * self.offset, "walk": factor * self.walk}
        return self.model_copy(update=scaled)


@jit_uncounted
def corrupt(values: Floats, spec: Floats, bias: Floats, stream: Stream, elapsed: float) -> None:
    """Add noise to `values`, shape (n,), `elapsed` [s] after the last sample; the columns of `spec` are NoiseSpec's."""
    for i in range(len(values)):
        sigma, walk, step = spec[i, 0], spec[i, 2], spec[i, 3]
        bias[i] += walk * np.sqrt(elapsed) * normal(stream)
        values[i] += bias[i] + sigma * normal(stream)
        if step > 0.0:
            values[i] = step * np.round(values[i] / step)
