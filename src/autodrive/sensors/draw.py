"""Draws one shape into a fan of rays: the rays between its outlines, each with the inverse of its range.

Along a straight edge, 1/t is a linear function of the ray's direction (cos, sin), so that a ray costs two
multiplications and a maximum. Where a cap of a cylinder or a third face of a box comes into the plane of the fan, rays
are cast one by one (raycast.py). All vectors of three are in the axes of the shape: o is the sensor's place, ex, ey, ez
are its axes, of which ex and ey span the fan. Vectors of two (u, v) are in the plane, along ex and ey.
"""

from __future__ import annotations

import math
from typing import Any

from autodrive.jit import jit
from autodrive.sensors.raycast import cast_at_shape
from autodrive.transforms import Vector

BEARING_ERROR = 2e-5
"""Bound of what `approximate_bearing` errs by [rad], doubled."""


@jit
def draw_floor(fan: Any, height: float, slope_x: float, slope_y: float) -> None:
    """Begin the buffer with the plane z = 0, below which all is solid."""
    cos, sin, _, _, inverse_range = fan
    if height <= 0.0:
        inverse_range[:] = math.inf
        return
    a, b = -slope_x / height, -slope_y / height
    for i in range(len(inverse_range)):
        w = a * cos[i] + b * sin[i]
        inverse_range[i] = w if w > 0.0 else 0.0  # never -0, whose inverse is -inf


@jit
def draw_box(fan: Any, s: Vector, o: Vector, ex: Vector, ey: Vector, ez: Vector) -> bool:
    """Draw a box of which the plane cuts just the four edges along one axis; False if it cuts others, too."""
    x, y, z = abs(ez[0]), abs(ez[1]), abs(ez[2])
    if z >= x and z >= y:
        return _draw_prism(fan, s, o, ex, ey, ez)
    s, o, ex, ey, ez = _cycle(s), _cycle(o), _cycle(ex), _cycle(ey), _cycle(ez)
    if x >= y:
        return _draw_prism(fan, s, o, ex, ey, ez)
    return _draw_prism(fan, _cycle(s), _cycle(o), _cycle(ex), _cycle(ey), _cycle(ez))


@jit
def _cycle(v: Vector) -> Vector:
    return v[1], v[2], v[0]


@jit
def _draw_prism(fan: Any, s: Vector, o: Vector, ex: Vector, ey: Vector, ez: Vector) -> bool:
    """Draw a box cut across its z axis: the cut is a parallelogram."""
    # height of the plane over the box's x, y: z = z_center + slope_x x + slope_y y
    slope_x, slope_y = -ez[0] / ez[2], -ez[1] / ez[2]
    z_center = o[2] - slope_x * o[0] - slope_y * o[1]
    spread = abs(slope_x) * s[0] + abs(slope_y) * s[1]
    if abs(z_center) - spread > s[2]:
        return True  # the plane passes above or below
    if abs(z_center) + spread > s[2]:
        return False
    # the parallelogram in the plane: centre c, half sides a and b
    cu, cv = _in_plane(-o[0], -o[1], z_center - o[2], ex, ey)
    au, av = _in_plane(s[0], 0.0, slope_x * s[0], ex, ey)
    bu, bv = _in_plane(0.0, s[1], slope_y * s[1], ex, ey)
    side_x, side_y = math.copysign(1.0, o[0]), math.copysign(1.0, o[1])
    gap_x, gap_y = abs(o[0]) - s[0], abs(o[1]) - s[1]
    # 1/t of the faces that look at the sensor, and the two corners where they end
    kx, ky = -side_x / gap_x, -side_y / gap_y
    if gap_x > 0.0 and gap_y > 0.0:
        p, q = (side_x, -side_y), (-side_x, side_y)
    elif gap_x > 0.0:
        p, q = (side_x, -1.0), (side_x, 1.0)
        ky = 0.0
    elif gap_y > 0.0:
        p, q = (-1.0, side_y), (1.0, side_y)
        kx = 0.0
    else:
        fan[4][:] = math.inf  # the sensor is inside
        return True
    pu, pv = cu + p[0] * au + p[1] * bu, cv + p[0] * av + p[1] * bv
    qu, qv = cu + q[0] * au + q[1] * bu, cv + q[0] * av + q[1] * bv
    if pu * qv < pv * qu:
        pu, pv, qu, qv = qu, qv, pu, pv
    if ky == 0.0:
        _draw_edges(fan, pu, pv, qu, qv, kx * ex[0], kx * ey[0], kx * ex[0], kx * ey[0])
    elif kx == 0.0:
        _draw_edges(fan, pu, pv, qu, qv, ky * ex[1], ky * ey[1], ky * ex[1], ky * ey[1])
    else:
        _draw_edges(fan, pu, pv, qu, qv, kx * ex[0], kx * ey[0], ky * ex[1], ky * ey[1])
    return True


