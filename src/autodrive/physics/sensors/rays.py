"""Single rays from a vehicle to everything except itself."""

from __future__ import annotations

import math

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.base.transforms import Vector, rotate
from autodrive.physics.grid import shapes_near
from autodrive.physics.model import ShapeTable
from autodrive.physics.ray import inverse_distance, misses_sphere


@jit_uncounted
def cast_rays(
    vehicle_position: Floats,
    vehicle_orientation: Floats,
    origins: Floats,
    directions: Floats,
    range_max: float,
    vehicle: int,
    shapes: ShapeTable,
    shape_position: Floats,
    shape_rotation: Floats,
    near: Integers,
    ranges: Floats,
) -> None:
    """Write the range [m] of each ray, shape (n,): infinity beyond `range_max`, 0 inside a shape or the ground.

    `origins` [m] and `directions` (unit vectors), shape (n, 3), are in the frame of the vehicle, whose own shapes no
    ray hits. `near` is working memory, shape (n_shape,).
    """
    for i in range(len(ranges)):
        lever = rotate(vehicle_orientation, (origins[i, 0], origins[i, 1], origins[i, 2]))
        ray = rotate(vehicle_orientation, (directions[i, 0], directions[i, 1], directions[i, 2]))
        px, py, pz = vehicle_position[0] + lever[0], vehicle_position[1] + lever[1], vehicle_position[2] + lever[2]
        if pz <= 0.0:
            ranges[i] = 0.0
            continue
        count = shapes_near(shapes, px, py, range_max, near)
        w = inverse_range((px, py, pz), ray, range_max, vehicle, shapes, shape_position, shape_rotation, near, count)
        w = max(w, -ray[2] / pz)
        ranges[i] = 1.0 / w if w * range_max >= 1.0 else math.inf


@inlined
def inverse_range(
    origin: Vector,
    ray: Vector,
    range_max: float,
    vehicle: int,
    shapes: ShapeTable,
    shape_position: Floats,
    shape_rotation: Floats,
    near: Integers,
    count: int,
) -> float:
    """Inverse range [1/m] of a ray to the first `count` shapes in `near`; 0: none, infinity: inside one.

    Shapes of `vehicle` are left out.
    """
    px, py, pz = origin
    kind, size = shapes.kind, shapes.size
    nearest = 0.0
    for k in range(count):
        g = near[k]
        if shapes.vehicle[g] == vehicle:
            continue
        dx, dy, dz = shape_position[g, 0] - px, shape_position[g, 1] - py, shape_position[g, 2] - pz
        if misses_sphere((dx, dy, dz), ray, float(shapes.bounding_radius[g]), range_max):
            continue
        w = inverse_distance(
            int(kind[g]),
            (size[g, 0], size[g, 1], size[g, 2]),
            _in_shape(shape_rotation, g, (-dx, -dy, -dz)),
            _in_shape(shape_rotation, g, ray),
        )
        nearest = max(nearest, w)
    return nearest


@jit_uncounted
def _in_shape(rotation: Floats, g: int, v: Vector) -> Vector:
    """Transform a vector from the map frame to the axes of shape g."""
    return (
        v[0] * rotation[g, 0] + v[1] * rotation[g, 3] + v[2] * rotation[g, 6],
        v[0] * rotation[g, 1] + v[1] * rotation[g, 4] + v[2] * rotation[g, 7],
        v[0] * rotation[g, 2] + v[1] * rotation[g, 5] + v[2] * rotation[g, 8],
    )
