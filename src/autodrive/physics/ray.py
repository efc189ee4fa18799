"""Where a ray meets a shape, with the normal there: for wheels, which stand on whatever is below them.

Points and directions are scalars x, y, z in the map frame; a shape is given by its kind, size, centre and rotation
(row-major, map from shape). A ray that starts inside a shape does not meet it, as in PhysX.
"""

from math import sqrt

from autodrive.jit import inlined
from autodrive.model import BOX, CYLINDER
from autodrive.state import Floats

MISS = 1.0e30
"""Distance of a ray that meets nothing [m]."""


@inlined
def ray_shape(
    kind: int, size: Floats, centre: Floats, m: Floats, px: float, py: float, pz: float, ux: float, uy: float, uz: float
) -> tuple[float, float, float, float]:
    """Distance [m] along the unit vector u from p to the shape, or `MISS`, and the outward normal there (map frame)."""
    dx, dy, dz = px - centre[0], py - centre[1], pz - centre[2]
    ox, oy, oz = (
        m[0] * dx + m[3] * dy + m[6] * dz,
        m[1] * dx + m[4] * dy + m[7] * dz,
        m[2] * dx + m[5] * dy + m[8] * dz,
    )
    vx, vy, vz = (
        m[0] * ux + m[3] * uy + m[6] * uz,
        m[1] * ux + m[4] * uy + m[7] * uz,
        m[2] * ux + m[5] * uy + m[8] * uz,
    )
    if kind == BOX:
        t, nx, ny, nz = _box(size[0], size[1], size[2], ox, oy, oz, vx, vy, vz)
    elif kind == CYLINDER:
        t, nx, ny, nz = _cylinder(size[0], size[1], ox, oy, oz, vx, vy, vz)
    else:
        t, nx, ny, nz = _sphere(size[0], ox, oy, oz, vx, vy, vz)
    return (
        t,
        m[0] * nx + m[1] * ny + m[2] * nz,
        m[3] * nx + m[4] * ny + m[5] * nz,
        m[6] * nx + m[7] * ny + m[8] * nz,
    )


@inlined
def _box(
    sx: float, sy: float, sz: float, ox: float, oy: float, oz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float, float]:
    """The slab method: the ray enters the box where it has entered all three slabs."""
    enter, leave = -MISS, MISS
    nx = ny = nz = 0.0
    for axis in range(3):
        s, o, v = (sx, ox, vx) if axis == 0 else ((sy, oy, vy) if axis == 1 else (sz, oz, vz))
        if v == 0.0:
            if abs(o) > s:
                return MISS, 0.0, 0.0, 0.0
            continue
        near, far = (-s - o) / v, (s - o) / v
        sign = -1.0
        if near > far:
            near, far = far, near
            sign = 1.0
        if near > enter:
            enter = near
            nx, ny, nz = (
                sign if axis == 0 else 0.0,
                sign if axis == 1 else 0.0,
                sign if axis == 2 else 0.0,
            )
        leave = min(leave, far)
    if enter > leave or enter < 0.0:
        return MISS, 0.0, 0.0, 0.0
    return enter, nx, ny, nz


@inlined
def _cylinder(
    radius: float, half: float, ox: float, oy: float, oz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float, float]:
    """The round side, else the flat end that faces the ray."""
    a = vx * vx + vy * vy
    b = ox * vx + oy * vy
    c = ox * ox + oy * oy - radius * radius
    if c <= 0.0 and abs(oz) <= half:
        return MISS, 0.0, 0.0, 0.0
    if a > 0.0 and b * b - a * c >= 0.0:
        t = (-b - sqrt(b * b - a * c)) / a
        if t >= 0.0 and abs(oz + t * vz) <= half:
            return t, (ox + t * vx) / radius, (oy + t * vy) / radius, 0.0
    if vz != 0.0:
        end = half if vz < 0.0 else -half
        t = (end - oz) / vz
        x, y = ox + t * vx, oy + t * vy
        if t >= 0.0 and x * x + y * y <= radius * radius:
            return t, 0.0, 0.0, (1.0 if end > 0.0 else -1.0)
    return MISS, 0.0, 0.0, 0.0


@inlined
def _sphere(
    radius: float, ox: float, oy: float, oz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float, float]:
    b = ox * vx + oy * vy + oz * vz
    c = ox * ox + oy * oy + oz * oz - radius * radius
    d = b * b - c
    if d < 0.0 or c <= 0.0 or b > 0.0:
        return MISS, 0.0, 0.0, 0.0
    t = -b - sqrt(d)
    return t, (ox + t * vx) / radius, (oy + t * vy) / radius, (oz + t * vz) / radius