@jit
def _in_plane(x: float, y: float, z: float, ex: Vector, ey: Vector) -> tuple[float, float]:
    return x * ex[0] + y * ex[1] + z * ex[2], x * ey[0] + y * ey[1] + z * ey[2]


@jit
def _draw_edges(
    fan: Any, pu: float, pv: float, qu: float, qv: float, a0: float, b0: float, a1: float, b1: float
) -> None:
    """Draw two lines with 1/t = a cos + b sin between the outlines p and q: a ray must reach both to enter."""
    cos, sin, _, _, inverse_range = fan
    start, width = _bearings(fan, pu, pv, qu, qv)
    for _turn in range(3):
        lo, hi = _rays(fan, start, width)
        while lo <= hi and cos[lo] * pv > sin[lo] * pu:
            lo += 1
        while lo <= hi and cos[hi] * qv < sin[hi] * qu:
            hi -= 1
        for i in range(lo, hi + 1):
            w = min(a0 * cos[i] + b0 * sin[i], a1 * cos[i] + b1 * sin[i])
            inverse_range[i] = max(inverse_range[i], w)
        start += 2.0 * math.pi


@jit
def draw_sphere(fan: Any, u: float, v: float, radius_squared: float) -> None:
    """Draw a ball, of which the plane cuts a circle about u, v."""
    c = u * u + v * v - radius_squared
    _draw_arc(fan, u, v, math.sqrt(radius_squared), radius_squared, c, -u, -v, v, -u, 0.0, 0.0)


@jit
def draw_cylinder(fan: Any, radius: float, half_height: float, o: Vector, ex: Vector, ey: Vector, ez: Vector) -> bool:
    """Draw a cylinder of which the plane cuts only the mantle (an ellipse); False if it cuts a cap, too."""
    cos_tilt = abs(ez[2])
    if cos_tilt < 1e-3:
        return False
    z_center = o[2] + (ez[0] * o[0] + ez[1] * o[1]) / ez[2]
    spread = radius * math.hypot(ez[0], ez[1]) / cos_tilt
    if abs(z_center) - spread > half_height:
        return True  # the plane passes above or below
    if abs(z_center) + spread > half_height:
        return False
    u, v = _in_plane(-o[0], -o[1], z_center - o[2], ex, ey)
    semi_major_axis = radius / cos_tilt
    c = o[0] * o[0] + o[1] * o[1] - radius * radius
    b_cos, b_sin = o[0] * ex[0] + o[1] * ex[1], o[0] * ey[0] + o[1] * ey[1]
    m_cos, m_sin = o[0] * ex[1] - o[1] * ex[0], o[0] * ey[1] - o[1] * ey[0]
    _draw_arc(fan, u, v, semi_major_axis, radius * radius, c, b_cos, b_sin, m_cos, m_sin, ex[2], ey[2])
    return True


