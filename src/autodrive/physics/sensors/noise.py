"""Noise of sensors that report a few numbers: white noise, offset, bias walk and resolution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Field

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit_uncounted, resolved
from autodrive.base.specs import Spec
from autodrive.physics.sensors.random_stream import Stream, new_stream, normal

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


class Noise:
    """Noise of all channels of a sensor that is written in Python: a random stream and the current bias."""

    def __init__(self, *channels: tuple[NoiseSpec, int]) -> None:
        """Each argument: the noise of a quantity, and its number of channels."""
        self._spec = np.array([(s.sigma, s.offset, s.walk, s.step) for s, count in channels for _ in range(count)])
        self._bias = np.zeros(len(self._spec))
        self._time = 0.0
        self._stream = new_stream(np.random.default_rng())
        self._compiled: Callable[..., None] | None = None

    @classmethod
    def of(cls, *channels: tuple[NoiseSpec, int]) -> Noise | None:
        """None if no channel has noise."""
        return None if all(spec.is_silent for spec, _ in channels) else cls(*channels)

    def reset(self, rng: np.random.Generator) -> None:
        """Draw new offsets."""
        self._stream = new_stream(rng)
        self._time = 0.0
        for i, offset in enumerate(self._spec[:, 1].tolist()):
            self._bias[i] = offset * normal(self._stream)

    def add(self, values: Floats, time: float) -> None:
        """Add the noise at `time` [s] to the true values, shape (n,), in place."""
        arguments = values, self._spec, self._bias, self._stream, max(time - self._time, 0.0)
        if self._compiled is None:
            self._compiled = resolved(corrupt, *arguments)
        self._compiled(*arguments)
        self._time = time

    def save(self) -> Any:
        """The bias, its time, and the state of the random stream."""
        return self._bias.copy(), self._time, self._stream.copy()

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        bias, self._time, stream = saved
        self._bias[:], self._stream[:] = bias, stream


@jit_uncounted
def corrupt(values: Floats, spec: Floats, bias: Floats, stream: Stream, elapsed: float) -> None:
    """Add noise to `values`, shape (n,), `elapsed` [s] after the last sample; the columns of `spec` are NoiseSpec's."""
    for i in range(len(values)):
        sigma, walk, step = spec[i, 0], spec[i, 2], spec[i, 3]
        bias[i] += walk * np.sqrt(elapsed) * normal(stream)
        values[i] += bias[i] + sigma * normal(stream)
        if step > 0.0:
            values[i] = step * np.round(values[i] / step)
