"""Single-point range sensor, ultrasonic or time of flight: the distance to the nearest object in a cone."""

from __future__ import annotations

import math
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import jit_uncounted
from autodrive.base.transforms import Quaternion, Vector, compose, rotate
from autodrive.physics.grid import shapes_near
from autodrive.physics.model import Shapes
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.rays import inverse_range
from autodrive.physics.sensors.sensor import Distance, Mount, Rate, SensorSpec


class RangeSpec(SensorSpec):
    """A range sensor along the x axis of its mount; by default the HC-SR04 (data sheet: 0.02 to 4 m, 15 deg)."""

    mount: Mount = Mount()
    rate: Rate | None = 20.0
    """Sample rate [Hz]; None: one sample per tick."""
    field_of_view_deg: float = Field(default=15.0, ge=0.0, lt=180.0)
    """Full opening angle of the cone [deg]."""
    rings: int = Field(default=3, ge=0, le=20)
    """Rings of rays around the axis: ring k has 8 k rays. More rings detect smaller objects."""
    range_min: Distance = 0.02
    """A smaller distance [m] is reported as -inf (REP 117)."""
    range_max: Distance = 4.0
    """A greater distance [m] is reported as +inf (REP 117)."""
    radiation: Literal["ultrasound", "infrared"] = "ultrasound"
    """Reported only; does not change the distance."""
    sees_ground: bool = False
    """Whether the sensor detects the ground. A smooth floor reflects a beam at a small angle away from the sensor."""
    noise: NoiseSpec = NoiseSpec()
    """Noise of the distance [m]."""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.range_max <= self.range_min:
            raise ValueError(f"range_max {self.range_max:g} m must be above range_min {self.range_min:g} m")
        return self


def directions(field_of_view: float, rings: int) -> Floats:
    """Unit vectors of the rays in sensor axes, shape (n_ray, 3): the axis and rings up to the edge of the cone."""
    rays = [(1.0, 0.0, 0.0)]
    for ring in range(1, rings + 1):
        polar = 0.5 * field_of_view * ring / rings
        for k in range(8 * ring):
            azimuth = 2.0 * math.pi * k / (8 * ring)
            rays.append((cos(polar), sin(polar) * cos(azimuth), sin(polar) * sin(azimuth)))
    return np.array(rays)


@jit_uncounted
def nearest(
    vehicle_position: Floats,
    vehicle_orientation: Floats,
    mount_position: Vector,
    mount_orientation: Quaternion,
    rays: Floats,
    sees_ground: bool,
    range_max: float,
    vehicle: int,
    shapes: Shapes,
    shape_position: Floats,
    shape_rotation: Floats,
    near: Integers,
) -> float:
    """Largest inverse range of all rays [1/m]; 0 if no ray hits, infinity inside a shape or the ground.

    `near` is working memory, shape (n_shape,).
    """
    lever = rotate(vehicle_orientation, mount_position)
    px, py, pz = vehicle_position[0] + lever[0], vehicle_position[1] + lever[1], vehicle_position[2] + lever[2]
    map_from_sensor = compose(vehicle_orientation, mount_orientation)
    if pz <= 0.0:
        return math.inf
    nearest = 0.0
    found = shapes_near(shapes, px, py, range_max, near)
    for i in range(len(rays)):
        ray = rotate(map_from_sensor, (rays[i, 0], rays[i, 1], rays[i, 2]))
        if sees_ground:
            nearest = max(nearest, -ray[2] / pz)
        nearest = max(
            nearest,
            inverse_range((px, py, pz), ray, range_max, vehicle, shapes, shape_position, shape_rotation, near, found),
        )
    return nearest
