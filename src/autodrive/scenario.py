"""ScenarioSpec: what to run: a map, vehicles at their places, boxes, light, tick and seed."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator, model_validator

from autodrive.descriptions import Spec, read


class VehiclePlacement(Spec):
    """A vehicle, standing on the ground at the start."""

    type: str = "nigel"
    """Name or file of the VehicleSpec."""
    x: float = 0.0
    """Of the rear axle's centre [m]."""
    y: float = 0.0
    """[m]."""
    yaw_deg: float = 0.0
    """Heading, left positive [degree]."""
    has_realistic_sensors: bool = False
    """True: the sensors err as their data sheets say, whatever noise the vehicle's file gives them."""
    is_autonomous: bool = True
    """Whether a script drives it at the start; else a person."""

    @property
    def yaw(self) -> float:
        """[rad]."""
        return math.radians(self.yaw_deg)


class BoxSpec(Spec):
    """A movable box besides those of the map."""

    x: float
    """Centre [m]."""
    y: float
    """Centre [m]."""
    z: float | None = None
    """Centre [m]; left out: it stands on the ground."""
    yaw_deg: float = 0.0
    """[degree]."""
    size: tuple[float, float, float] = (0.1, 0.1, 0.1)
    """Length, width, height [m]."""
    mass: float = Field(default=0.1, gt=0)
    """[kg]."""

    @field_validator("size")
    @classmethod
    def _positive(cls, size: tuple[float, float, float]) -> tuple[float, float, float]:
        if min(size) <= 0.0:
            raise ValueError("length, width and height must all be greater than 0 m")
        return size

    @model_validator(mode="after")
    def _above_ground(self) -> BoxSpec:
        if self.z is not None and self.z < self.size[2] / 2 - 1e-6:
            raise ValueError(f"z is the height of its centre, at least half its height of {self.size[2]} m")
        return self


class ScenarioSpec(Spec):
    """Everything that decides how a run begins; the rest is commands."""

    title: str = ""
    """For people."""
    map: str = "plane"
    """Name or file of the MapSpec."""
    vehicles: dict[str, VehiclePlacement] = Field(default_factory=lambda: {"V1": VehiclePlacement()})
    """By name; the devkit knows them as V1, V2, ..."""
    boxes: dict[str, BoxSpec] = Field(default_factory=dict)
    """By name."""
    scene_light: bool = True
    """True: day; False: night."""
    tick: float = Field(default=0.01, gt=0, le=0.1)
    """Simulated time between Frames [s]."""
    substep: float = Field(default=0.001, gt=0, le=0.005)
    """Step of the physics [s]; a whole number of them is a tick."""
    gravity: float = Field(default=9.81, ge=0)
    """[m/s^2]."""
    command_timeout: float = Field(default=0.5, gt=0)
    """A command older than this [s of simulated time] counts as none: brakes on, steering straight."""
    seed: int = Field(default=0, ge=0)
    """Of all noise."""

    @model_validator(mode="after")
    def _whole_substeps(self) -> ScenarioSpec:
        if (Fraction(str(self.tick)) / Fraction(str(self.substep))).denominator != 1:
            raise ValueError(f"tick {self.tick} s must be a whole number of substeps of {self.substep} s")
        return self

    @field_validator("vehicles", "boxes")
    @classmethod
    def _plain_names(cls, named: dict[str, Any]) -> dict[str, Any]:
        for name in named:
            if not name.isidentifier():
                raise ValueError(f"a name is letters, digits and '_', such as V1 or box_1, not '{name}'")
        return named

    @property
    def substeps(self) -> int:
        """In a tick."""
        return int(Fraction(str(self.tick)) / Fraction(str(self.substep)))


def load_scenario(name: str | Path) -> ScenarioSpec:
    """The scenario of that name, or of that file. Raises `SpecError` with all faults."""
    return read("scenario", name, ScenarioSpec)