@jit
def _draw_arc(
    fan: Any,
    u: float,
    v: float,
    outer_radius: float,
    radius_squared: float,
    c: float,
    b_cos: float,
    b_sin: float,
    m_cos: float,
    m_sin: float,
    z_cos: float,
    z_sin: float,
) -> None:
    """Draw a round shape that lies within `outer_radius` of u, v in the plane.

    With b = o.r, m = |o x r| and z of the ray across the axis, all linear in (cos, sin), and c = o^2 - radius^2:
    1/t = (sqrt(radius^2 (1 - z^2) - m^2) - b) / c.
    """
    cos, sin, _, _, inverse_range = fan
    if c <= 0.0:
        inverse_range[:] = math.inf  # the sensor is inside
        return
    start, width = _bearings_of_disc(fan, u, v, outer_radius)
    for _turn in range(3):
        lo, hi = _rays(fan, start, width)
        for i in range(lo, hi + 1):
            b = b_cos * cos[i] + b_sin * sin[i]
            m = m_cos * cos[i] + m_sin * sin[i]
            z = z_cos * cos[i] + z_sin * sin[i]
            discriminant = radius_squared * (1.0 - z * z) - m * m
            if discriminant >= 0.0 and b < 0.0:
                inverse_range[i] = max(inverse_range[i], (math.sqrt(discriminant) - b) / c)
        start += 2.0 * math.pi


@jit
def draw_ray_by_ray(
    fan: Any, kind: int, s: Vector, o: Vector, ex: Vector, ey: Vector, u: float, v: float, outer_radius: float
) -> None:
    """Draw any shape that lies within `outer_radius` of u, v in the plane."""
    cos, sin, _, _, inverse_range = fan
    start, width = _bearings_of_disc(fan, u, v, outer_radius)
    for _turn in range(3):
        lo, hi = _rays(fan, start, width)
        for i in range(lo, hi + 1):
            r = (
                ex[0] * cos[i] + ey[0] * sin[i],
                ex[1] * cos[i] + ey[1] * sin[i],
                ex[2] * cos[i] + ey[2] * sin[i],
            )
            inverse_range[i] = max(inverse_range[i], cast_at_shape(kind, s, o, r))
        start += 2.0 * math.pi


@jit
def _bearings(fan: Any, pu: float, pv: float, qu: float, qv: float) -> tuple[float, float]:
    """Bearing of p from the first ray, in [-2 pi, 0), and the angle from there to the left to q, below pi."""
    p, q = approximate_bearing(pu, pv), approximate_bearing(qu, qv)
    width = q - p
    if width < -1.0:  # not just below 0, which is an error of the approximation
        width += 2.0 * math.pi
    start = p - fan[2]
    return start - 2.0 * math.pi * (math.floor(start / (2.0 * math.pi)) + 1.0), width


@jit
def _bearings_of_disc(fan: Any, u: float, v: float, radius: float) -> tuple[float, float]:
    """The same of the two tangents at a disc; the whole circle if the sensor is in it."""
    distance = math.hypot(u, v)
    if distance <= radius * (1.0 + 1e-9):
        return 0.0, 2.0 * math.pi
    sine = radius / distance
    cosine = math.sqrt(1.0 - sine * sine)
    return _bearings(fan, u * cosine + v * sine, v * cosine - u * sine, u * cosine - v * sine, v * cosine + u * sine)


@jit
def _rays(fan: Any, start: float, width: float) -> tuple[int, int]:
    """First and last of the rays between two bearings, and at most two too many."""
    rays_per_radian = fan[3]
    lo = math.ceil((start - BEARING_ERROR) * rays_per_radian)
    hi = math.floor((start + width + BEARING_ERROR) * rays_per_radian)
    return max(lo, 0), min(hi, len(fan[4]) - 1)


@jit
def approximate_bearing(x: float, y: float) -> float:
    """atan2(y, x) to 1e-5 rad. Abramowitz & Stegun, Handbook of Mathematical Functions (4.4.47)."""
    ax, ay = abs(x), abs(y)
    t = min(ax, ay) / max(ax, ay, 1e-300)
    q = t * t
    angle = t * (0.9998660 + q * (-0.3302995 + q * (0.1801410 + q * (-0.0851330 + q * 0.0208351))))
    if ay > ax:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle
