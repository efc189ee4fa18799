"""Cross-section of a shape with the plane of a fan of rays: the interval of bearings that hit it, and the ranges.

The fan starts at the sensor. Three-dimensional vectors are in the axes of the shape: o is the position of the sensor,
ex, ey, ez are its axes; ex and ey span the fan. Two-dimensional vectors (u, v) are in the plane, along ex and ey. All
values are scalars, so that nothing is allocated.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from autodrive.base.jit import inlined
from autodrive.base.transforms import Vector

HIDDEN, SEEN, AROUND, PARTLY = 0, 1, 2, 3
"""No cross-section; a simple one; the sensor is inside the shape; a cross-section that needs single rays."""

BEARING_ERROR = 2e-5
"""Twice the error bound of `approximate_bearing` [rad]."""


View: TypeAlias = tuple[int, float, float, float, float, float, float, float, float, float, float]
"""Kind of the cross-section; start and width of its bearings (see `bearings`); eight numbers of its edges or arc."""

NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def view_of_box(s: Vector, o: Vector, ex: Vector, ey: Vector, ez: Vector) -> View:
    """View of a box with half sizes s; a simple cross-section cuts four parallel edges and is a parallelogram.

    The eight numbers are the outlines pu, pv and qu, qv (q to the left), and a0, b0, a1, b1 of the edges between them.
    The inverse range along (cos, sin) is the smaller of a0 cos + b0 sin and a1 cos + b1 sin, because a ray must cross
    both to enter the box.
    """
    # permute the axes so that z is the one with the largest angle to the plane
    if abs(ez[2]) < max(abs(ez[0]), abs(ez[1])):
        s, o, ex, ey, ez = _cycle(s), _cycle(o), _cycle(ex), _cycle(ey), _cycle(ez)
        if abs(ez[2]) < max(abs(ez[0]), abs(ez[1])):
            s, o, ex, ey, ez = _cycle(s), _cycle(o), _cycle(ex), _cycle(ey), _cycle(ez)
    # the plane in the axes of the box: z = z_center + slope_x x + slope_y y
    slope_x, slope_y = -ez[0] / ez[2], -ez[1] / ez[2]
    z_center = o[2] - slope_x * o[0] - slope_y * o[1]
    spread = abs(slope_x) * s[0] + abs(slope_y) * s[1]
    if abs(z_center) - spread > s[2]:
        return HIDDEN, *NOTHING
    if abs(z_center) + spread > s[2]:
        return PARTLY, *NOTHING
    side_x, side_y = math.copysign(1.0, o[0]), math.copysign(1.0, o[1])
    gap_x, gap_y = abs(o[0]) - s[0], abs(o[1]) - s[1]
    sees_x, sees_y = gap_x > 0.0, gap_y > 0.0
    if not (sees_x or sees_y):
        return AROUND, *NOTHING
    # centre c and half sides a, b of the parallelogram
    cu, cv = _in_plane(-o[0], -o[1], z_center - o[2], ex, ey)
    au, av = _in_plane(s[0], 0.0, slope_x * s[0], ex, ey)
    bu, bv = _in_plane(0.0, s[1], slope_y * s[1], ex, ey)
    # the visible edges meet at the corner (side_x, side_y) and end at p and q
    px, py = side_x, -side_y if sees_x else side_y
    qx, qy = -side_x if sees_y else side_x, side_y
    pu, pv = cu + px * au + py * bu, cv + px * av + py * bv
    qu, qv = cu + qx * au + qy * bu, cv + qx * av + qy * bv
    if pu * qv < pv * qu:
        pu, pv, qu, qv = qu, qv, pu, pv
    kx, ky = -side_x / gap_x, -side_y / gap_y
    a0, b0, a1, b1 = kx * ex[0], kx * ey[0], ky * ex[1], ky * ey[1]
    if not sees_x:
        a0, b0 = a1, b1
    if not sees_y:
        a1, b1 = a0, b0
    start, width = bearings(pu, pv, qu, qv)
    return SEEN, start, width, pu, pv, qu, qv, a0, b0, a1, b1


@inlined
def view_of_sphere(u: float, v: float, radius_squared: float) -> View:
    """View of a sphere, whose cross-section is a circle about u, v; the numbers are those of a cylinder."""
    c = u * u + v * v - radius_squared
    if c <= 0.0:
        return AROUND, *NOTHING
    start, width = bearings_of_disc(u, v, math.sqrt(radius_squared))
    return SEEN, start, width, u / c, v / c, radius_squared / (c * c), -v / c, u / c, 0.0, 0.0, 0.0


@inlined
def view_of_cylinder(radius: float, half_height: float, o: Vector, ex: Vector, ey: Vector, ez: Vector) -> View:
    """View of a cylinder about z; a simple cross-section is an ellipse.

    With c = ox^2 + oy^2 - R^2 and m = ox ry - oy rx, a ray along r hits the side at the distance t with
    c/t = -o.r + sqrt(R^2 - m^2 - (R rz)^2). The numbers are the coefficients of (cos, sin), divided by c: two of -o.r,
    R^2, two of m, two of R rz.
    """
    cos_tilt = abs(ez[2])
    if cos_tilt < 1e-3:
        return PARTLY, *NOTHING
    z_center = o[2] + (ez[0] * o[0] + ez[1] * o[1]) / ez[2]
    spread = radius * math.sqrt(ez[0] * ez[0] + ez[1] * ez[1]) / cos_tilt
    if abs(z_center) - spread > half_height:
        return HIDDEN, *NOTHING
    if abs(z_center) + spread > half_height:
        return PARTLY, *NOTHING
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    if c <= 0.0:
        return AROUND, *NOTHING
    a, b = o[0] * ex[0] + o[1] * ex[1], o[0] * ey[0] + o[1] * ey[1]
    m0, m1 = o[0] * ex[1] - o[1] * ex[0], o[0] * ey[1] - o[1] * ey[0]
    q = 1.0 / c
    k = radius * q
    u, v = _in_plane(-o[0], -o[1], z_center - o[2], ex, ey)
    start, width = bearings_of_disc(u, v, radius / cos_tilt)
    return SEEN, start, width, -a * q, -b * q, k * k, m0 * q, m1 * q, k * ex[2], k * ey[2], 0.0


@inlined
def bearings(pu: float, pv: float, qu: float, qv: float) -> tuple[float, float]:
    """Bearing of p, and the angle from p to the left to q, less than pi [rad]; the error is below BEARING_ERROR."""
    start = approximate_bearing(pu, pv)
    width = approximate_bearing(qu, qv) - start
    # a width slightly below 0 is an approximation error
    return start, width + 2.0 * math.pi if width < -1.0 else width


@inlined
def bearings_of_disc(u: float, v: float, radius: float) -> tuple[float, float]:
    """`bearings` of the two tangents to a disc; the whole circle if the sensor is inside."""
    distance_squared, radius_squared = u * u + v * v, radius * radius * (1.0 + 1e-9)
    if distance_squared <= radius_squared:
        return 0.0, 2.0 * math.pi
    # rotate the direction of the centre by +-atan(radius / length of the tangent)
    t = math.sqrt(radius_squared / (distance_squared - radius_squared))
    return bearings(u + t * v, v - t * u, u - t * v, v + t * u)


@inlined
def approximate_bearing(x: float, y: float) -> float:
    """atan2(y, x) to 1e-5 rad. Abramowitz & Stegun, Handbook of Mathematical Functions (4.4.47)."""
    ax, ay = abs(x), abs(y)
    t = min(ax, ay) / max(ax, ay, 1e-300)
    q = t * t
    angle = t * (0.9998660 + q * (-0.3302995 + q * (0.1801410 + q * (-0.0851330 + q * 0.0208351))))
    angle = 0.5 * math.pi - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return math.copysign(angle, y)


@inlined
def _in_plane(x: float, y: float, z: float, ex: Vector, ey: Vector) -> tuple[float, float]:
    return x * ex[0] + y * ex[1] + z * ex[2], x * ey[0] + y * ey[1] + z * ey[2]


@inlined
def _cycle(v: Vector) -> Vector:
    return v[1], v[2], v[0]
