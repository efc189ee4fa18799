"""What all sensors have: mount, rate, presets of the noise, schedule and random stream."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import hypot, radians
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats
from autodrive.base.exact_fraction import exact_fraction
from autodrive.base.specs import Degrees, Offset, Spec
from autodrive.base.transforms import Quaternion, quaternion_from_euler
from autodrive.physics.sensors.columns import ReadingColumns
from autodrive.physics.sensors.noise import NoiseSpec

Rate: TypeAlias = Annotated[float, Field(ge=1e-3, le=1e4)]
"""Samples per second [Hz]."""
Distance: TypeAlias = Annotated[float, Field(ge=0.0, le=1e4)]
"""[m]."""


NoisePreset: TypeAlias = Literal["ideal", "file", "realistic", "strong"]
"""'ideal': no noise; 'file': as in the vehicle's file; 'realistic': of the data sheet; 'strong': a multiple."""
STRONG = 5.0
"""Strong noise has this multiple of the standard deviations of the data sheet; resolutions stay."""


class Mount(Spec):
    """Pose of a part's frame (x forward, y left, z up) in the vehicle frame."""

    position: tuple[Offset, Offset, Offset] = (0.0, 0.0, 0.0)
    """[m], from the centre of the rear axle."""
    rotation_deg: tuple[Degrees, Degrees, Degrees] = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw [deg], R = Rz(yaw) Ry(pitch) Rx(roll); positive pitch points down, positive yaw to the left."""
    quaternion: Quaternion | None = None
    """Alternative to `rotation_deg`: unit quaternion wxyz."""

    @model_validator(mode="after")
    def _has_one_rotation(self) -> Self:
        if self.quaternion is None:
            return self
        if any(self.rotation_deg):
            raise ValueError("a mount takes rotation_deg or quaternion, not both")
        if abs(hypot(*self.quaternion) - 1.0) > 1e-3:
            raise ValueError(f"the length of a quaternion w, x, y, z must be 1, not {hypot(*self.quaternion):.4g}")
        return self

    @property
    def orientation(self) -> Quaternion:
        """Quaternion wxyz, vehicle from sensor."""
        if self.quaternion is None:
            roll, pitch, yaw = self.rotation_deg
            return quaternion_from_euler(radians(roll), radians(pitch), radians(yaw))
        w, x, y, z = self.quaternion
        length = hypot(w, x, y, z)
        return w / length, x / length, y / length, z / length


class NoisySpec(Spec):
    """A sensor or camera with presets of its noise."""

    NOISE: ClassVar[str] = "noise"
    """Name of the field with the noise."""
    STRONG: ClassVar[float] = 0.0
    """Strong white noise of a sensor without noise in its data sheet, in the unit of the reading: our choice."""

    @property
    def noises(self) -> dict[NoisePreset, Any]:
        """The noise of each preset but that of the file; 'realistic' only if the data sheet has noise."""
        return {"ideal": NoiseSpec(), "strong": NoiseSpec(sigma=self.STRONG)}

    def with_noise_factor(self, factor: float) -> Self:
        """A copy of the Spec with `factor` times the noise; resolutions stay."""
        if factor == 1.0:
            return self
        return self.model_copy(update={self.NOISE: getattr(self, self.NOISE).scaled(factor)})


class SensorSpec(NoisySpec):
    """Fields of every sensor but the LIDAR."""

    rate: Rate | None = None
    """Sample rate [Hz], at most one sample per tick; None: one sample per tick."""


Reader: TypeAlias = Callable[[float, Floats], Any]
"""Makes the message of a sensor from its time [s] and the vehicle's row of `ReadingColumns.values`."""


class Sampled:
    """What compiled code and Frames need of a sensor: its Spec is a subclass, and has a row in `catalog`."""

    VALUES: ClassVar[int] = 0
    """Number of its values in `ReadingColumns.values`."""
    NOISY_VALUES: ClassVar[int] = 0
    """Number of values that have the noise of a `NoiseSpec` of their own."""
    COLUMNS: ClassVar[Mapping[str, Any]] = {}
    """Columns of `SensorTables.vehicles` that only this sensor has, name -> type."""
    sample: ClassVar[Any]
    """Compiled function that writes a sample into its values, and adds its noise; see `sampling` for its arguments."""

    def parameters(self, gravity: float) -> dict[str, Any]:
        """The values of `COLUMNS`; `gravity` [m/s^2] is positive downward."""
        return {}

    def ray_constants(self) -> Floats:
        """Constants of its rays, as `SensorTables.rays` has them, shape (4, n_ray)."""
        return np.zeros((4, 0))

    def channel_noise(self) -> list[NoiseSpec]:
        """The noise of each channel; one noise is that of all channels."""
        return [self.noise] * self.NOISY_VALUES  # type: ignore[attr-defined]  # pyright: ignore

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes the messages of a sensor of that vehicle in a single world.

        The values of the sensor begin at `first` in the vehicle's row of `ReadingColumns.values`.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Schedule:
    """Times of the samples: sample n is due at the first tick whose time is at least n / rate.

    Time is counted in substeps and compared as integers, so that rounding errors do not accumulate.
    """

    samples: int
    """Numerator of the rate in samples per substep."""
    substeps: int
    """Denominator of the rate in samples per substep."""

    @classmethod
    def of(cls, rate: float | Fraction, substep: Fraction) -> Schedule:
        """Schedule for a `rate` [Hz] and the duration of a `substep` [s].

        A rate of many digits is rounded, so that the numbers of a long run fit into 64 bits.
        """
        samples_per_substep = (exact_fraction(rate) * substep).limit_denominator(10**9)
        return cls(samples_per_substep.numerator, samples_per_substep.denominator)

    def is_due(self, now: int, before: int | None) -> bool:
        """Whether a sample is due in the interval (before, now] [substeps]; `before` is None at the start."""
        newest = now * self.samples // self.substeps
        previous = -1 if before is None else before * self.samples // self.substeps
        return newest > previous


def random_generator(seed: int, vehicle: str, sensor: str) -> np.random.Generator:
    """The random stream of one sensor; depends on the three arguments only."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_key(vehicle), _key(sensor))))


@functools.cache
def _key(name: str) -> int:
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=16).digest())
