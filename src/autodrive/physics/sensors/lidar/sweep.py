"""Casts the rays of a rotating 2D LIDAR one after another while the vehicle and the shapes move during a tick."""

from __future__ import annotations

import math
from typing import NamedTuple

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import jit_uncounted
from autodrive.base.transforms import Quaternion, Vector, compose, rotate, slerp
from autodrive.physics.grid import shapes_near
from autodrive.physics.model import ShapeTable
from autodrive.physics.ray import inverse_distance, misses_sphere


class Timing(NamedTuple):
    """When rays are cast: the last one of scan n at n / rate, each earlier one `time_increment` before the next."""

    rate: float
    """[Hz]."""
    time_increment: float
    """[s]."""


@jit_uncounted
def cast_sweep(
    position_before: Floats,
    orientation_before: Floats,
    shape_position_before: Floats,
    shape_rotation_before: Floats,
    position: Floats,
    orientation: Floats,
    shape_position: Floats,
    shape_rotation: Floats,
    mount_position: Vector,
    mount_orientation: Quaternion,
    cosines: Floats,
    sines: Floats,
    timing: Timing,
    scan: int,
    first: int,
    time_before: float,
    time: float,
    range_max: float,
    vehicle: int,
    shapes: ShapeTable,
    near: Integers,
    inverse_range: Floats,
    hits: Integers,
) -> int:
    """Write the inverse range [1/m] of the rays of a scan that are due at `time`, from `first` on; return the next ray.

    Also write the number of the shape that each ray hits, -1 for the ground.

    See `fan.cast_fan` for all rays at one instant. The poses before are those at `time_before` [s]. The vehicle rotates
    at a constant rate in between. Position and rotation matrix of a moving shape are interpolated linearly; for a
    rotation of 0.01 rad per tick the error is 1e-5 of its size.
    """
    kind, size = shapes.kind, shapes.size
    rays = len(inverse_range)
    # the sensor is at most the length of its lever away from the vehicle's origin, which moves on a line
    dx, dy = position[0] - position_before[0], position[1] - position_before[1]
    way = math.sqrt(dx * dx + dy * dy)
    reach = range_max + way + math.sqrt(mount_position[0] ** 2 + mount_position[1] ** 2 + mount_position[2] ** 2)
    near_count = shapes_near(shapes, position[0], position[1], reach, near)
    for i in range(first, rays):
        ray_time = scan / timing.rate - timing.time_increment * (rays - 1 - i)
        if ray_time > time + 1e-9:  # tolerates rounding errors of the time
            return i
        # start and direction of the ray in the map, at the fraction f of the tick at which it is cast
        f = min(1.0, max(0.0, (ray_time - time_before) / max(time - time_before, 1e-12)))
        turn = slerp(orientation_before, orientation, f)
        lever = rotate(turn, mount_position)
        p = (
            position_before[0] + f * (position[0] - position_before[0]) + lever[0],
            position_before[1] + f * (position[1] - position_before[1]) + lever[1],
            position_before[2] + f * (position[2] - position_before[2]) + lever[2],
        )
        ray = rotate(compose(turn, mount_orientation), (cosines[i], sines[i], 0.0))
        nearest = 0.0
        if p[2] <= 0.0:
            nearest = math.inf  # the space below the floor is solid
        elif ray[2] < 0.0:
            nearest = -ray[2] / p[2]
        # the nearest of the shapes, each of which is where it was at that fraction; distances as inverse ranges
        hits[i] = -1
        for k in range(near_count):
            g = near[k]
            if shapes.vehicle[g] == vehicle:
                continue
            dx = shape_position_before[g, 0] + f * (shape_position[g, 0] - shape_position_before[g, 0]) - p[0]
            dy = shape_position_before[g, 1] + f * (shape_position[g, 1] - shape_position_before[g, 1]) - p[1]
            dz = shape_position_before[g, 2] + f * (shape_position[g, 2] - shape_position_before[g, 2]) - p[2]
            if misses_sphere((dx, dy, dz), ray, float(shapes.bounding_radius[g]), range_max):
                continue
            w = inverse_distance(
                int(kind[g]),
                (size[g, 0], size[g, 1], size[g, 2]),
                _in_shape(shape_rotation_before, shape_rotation, g, f, (-dx, -dy, -dz)),
                _in_shape(shape_rotation_before, shape_rotation, g, f, ray),
            )
            if w > nearest:
                nearest, hits[i] = w, g
        inverse_range[i] = nearest
    return rays


@jit_uncounted
def _in_shape(before: Floats, after: Floats, g: int, fraction: float, v: Vector) -> Vector:
    """Transform a vector from the map frame to the axes of shape g at that fraction of the tick."""
    x = y = z = 0.0
    for row in range(3):
        k = 3 * row
        x += v[row] * (before[g, k] + fraction * (after[g, k] - before[g, k]))
        y += v[row] * (before[g, k + 1] + fraction * (after[g, k + 1] - before[g, k + 1]))
        z += v[row] * (before[g, k + 2] + fraction * (after[g, k + 2] - before[g, k + 2]))
    return x, y, z
