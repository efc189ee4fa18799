"""What a sensor is: where it is mounted, when it is due, what it draws its noise from, and `sample`."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from math import hypot, radians
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from pydantic import Field, model_validator

from autodrive.descriptions import Spec
from autodrive.model import Shapes
from autodrive.state import State
from autodrive.transforms import Quaternion, Vector, quaternion_from_euler


class Mount(Spec):
    """Where a part sits: the pose of its frame (x forward, y left, z up) in the vehicle frame."""

    position: Vector = (0.0, 0.0, 0.0)
    """[m], from the centre of the rear axle."""
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    """Roll, pitch, yaw [deg], R = Rz(yaw) Ry(pitch) Rx(roll); positive pitch looks down, positive yaw to the left."""
    quaternion: Quaternion | None = None
    """The same rotation as a quaternion wxyz; give one of the two."""

    @model_validator(mode="after")
    def _has_one_rotation(self) -> Self:
        if self.quaternion is None:
            return self
        if any(self.rotation_deg):
            raise ValueError("a mount is turned by rotation_deg or by quaternion, not by both")
        if abs(hypot(*self.quaternion) - 1.0) > 1e-3:
            raise ValueError(f"a quaternion w, x, y, z has length 1, this one {hypot(*self.quaternion):.4g}")
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
    """What every sensor has."""

    rate: float | None = Field(default=None, gt=0.0)
    """Samples a second [Hz]; none: one every tick. No sensor samples more often than once a tick."""


@dataclass(frozen=True)
class Schedule:
    """When samples are due: the n-th at the first tick whose time is at least n / rate.

    Time is counted in substeps and compared as integers, so that no rounding error gathers. `n` starts at `first`:
    0 for what is known at the start, 1 for what takes a period to measure.
    """

    samples: int
    """`samples` samples in ..."""
    substeps: int
    """... `substeps` substeps."""
    first: int = 0

    @classmethod
    def of(cls, rate: float | Fraction, substep: Fraction, first: int = 0) -> Schedule:
        """Schedule of `rate` [Hz] in a world whose substep lasts `substep` [s].

        A float stands for the decimal fraction that it prints as: 0.1 is one tenth.
        """
        samples_per_substep = Fraction(str(rate)) * substep
        return cls(samples_per_substep.numerator, samples_per_substep.denominator, first)

    def is_due(self, now: int, before: int | None) -> bool:
        """Whether a sample fell due after `before` and until `now` [substeps]; `before` is None at the start."""
        newest = now * self.samples // self.substeps
        previous = -1 if before is None else before * self.samples // self.substeps
        return newest >= self.first and newest > previous


R = TypeVar("R")


class Errors(Protocol):
    """What a sensor draws its noise from."""

    def reset(self, rng: np.random.Generator) -> None:
        """Begin a new stream, and draw what stays until the next reset."""
        ...

    def save(self) -> Any:
        """Everything that the future depends on."""
        ...

    def restore(self, saved: Any) -> None:
        """Go on from there."""
        ...


class Sensor(ABC, Generic[R]):
    """Measures one thing of one vehicle; `latest` is the newest reading, None before the first."""

    def __init__(self, errors: Errors | None) -> None:
        self._errors = errors
        self.latest: R | None = None

    def reset(self, rng: np.random.Generator) -> None:
        """Forget everything, and draw all noise from `rng` from now on."""
        self.latest = None
        if self._errors is not None:
            self._errors.reset(rng)

    @abstractmethod
    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> R | None:
        """The reading of vehicle number `vehicle` at `time` [s]; None while the first is not complete."""

    @property
    def reading(self) -> R:
        """The newest reading, of a sensor that has sampled."""
        assert self.latest is not None
        return self.latest

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return self.latest, None if self._errors is None else self._errors.save()

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        self.latest, errors = saved
        if self._errors is not None:
            self._errors.restore(errors)


def random_generator(seed: int, vehicle: str, sensor: str) -> np.random.Generator:
    """The stream of one sensor: it depends on these three and on nothing else in the world."""
    key = [int.from_bytes(hashlib.blake2b(name.encode(), digest_size=16).digest()) for name in (vehicle, sensor)]
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
