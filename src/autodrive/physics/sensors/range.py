"""Single-point range sensor, ultrasonic or time of flight: the distance to the nearest object in a cone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import inlined
from autodrive.base.transforms import compose, rotate
from autodrive.physics.grid import shapes_near
from autodrive.physics.sensors.columns import Due, Memory, ReadingColumns, add_noise, mount_orientation, mount_position
from autodrive.physics.sensors.lidar.noise import classify
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.rays import inverse_range
from autodrive.physics.sensors.sensor import Distance, Mount, Rate, Reader, Sampled, SensorSpec
from autodrive.protocol.messages import RangeReading


def directions(field_of_view: float, rings: int) -> Floats:
    """Unit vectors of the rays in sensor axes, shape (n_ray, 3): the axis and rings up to the edge of the cone."""
    rays = [(1.0, 0.0, 0.0)]
    for ring in range(1, rings + 1):
        polar = 0.5 * field_of_view * ring / rings
        for k in range(8 * ring):
            azimuth = 2.0 * math.pi * k / (8 * ring)
            rays.append((cos(polar), sin(polar) * cos(azimuth), sin(polar) * sin(azimuth)))
    return np.array(rays)


@inlined
def sample(due: Due, values: Floats, row: Any, memory: Memory) -> None:
    """The distance of the nearest thing that any ray hits, with noise, as in REP 117."""
    i, motion, range_max = due.i, memory.motion, row["range_max"]
    lever = rotate(motion.vehicle_orientation[i], mount_position(due, row))
    x, y, z = motion.vehicle_position[i, 0], motion.vehicle_position[i, 1], motion.vehicle_position[i, 2]
    start = (x + lever[0], y + lever[1], z + lever[2])
    map_from_sensor = compose(motion.vehicle_orientation[i], mount_orientation(due, row))
    near, rays = memory.working.near, memory.sensors.rays
    nearest = math.inf  # as an inverse range [1/m]: inside a shape or the ground
    if start[2] > 0.0:
        nearest = 0.0
        count = shapes_near(memory.shapes, start[0], start[1], range_max, near)
        for k in range(row["first"][due.s], row["last"][due.s]):
            ray = rotate(map_from_sensor, (rays[0, k], rays[1, k], rays[2, k]))
            if row["sees_ground"]:
                nearest = max(nearest, -ray[2] / start[2])
            nearest = max(
                nearest,
                inverse_range(
                    start,
                    ray,
                    range_max,
                    i,
                    memory.shapes,
                    motion.shape_position,
                    motion.shape_rotation,
                    near,
                    count,
                ),
            )
    values[0] = math.inf if nearest == 0.0 else 1.0 / nearest
    add_noise(due, memory, values)
    values[0] = classify(values[0], row["range_min"], range_max)


class RangeSpec(SensorSpec, Sampled):
    """A range sensor along the x axis of its mount; by default the HC-SR04 (data sheet: 0.02 to 4 m, 15 deg)."""

    VALUES: ClassVar[int] = 1
    NOISY_VALUES: ClassVar[int] = 1
    COLUMNS: ClassVar[Mapping[str, Any]] = {"sees_ground": np.bool_, "range_min": np.float64, "range_max": np.float64}
    STRONG: ClassVar[float] = 0.05
    sample: ClassVar[Any] = sample

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

    def parameters(self, gravity: float) -> dict[str, Any]:
        """Values of this sensor's columns in `SensorTables.vehicles`, by name."""
        return {"sees_ground": self.sees_ground, "range_min": self.range_min, "range_max": self.range_max}

    def ray_constants(self) -> Floats:
        """The directions of the rays, in the first three rows."""
        rays = directions(math.radians(self.field_of_view_deg), self.rings)
        return np.vstack([rays.T, np.zeros(len(rays))])

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes a `RangeReading` from time and values, see `Sampled.reader`."""
        rest = math.radians(self.field_of_view_deg), self.range_min, self.range_max, self.radiation
        return lambda time, values: RangeReading(time, float(values[first]), *rest)
