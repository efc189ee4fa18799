"""Exact intersections of a ray with solid boxes, cylinders and spheres, for wheels and range sensors.

A ray starts at o and runs along the unit vector r. A solid fills the ray from the distance `enter` to the distance
`leave` [m]; the ray misses it if `leave` is less than `enter` or negative, and starts inside if `enter` is negative.
"""

from __future__ import annotations

from math import inf, sqrt

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined
from autodrive.base.transforms import Vector
from autodrive.physics.model import BOX, CYLINDER

MISS = 1.0e30
"""Distance of a ray that hits nothing [m]."""

PARALLEL = 1e-150
"""A ray whose direction has a component below this never reaches the plane (its square is a subnormal number)."""

ROUND = 3
"""Face of a hit that is not flat; a flat face has the number of the axis that it is perpendicular to."""


@inlined
def cast_ray(
    kind: int, size: Floats, centre: Floats, m: Floats, px: float, py: float, pz: float, ux: float, uy: float, uz: float
) -> tuple[float, float, float, float]:
    """Distance [m] along the unit vector u from p to a shape, and the outward normal there (all in map axes).

    `m` is the shape's rotation matrix (map from shape, row-major, shape (9,)). The distance is `MISS` if the ray misses
    the shape or starts inside it, as in PhysX.
    """
    dx, dy, dz = px - centre[0], py - centre[1], pz - centre[2]
    o = (
        m[0] * dx + m[3] * dy + m[6] * dz,
        m[1] * dx + m[4] * dy + m[7] * dz,
        m[2] * dx + m[5] * dy + m[8] * dz,
    )
    r = (
        m[0] * ux + m[3] * uy + m[6] * uz,
        m[1] * ux + m[4] * uy + m[7] * uz,
        m[2] * ux + m[5] * uy + m[8] * uz,
    )
    enter, leave, face = _interval(kind, size, o, r)
    if leave < enter or enter < 0.0:
        return MISS, 0.0, 0.0, 0.0
    nx = ny = nz = 0.0
    if face == 0:
        nx = -1.0 if r[0] > 0.0 else 1.0
    elif face == 1:
        ny = -1.0 if r[1] > 0.0 else 1.0
    elif face == 2:
        nz = -1.0 if r[2] > 0.0 else 1.0
    else:
        nx, ny = (o[0] + enter * r[0]) / size[0], (o[1] + enter * r[1]) / size[0]
        nz = 0.0 if kind == CYLINDER else (o[2] + enter * r[2]) / size[0]
    return (
        enter,
        m[0] * nx + m[1] * ny + m[2] * nz,
        m[3] * nx + m[4] * ny + m[5] * nz,
        m[6] * nx + m[7] * ny + m[8] * nz,
    )


@inlined
def inverse_distance(kind: int, size: Vector, o: Vector, r: Vector) -> float:
    """Inverse distance [1/m] to a shape, o and r in its own axes: 0 for a miss, infinity for a start inside.

    The nearest of many hits is the maximum, and on a plane it is linear in the direction (see sensors/lidar/fan.py).
    """
    enter, leave, _ = _interval(kind, size, o, r)
    if leave < enter or leave < 0.0:
        return 0.0
    return 1.0 / enter if enter > 0.0 else inf


@inlined
def misses_sphere(d: Vector, r: Vector, radius: float, range_max: float) -> bool:
    """Whether a ray does not touch a sphere whose centre is at d from its start, or touches it beyond `range_max` [m].

    A ray that passes within the rounding error counts as touching.
    """
    along = d[0] * r[0] + d[1] * r[1] + d[2] * r[2]
    if abs(along - 0.5 * range_max) > 0.5 * range_max + radius:
        return True
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - along * along > radius * radius * (1.0 + 1e-9) + 1e-9


@inlined
def _interval(kind: int, size: Vector | Floats, o: Vector, r: Vector) -> tuple[float, float, int]:
    """`enter`, `leave` and the face of entry of a shape (kind and size as in `model.Shapes`)."""
    if kind == BOX:
        return _box(size, o, r)
    if kind == CYLINDER:
        return _cylinder(size[0], size[1], o, r)
    return _sphere(size[0], o, r)


@inlined
def _box(size: Vector | Floats, o: Vector, r: Vector) -> tuple[float, float, int]:
    """A ray is inside a box where it is between all three pairs of planes."""
    x0, x1 = slab(size[0], o[0], r[0])
    y0, y1 = slab(size[1], o[1], r[1])
    z0, z1 = slab(size[2], o[2], r[2])
    enter, face = x0, 0
    if y0 > enter:
        enter, face = y0, 1
    if z0 > enter:
        enter, face = z0, 2
    return enter, min(x1, y1, z1), face


@inlined
def _cylinder(radius: float, half_height: float, o: Vector, r: Vector) -> tuple[float, float, int]:
    """A ray is inside a cylinder where it is between the caps and within the radius."""
    z0, z1 = slab(half_height, o[2], r[2])
    a = r[0] * r[0] + r[1] * r[1]
    b = o[0] * r[0] + o[1] * r[1]
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    if a < PARALLEL:
        return (z0, z1, 2) if c <= 0.0 else (inf, -inf, 2)
    # discriminant b^2 - a c, without the cancellation
    moment = o[0] * r[1] - o[1] * r[0]
    near, far = _roots(a, b, c, a * radius * radius - moment * moment)
    return (near, min(far, z1), ROUND) if near >= z0 else (z0, min(far, z1), 2)


@inlined
def _sphere(radius: float, o: Vector, r: Vector) -> tuple[float, float, int]:
    b = o[0] * r[0] + o[1] * r[1] + o[2] * r[2]
    c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - radius * radius
    # discriminant b^2 - c, from the point of the ray that is nearest to the centre
    x, y, z = o[0] - b * r[0], o[1] - b * r[1], o[2] - b * r[2]
    near, far = _roots(1.0, b, c, radius * radius - (x * x + y * y + z * z))
    return near, far, ROUND


@inlined
def _roots(a: float, b: float, c: float, discriminant: float) -> tuple[float, float]:
    """The two solutions of a t^2 + 2 b t + c = 0 in ascending order, without cancellation; a > 0."""
    if discriminant < 0.0:
        return inf, -inf
    root = sqrt(discriminant)
    if b < 0.0:
        return c / (root - b), (root - b) / a
    return -(root + b) / a, -c / (root + b) if root + b > 0.0 else 0.0


@inlined
def slab(half_width: float, o: float, r: float) -> tuple[float, float]:
    """Where a ray enters and leaves the space between two planes."""
    if abs(r) < PARALLEL:
        return (-inf, inf) if abs(o) <= half_width else (inf, -inf)
    t0, t1 = (-half_width - o) / r, (half_width - o) / r
    return (t0, t1) if t0 < t1 else (t1, t0)
