"""The wheel: a treaded rubber tyre on a spoked rim."""

from __future__ import annotations

import math

import shapely
import trimesh

from autodrive.graphics.meshes.mesh_builder import MeshBuilder
from autodrive.graphics.meshes.solids import box, cylinder, lathe, plate, rotated

TREADS = 30
"""Pairs of lugs around a tyre."""
SPOKES = 6


def add_wheel(builder: MeshBuilder, radius: float, width: float, outside: float, rim: str = "rim") -> None:
    """A wheel around its hub, axle along y, outer face towards `outside` (1 left, -1 right); `rim`: its material."""
    n = builder.around(0.9)
    half, lug = 0.5 * width, 0.0009 if builder.has_small_parts else 0.0
    tread, side, seat = radius - lug, radius - 0.0035, 0.74 * radius
    profile = [(seat, -half + 0.0006), (side - 0.003, -half), (side, -half + 0.0004), (tread, -half + 0.0032)]
    profile += [(r, -y) for r, y in reversed(profile)]
    builder.add("rubber", lathe([*profile, profile[0]], axis="y", n=n))
    for i in range(TREADS if builder.has_small_parts else 0):
        for sign in (-1.0, 1.0):
            bar = box((0.0029, 0.50 * width, 0.0022), (0.0, sign * 0.24 * width, 0.0))
            bar = rotated(bar, sign * 0.45, (0.0, 0.0, 1.0), (0.0, sign * 0.24 * width, 0.0))
            bar.apply_translation((0.0, 0.0, radius - 0.0011))
            builder.add("rubber", rotated(bar, 2.0 * math.pi * (i + 0.25 * sign) / TREADS, (0.0, 1.0, 0.0)))
    ring_in, ring_out = 0.66 * radius, seat + 0.0004
    ring = [(ring_in, -0.42 * width), (ring_out, -0.44 * width), (ring_out, 0.44 * width), (ring_in, 0.42 * width)]
    builder.add(rim, lathe([*ring, ring[0]], axis="y", n=n), _spokes(ring_in + 0.0005, outside, width, n))
    profile = [(0.0, -0.3 * width), (0.0062, -0.3 * width), (0.0056, 0.42 * width), (0.0, 0.42 * width)]
    hub = lathe(profile, axis="y", n=max(8, n // 3))
    builder.add(rim, rotated(hub, math.pi, (0.0, 0.0, 1.0)) if outside < 0.0 else hub)
    builder.add("steel", cylinder(0.0024, 0.003, (0.0, outside * 0.45 * width, 0.0), "y", max(6, n // 5)))


def _spokes(radius: float, outside: float, width: float, n: int) -> trimesh.Trimesh:
    """A disc with cut-outs, near the outer face."""
    disc = shapely.Point(0.0, 0.0).buffer(radius, quad_segs=max(3, n // 4))
    for i in range(SPOKES):
        a = 2.0 * math.pi * i / SPOKES
        outline = ((0.42, -0.25), (0.86, -0.38), (0.9, 0.0), (0.86, 0.38), (0.42, 0.25))
        window = [(r * radius * math.cos(a + b), r * radius * math.sin(a + b)) for r, b in outline]
        disc = disc.difference(shapely.Polygon(window).buffer(0.06 * radius, quad_segs=max(1, n // 24)))
    mesh = plate(disc, -0.0022, 0.0022)
    mesh = rotated(mesh, -0.5 * math.pi, (1.0, 0.0, 0.0))
    mesh.apply_translation((0.0, outside * 0.22 * width, 0.0))
    return mesh
