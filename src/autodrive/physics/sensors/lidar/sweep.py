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
from autodrive.physics.sensors.columns import StatePoses


class Timing(NamedTuple):
    """When rays are cast: the last one of scan n at n / rate, each earlier one `time_increment` before the next."""

    rate: float
    """[Hz]."""
    time_increment: float
    """[s]."""


class RollingScan(NamedTuple):
    """A scan whose rays are cast one after another: where the LIDAR is, its rays, and what they hit."""

    vehicle: int
    """Number of the vehicle that carries the LIDAR; rays pass through its shapes."""
    mount_position: Vector
    """Position of the LIDAR in the vehicle frame [m]."""
    mount_orientation: Quaternion
    """Rotation from the LIDAR to the vehicle frame."""
    cosines: Floats
    """Cosines of the bearings of the rays, shape (n_ray,)."""
    sines: Floats
    """Sines of the bearings of the rays, shape (n_ray,)."""
    range_max: float
    """Shapes farther away may be ignored [m]."""
    inverse_range: Floats
    """Inverse range of each ray [1/m], which is written, shape (n_ray,)."""
    hits: Integers
    """Number of the shape that each ray hits, -1 for the ground, which is written, shape (n_ray,)."""


@jit_uncounted
def cast_sweep(
    scan: RollingScan,
    timing: Timing,
    number: int,
    first: int,
    before: StatePoses,
    time_before: float,
    after: StatePoses,
    time: float,
    shapes: ShapeTable,
    near: Integers,
) -> int:
    """Write what the rays of a scan hit that are due at `time` [s], from `first` on; return the next ray.

    See `fan.cast_fan` for all rays at one instant. `number`: that of the scan. `before` and `after`: poses at
    `time_before` [s] and at `time`. The vehicle rotates at a constant rate in between. Position and rotation matrix of
    a moving shape are interpolated linearly; for a rotation of 0.01 rad per tick the error is 1e-5 of its size.
    """
    kind, size, rays = shapes.kind, shapes.size, len(scan.inverse_range)
    position_before, position = before.position[scan.vehicle], after.position[scan.vehicle]
    orientation_before, orientation = before.orientation[scan.vehicle], after.orientation[scan.vehicle]
    mount = scan.mount_position
    # the sensor is at most the length of its lever away from the vehicle's origin, which moves on a line
    dx, dy = position[0] - position_before[0], position[1] - position_before[1]
    way = math.sqrt(dx * dx + dy * dy)
    reach = scan.range_max + way + math.sqrt(mount[0] ** 2 + mount[1] ** 2 + mount[2] ** 2)
    near_count = shapes_near(shapes, position[0], position[1], reach, near)
    for i in range(first, rays):
        ray_time = number / timing.rate - timing.time_increment * (rays - 1 - i)
        if ray_time > time + 1e-9:  # tolerates rounding errors of the time
            return i
        # start and direction of the ray in the map, at the fraction f of the tick at which it is cast
        f = min(1.0, max(0.0, (ray_time - time_before) / max(time - time_before, 1e-12)))
        turn = slerp(orientation_before, orientation, f)
        lever = rotate(turn, mount)
        p = (
            position_before[0] + f * (position[0] - position_before[0]) + lever[0],
            position_before[1] + f * (position[1] - position_before[1]) + lever[1],
            position_before[2] + f * (position[2] - position_before[2]) + lever[2],
        )
        ray = rotate(compose(turn, scan.mount_orientation), (scan.cosines[i], scan.sines[i], 0.0))
        nearest = 0.0
        if p[2] <= 0.0:
            nearest = math.inf  # the space below the floor is solid
        elif ray[2] < 0.0:
            nearest = -ray[2] / p[2]
        # the nearest of the shapes, each of which is where it was at that fraction; distances as inverse ranges
        scan.hits[i] = -1
        for k in range(near_count):
            g = near[k]
            if shapes.vehicle[g] == scan.vehicle:
                continue
            start, end = before.shape_position[g], after.shape_position[g]
            dx = start[0] + f * (end[0] - start[0]) - p[0]
            dy = start[1] + f * (end[1] - start[1]) - p[1]
            dz = start[2] + f * (end[2] - start[2]) - p[2]
            if misses_sphere((dx, dy, dz), ray, float(shapes.bounding_radius[g]), scan.range_max):
                continue
            w = inverse_distance(
                int(kind[g]),
                (size[g, 0], size[g, 1], size[g, 2]),
                _in_shape(before.shape_rotation[g], after.shape_rotation[g], f, (-dx, -dy, -dz)),
                _in_shape(before.shape_rotation[g], after.shape_rotation[g], f, ray),
            )
            if w > nearest:
                nearest, scan.hits[i] = w, g
        scan.inverse_range[i] = nearest
    return rays


@jit_uncounted
def _in_shape(before: Floats, after: Floats, fraction: float, v: Vector) -> Vector:
    """Transform a vector from the map frame to the axes of a shape, shapes (9,), at that fraction of the tick."""
    x = y = z = 0.0
    for row in range(3):
        k = 3 * row
        x += v[row] * (before[k] + fraction * (after[k] - before[k]))
        y += v[row] * (before[k + 1] + fraction * (after[k + 1] - before[k + 1]))
        z += v[row] * (before[k + 2] + fraction * (after[k + 2] - before[k + 2]))
    return x, y, z
