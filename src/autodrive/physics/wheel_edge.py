"""A wheel on the edge of a box: the circle of the wheel rests on the edge, where the suspension ray sees a step."""

from __future__ import annotations

from math import sqrt

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined
from autodrive.base.transforms import Vector
from autodrive.physics.ray import MISS

CLIMBABLE = 0.7
"""An edge that is less than this share of the radius below the axle is an obstacle for the wheel's collider."""


@inlined
def edge_support(size: Floats, hub: Vector, forward: Vector, up: Vector, radius: float) -> tuple[float, float]:
    """Compression [m] at which the wheel rests on the highest edge of a box, and how far ahead of the axle that is [m].

    All in the axes of the box. The wheel is a circle in the plane of `forward` and `up`, whose centre moves along `up`
    from `hub` at compression 0. An edge that crosses this plane `ahead` of the axle and `above` it carries the circle
    at the compression above + sqrt(radius^2 - ahead^2). -`MISS` if no edge is below the wheel.
    """
    side = (
        up[1] * forward[2] - up[2] * forward[1],
        up[2] * forward[0] - up[0] * forward[2],
        up[0] * forward[1] - up[1] * forward[0],
    )
    level = side[0] * hub[0] + side[1] * hub[1] + side[2] * hub[2]
    best, best_ahead = -MISS, 0.0
    for axis in range(3):  # the four edges along each axis
        j, k = (axis + 1) % 3, (axis + 2) % 3
        if abs(side[axis]) < 1e-9:  # parallel to the plane
            continue
        for corner in range(4):
            y = size[j] if corner < 2 else -size[j]
            z = size[k] if corner % 2 == 0 else -size[k]
            x = (level - side[j] * y - side[k] * z) / side[axis]
            if abs(x) > size[axis]:
                continue
            x, y, z = x - hub[axis], y - hub[j], z - hub[k]
            ahead = x * forward[axis] + y * forward[j] + z * forward[k]
            above = x * up[axis] + y * up[j] + z * up[k]
            if abs(ahead) < radius and above < -CLIMBABLE * radius:
                compression = above + sqrt(radius * radius - ahead * ahead)
                if compression > best:
                    best, best_ahead = compression, ahead
    return best, best_ahead
