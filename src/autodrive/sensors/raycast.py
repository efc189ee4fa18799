"""How far one ray goes: exact intersections with solid boxes, cylinders, spheres and the floor, compiled by Numba.

A ray starts at o and runs along the unit vector r, both in the shape's own axes. All functions return the *inverse* of
the range [1/m]: 0 is a miss, infinity a start inside. The nearest of many hits is then a maximum, and where a plane
is hit, 1/t is linear in the direction, so that a fan of rays needs no division (see fan.py).
"""

from __future__ import annotations

import math

from autodrive.jit import jit
from autodrive.model import BOX, CYLINDER
from autodrive.transforms import Vector

PARALLEL = 1e-150
"""A direction's component below this never reaches the plane (and its square is no longer a normal number)."""


@jit
def cast_at_shape(kind: int, size: Vector, o: Vector, r: Vector) -> float:
    """Inverse range at a box (half sizes), a cylinder about z (radius, half height) or a sphere (radius)."""
    if kind == BOX:
        return cast_at_box(size, o, r)
    if kind == CYLINDER:
        return cast_at_cylinder(size[0], size[1], o, r)
    return cast_at_sphere(size[0], o, r)


@jit
def cast_at_box(size: Vector, o: Vector, r: Vector) -> float:
    """By slabs: a ray is in a box where it is between all three pairs of planes."""
    x0, x1 = _slab(size[0], o[0], r[0])
    y0, y1 = _slab(size[1], o[1], r[1])
    z0, z1 = _slab(size[2], o[2], r[2])
    return _first(max(x0, y0, z0), min(x1, y1, z1))


@jit
def cast_at_cylinder(radius: float, half_height: float, o: Vector, r: Vector) -> float:
    """Between the caps, and within the radius."""
    z0, z1 = _slab(half_height, o[2], r[2])
    a = r[0] * r[0] + r[1] * r[1]
    b = o[0] * r[0] + o[1] * r[1]
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    if a < PARALLEL:
        return _first(z0, z1) if c <= 0.0 else 0.0
    # t^2 a + 2 t b + c = 0; its discriminant b^2 - a c without the cancellation
    moment = o[0] * r[1] - o[1] * r[0]
    discriminant = a * radius * radius - moment * moment
    if discriminant < 0.0:
        return 0.0
    root = math.sqrt(discriminant)
    if b < 0.0:
        near, far = c / (root - b), (root - b) / a
    else:
        near, far = -(root + b) / a, -c / (root + b) if root + b > 0.0 else 0.0
    return _first(max(near, z0), min(far, z1))


@jit
def cast_at_sphere(radius: float, o: Vector, r: Vector) -> float:
    """By the distance of the centre from the ray."""
    b = o[0] * r[0] + o[1] * r[1] + o[2] * r[2]
    c = o[0] * o[0] + o[1] * o[1] + o[2] * o[2] - radius * radius
    if c <= 0.0:
        return math.inf
    x, y, z = o[0] - b * r[0], o[1] - b * r[1], o[2] - b * r[2]
    discriminant = radius * radius - (x * x + y * y + z * z)
    if b >= 0.0 or discriminant < 0.0:
        return 0.0
    return (math.sqrt(discriminant) - b) / c


@jit
def _slab(half_width: float, o: float, r: float) -> tuple[float, float]:
    """Where a ray enters and leaves the space between two planes."""
    if abs(r) < PARALLEL:
        return (-math.inf, math.inf) if abs(o) <= half_width else (math.inf, -math.inf)
    t0, t1 = (-half_width - o) / r, (half_width - o) / r
    return (t0, t1) if t0 < t1 else (t1, t0)


@jit
def _first(enter: float, leave: float) -> float:
    """Inverse range of what fills the ray from `enter` to `leave`."""
    if leave < enter or leave < 0.0:
        return 0.0
    return 1.0 / enter if enter > 0.0 else math.inf
