"""Exact ranges of a planar fan of rays against many shapes: one instantaneous scan of a 2D LIDAR.

Only the rays between the two outlines of a shape can hit it (outline.py). Their inverse ranges are written to a buffer
that keeps the largest value, like a depth buffer. Along a straight edge the inverse range is a linear function of the
ray direction (cos, sin), so that a ray costs a few multiplications and a maximum. If the plane of the fan cuts a cap of
a cylinder or a third face of a box, the rays are cast one by one (physics/ray.py).
"""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.base.transforms import Quaternion, Vector, compose, rotate, rotation_from_quaternion
from autodrive.physics.grid import shapes_near
from autodrive.physics.model import BOX, CYLINDER, ShapeTable
from autodrive.physics.ray import inverse_distance
from autodrive.physics.sensors.lidar.outline import (
    AROUND,
    BEARING_ERROR,
    HIDDEN,
    PARTLY,
    bearings_of_disc,
    view_of_box,
    view_of_cylinder,
    view_of_sphere,
)

TURN = 2.0 * math.pi


@jit_uncounted
def cast_fan(
    vehicle_position: Floats,
    vehicle_orientation: Floats,
    mount_position: Vector,
    mount_orientation: Quaternion,
    cosines: Floats,
    sines: Floats,
    angle_min: float,
    angle_increment: float,
    range_max: float,
    vehicle: int,
    shapes: ShapeTable,
    shape_position: Floats,
    shape_rotation: Floats,
    near: Integers,
    views: Floats,
    inverse_range: Floats,
    hits: Integers,
) -> None:
    """Write the inverse range [1/m] of each ray, shape (n_ray,): 0 for no hit, infinity inside a shape.

    Write the number of the shape that it hits to `hits`, or -1, unless `hits` is empty.

    `cosines` and `sines` are those of the ray angles, shape (n_ray,); the angles start at `angle_min` and increase by
    `angle_increment` > 0 [rad]. Shapes of `vehicle` are ignored; shapes beyond `range_max` [m] may be ignored. `near`
    and `views` are working memory, shapes (n_shape,) and (n_shape, 10).

    First all outlines, then all rays: the processor computes several outlines at once, because they have no loops of
    unknown length in between.
    """
    # The sensor in the map: its position p, and the columns x, y, z of its rotation. All rays are in its plane z = 0.
    lever = rotate(vehicle_orientation, mount_position)
    px = vehicle_position[0] + lever[0]
    py = vehicle_position[1] + lever[1]
    pz = vehicle_position[2] + lever[2]
    x0, y0, z0, x1, y1, z1, x2, y2, z2 = rotation_from_quaternion(compose(vehicle_orientation, mount_orientation))
    rays_per_radian = 1.0 / angle_increment
    hits[:] = -1
    if pz <= 0.0:
        inverse_range[:] = math.inf  # the space below the floor is solid
        return
    # A buffer of inverse ranges, of which each surface keeps the greatest, as a depth buffer does. The inverse range of
    # a plane is linear in the cosine and sine of the bearing, so that outlines need no division for each ray.
    _draw_floor(cosines, sines, inverse_range, -x2 / pz, -y2 / pz)
    n = len(inverse_range)
    kind, size = shapes.kind, shapes.size
    first_cos, first_sin, last_cos, last_sin = cosines[0], sines[0], cosines[n - 1], sines[n - 1]
    fan_end = angle_increment * (n - 1) + 2.0 * BEARING_ERROR
    is_wide = angle_increment * (n - 1) >= math.pi
    # Step 1, of each shape near the sensor: the bearings that it covers, and the figures of its outline.
    count = 0
    for k in range(shapes_near(shapes, px, py, range_max, near)):
        g = near[k]
        dx, dy, dz = shape_position[g, 0] - px, shape_position[g, 1] - py, shape_position[g, 2] - pz
        # Leave out shapes whose sphere does not cut the plane of the rays, or is out of range. h: height of the centre
        # above this plane; u, v: its place in the plane, forward and to the left.
        h = dx * z0 + dy * z1 + dz * z2
        radius = shapes.bounding_radius[g]
        reach = range_max + radius
        if abs(h) > radius or dx * dx + dy * dy + dz * dz > reach * reach or shapes.vehicle[g] == vehicle:
            continue
        u, v = dx * x0 + dy * x1 + dz * x2, dx * y0 + dy * y1 + dz * y2
        # beside the fan: to the right of its first ray, or to the left of its last one; both, if it is wider than pi
        is_right = first_sin * u - first_cos * v > radius
        is_left = last_cos * v - last_sin * u > radius
        if (is_right and is_left) if is_wide else (is_right or is_left):
            continue
        # position and axes of the sensor in the axes of the shape
        r0, r1, r2 = shape_rotation[g, 0], shape_rotation[g, 1], shape_rotation[g, 2]
        r3, r4, r5 = shape_rotation[g, 3], shape_rotation[g, 4], shape_rotation[g, 5]
        r6, r7, r8 = shape_rotation[g, 6], shape_rotation[g, 7], shape_rotation[g, 8]
        o = (-(dx * r0 + dy * r3 + dz * r6), -(dx * r1 + dy * r4 + dz * r7), -(dx * r2 + dy * r5 + dz * r8))
        ex = (x0 * r0 + x1 * r3 + x2 * r6, x0 * r1 + x1 * r4 + x2 * r7, x0 * r2 + x1 * r5 + x2 * r8)
        ey = (y0 * r0 + y1 * r3 + y2 * r6, y0 * r1 + y1 * r4 + y2 * r7, y0 * r2 + y1 * r5 + y2 * r8)
        ez = (z0 * r0 + z1 * r3 + z2 * r6, z0 * r1 + z1 * r4 + z2 * r7, z0 * r2 + z1 * r5 + z2 * r8)
        # The shape as seen from the sensor: not at all (HIDDEN), all around (the sensor is in it), an outline, or a
        # cross-section that has no simple outline (PARTLY).
        s = (size[g, 0], size[g, 1], size[g, 2])
        circle = radius * radius - h * h
        if kind[g] == BOX:
            view, start, width, k0, k1, k2, k3, k4, k5, k6, k7 = view_of_box(s, o, ex, ey, ez)
        elif kind[g] == CYLINDER:
            view, start, width, k0, k1, k2, k3, k4, k5, k6, k7 = view_of_cylinder(s[0], s[1], o, ex, ey, ez)
        else:
            view, start, width, k0, k1, k2, k3, k4, k5, k6, k7 = view_of_sphere(u, v, circle)
        if view == HIDDEN:
            continue
        if view == AROUND:
            inverse_range[:] = math.inf
            return
        if view == PARTLY:
            start, width = bearings_of_disc(u, v, math.sqrt(circle))
        # Count bearings from the first ray, and begin in [-2 pi, 0), or a turn later if the shape then ends before it.
        start -= angle_min
        start -= TURN * (math.floor(start * (1.0 / TURN)) + 1.0)
        if start + width < -BEARING_ERROR:
            start += TURN
        # Without an outline, cast each ray within the bearings of the sphere around the shape.
        if view == PARTLY:
            while start < fan_end:
                lo, hi = _rays_between(start, start + width, rays_per_radian, n)
                start += TURN
                for i in range(lo, hi + 1):
                    cos, sin = cosines[i], sines[i]
                    r = (ex[0] * cos + ey[0] * sin, ex[1] * cos + ey[1] * sin, ex[2] * cos + ey[2] * sin)
                    w = inverse_distance(int(kind[g]), s, o, r)
                    if len(hits) > 0 and w > inverse_range[i]:
                        hits[i] = g
                    inverse_range[i] = max(inverse_range[i], w)
            continue
        near[count] = g
        outline = views[count]
        outline[0], outline[1], outline[2], outline[3], outline[4] = start, width, k0, k1, k2
        outline[5], outline[6], outline[7], outline[8], outline[9] = k3, k4, k5, k6, k7
        count += 1
    # Step 2: draw the outlines into the rays between their bearings; one turn farther, too, if the fan reaches so far.
    for k in range(count):
        outline = views[k]
        start, end = outline[0], outline[0] + outline[1]
        while start < fan_end:
            lo, hi = _rays_between(start, end, rays_per_radian, n)
            if kind[near[k]] == BOX:
                _draw_box(cosines, sines, inverse_range, lo, hi, outline)
            else:
                _draw_round(cosines, sines, inverse_range, lo, hi, outline)
            start, end = start + TURN, end + TURN
    if len(hits) > 0:
        _note_hits(cosines, sines, inverse_range, fan_end, rays_per_radian, kind, near, views[:count], hits)


