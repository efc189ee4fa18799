"""A fan of rays in one plane against many shapes: what a 2D LIDAR sees at one instant, exact and fast.

Each shape is met by few rays: those between its two outlines. What the plane of the fan cuts out of a shape shows one
or two straight edges (box) or an arc (cylinder, sphere); draw.py draws these into a buffer of inverse ranges, in which
the nearest wins, as in a depth buffer.
"""

from __future__ import annotations

import math

from autodrive.jit import jit
from autodrive.model import CYLINDER, SPHERE
from autodrive.sensors.draw import draw_box, draw_cylinder, draw_floor, draw_ray_by_ray, draw_sphere
from autodrive.state import Floats, Integers
from autodrive.transforms import Quaternion, Vector, compose, rotate, rotation_from_quaternion


@jit
def cast_fan(
    vehicle_position: Floats,
    vehicle_orientation: Floats,
    mount_position: Vector,
    mount_orientation: Quaternion,
    directions: Floats,
    angle_min: float,
    angle_increment: float,
    range_max: float,
    vehicle: int,
    kind: Integers,
    size: Floats,
    bounding_radius: Floats,
    shape_vehicle: Integers,
    shape_position: Floats,
    shape_rotation: Floats,
    inverse_range: Floats,
) -> None:
    """Write the inverse range [1/m] of each ray, shape (n_ray,); 0 where nothing is hit.

    `directions` are cos and sin of the rays' angles, shape (2, n_ray), growing by `angle_increment` > 0 from
    `angle_min`. Shapes of `vehicle` itself are not seen; farther ones than `range_max` may be left out.
    """
    lever = rotate(vehicle_orientation, mount_position)
    px = vehicle_position[0] + lever[0]
    py = vehicle_position[1] + lever[1]
    pz = vehicle_position[2] + lever[2]
    turn = rotation_from_quaternion(compose(vehicle_orientation, mount_orientation))
    x0, y0, z0, x1, y1, z1, x2, y2, z2 = turn
    fan = (directions[0], directions[1], angle_min, 1.0 / angle_increment, inverse_range)
    draw_floor(fan, pz, x2, y2)
    for g in range(len(kind)):
        if shape_vehicle[g] == vehicle:
            continue
        dx, dy, dz = shape_position[g, 0] - px, shape_position[g, 1] - py, shape_position[g, 2] - pz
        h = dx * z0 + dy * z1 + dz * z2
        radius = bounding_radius[g]
        reach = range_max + radius
        if abs(h) > radius or dx * dx + dy * dy + dz * dz > reach * reach:
            continue
        u, v = dx * x0 + dy * x1 + dz * x2, dx * y0 + dy * y1 + dz * y2
        if kind[g] == SPHERE:
            draw_sphere(fan, u, v, radius * radius - h * h)
            continue
        # the sensor's place and axes in the shape's own axes
        r = shape_rotation[g]
        o = (
            -(dx * r[0] + dy * r[3] + dz * r[6]),
            -(dx * r[1] + dy * r[4] + dz * r[7]),
            -(dx * r[2] + dy * r[5] + dz * r[8]),
        )
        ex = (x0 * r[0] + x1 * r[3] + x2 * r[6], x0 * r[1] + x1 * r[4] + x2 * r[7], x0 * r[2] + x1 * r[5] + x2 * r[8])
        ey = (y0 * r[0] + y1 * r[3] + y2 * r[6], y0 * r[1] + y1 * r[4] + y2 * r[7], y0 * r[2] + y1 * r[5] + y2 * r[8])
        ez = (z0 * r[0] + z1 * r[3] + z2 * r[6], z0 * r[1] + z1 * r[4] + z2 * r[7], z0 * r[2] + z1 * r[5] + z2 * r[8])
        s = (size[g, 0], size[g, 1], size[g, 2])
        if kind[g] == CYLINDER:
            is_drawn = draw_cylinder(fan, s[0], s[1], o, ex, ey, ez)
        else:
            is_drawn = draw_box(fan, s, o, ex, ey, ez)
        if not is_drawn:
            draw_ray_by_ray(fan, kind[g], s, o, ex, ey, u, v, math.sqrt(radius * radius - h * h))
