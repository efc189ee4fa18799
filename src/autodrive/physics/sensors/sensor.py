"""What all sensors have: mount, rate, schedule and random stream."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from fractions import Fraction
from math import hypot, radians
from typing import Annotated, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.specs import Degrees, Offset, Spec
from autodrive.base.transforms import Quaternion, quaternion_from_euler

Rate: TypeAlias = Annotated[float, Field(ge=1e-3, le=1e4)]
"""Samples per second [Hz]."""
Distance: TypeAlias = Annotated[float, Field(ge=0.0, le=1e4)]
"""[m]."""


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


class SensorSpec(Spec):
    """Fields of every sensor."""

    rate: Rate | None = None
    """Sample rate [Hz], at most one sample per tick; None: one sample per tick."""


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

        A float is read as the decimal fraction that it prints as: 0.1 is one tenth.
        """
        samples_per_substep = Fraction(str(rate)) * substep
        return cls(samples_per_substep.numerator, samples_per_substep.denominator)

    def is_due(self, now: int, before: int | None) -> bool:
        """Whether a sample is due in the interval (before, now] [substeps]; `before` is None at the start."""
        newest = now * self.samples // self.substeps
        previous = -1 if before is None else before * self.samples // self.substeps
        return newest > previous


def random_generator(seed: int, vehicle: str, sensor: str) -> np.random.Generator:
    """The random stream of one sensor; depends on the three arguments only."""
    key = [int.from_bytes(hashlib.blake2b(name.encode(), digest_size=16).digest()) for name in (vehicle, sensor)]
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