@jit_uncounted
def _note_hits(
    cosines: Floats,
    sines: Floats,
    inverse_range: Floats,
    fan_end: float,
    rays_per_radian: float,
    kind: Integers,
    near: Integers,
    views: Floats,
    hits: Integers,
) -> None:
    """Write the number of the shape to the rays whose inverse range is that of its outline, which has been drawn."""
    for k in range(len(views)):
        outline = views[k]
        start, end = outline[0], outline[0] + outline[1]
        while start < fan_end:
            lo, hi = _rays_between(start, end, rays_per_radian, len(inverse_range))
            for i in range(lo, hi + 1):
                cos, sin = cosines[i], sines[i]
                if kind[near[k]] == BOX:
                    w = min(outline[6] * cos + outline[7] * sin, outline[8] * cos + outline[9] * sin)
                else:
                    m, z = outline[5] * cos + outline[6] * sin, outline[7] * cos + outline[8] * sin
                    w = outline[2] * cos + outline[3] * sin + math.sqrt(max(outline[4] - m * m - z * z, 0.0))
                if abs(w - inverse_range[i]) <= 1e-12 * w:
                    hits[i] = near[k]
            start, end = start + TURN, end + TURN


@inlined
def _rays_between(start: float, end: float, rays_per_radian: float, n: int) -> tuple[int, int]:
    """First and last of `n` rays between two bearings, from that of ray 0 [rad]; the first is greater if none is."""
    lo = max(math.ceil((start - BEARING_ERROR) * rays_per_radian), 0)
    hi = min(math.floor((end + BEARING_ERROR) * rays_per_radian), n - 1)
    return lo, hi


@jit_uncounted
def _draw_floor(cosines: Floats, sines: Floats, inverse_range: Floats, a: float, b: float) -> None:
    """Initialise the buffer with the plane z = 0."""
    for i in range(len(inverse_range)):
        w = a * cosines[i] + b * sines[i]
        inverse_range[i] = w if w > 0.0 else 0.0  # never -0, whose inverse is -inf


@inlined
def _draw_box(cosines: Floats, sines: Floats, inverse_range: Floats, lo: int, hi: int, view: Floats) -> None:
    """Draw a box on the rays `lo` to `hi`; the first and the last ones may miss it."""
    k0, k1, k2, k3, k4, k5, k6, k7 = view[2], view[3], view[4], view[5], view[6], view[7], view[8], view[9]
    while lo <= hi and cosines[lo] * k1 > sines[lo] * k0:
        lo += 1
    while lo <= hi and cosines[hi] * k3 < sines[hi] * k2:
        hi -= 1
    # with indices that cannot be negative, the loop is compiled to vector instructions
    for i in range(np.uint64(lo), np.uint64(hi + 1)):
        cos, sin = cosines[i], sines[i]
        inverse_range[i] = max(inverse_range[i], min(k4 * cos + k5 * sin, k6 * cos + k7 * sin))


@inlined
def _draw_round(cosines: Floats, sines: Floats, inverse_range: Floats, lo: int, hi: int, view: Floats) -> None:
    """Draw a cylinder or a sphere on the rays `lo` to `hi`, some of which may miss it."""
    k0, k1, k2, k3, k4, k5, k6 = view[2], view[3], view[4], view[5], view[6], view[7], view[8]
    for i in range(lo, hi + 1):
        cos, sin = cosines[i], sines[i]
        b = k0 * cos + k1 * sin
        m, z = k3 * cos + k4 * sin, k5 * cos + k6 * sin
        discriminant = k2 - m * m - z * z
        if discriminant >= 0.0 and b > 0.0:
            inverse_range[i] = max(inverse_range[i], b + math.sqrt(discriminant))
