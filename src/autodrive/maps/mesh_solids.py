"""How walls, blocks, posts, signs, traffic lights and construction boxes look: the same sizes as what is hit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import resvg_py

from autodrive.maps.icons import icon_svg
from autodrive.maps.props import (
    HOUSING_DEPTH,
    LAMP_HEIGHTS,
    PLATE_HEIGHT,
    PLATE_SIZE,
    PLATE_THICKNESS,
    POST_RADIUS,
    SIGNS,
    Prop,
)
from autodrive.maps.solids import StaticShape
from autodrive.model import BOX
from autodrive.render.asset import Label, Material, Surface
from autodrive.render.png import decode_png

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.state import Floats

MATERIALS = {
    "wall": Material("wall", (0.62, 0.60, 0.55), roughness=0.9),
    "block": Material("block", (0.55, 0.42, 0.28), roughness=0.85),
    "post": Material("post", (0.36, 0.37, 0.38), roughness=0.65),
    "plate": Material("plate", (0.45, 0.46, 0.47), roughness=0.65),
    "housing": Material("housing", (0.018, 0.02, 0.022), roughness=0.6),
}
"""By the material of a `StaticShape`."""
LABELS = {
    "wall": Label.WALL,
    "block": Label.BLOCK,
    "post": Label.POST,
    "plate": Label.SIGN,
    "housing": Label.TRAFFIC_LIGHT,
}
LENSES = {
    "red": Material("lens_red", (0.32, 0.012, 0.01), roughness=0.6),
    "yellow": Material("lens_yellow", (0.36, 0.19, 0.01), roughness=0.6),
    "green": Material("lens_green", (0.01, 0.22, 0.08), roughness=0.6),
}
BOARD = Material("box", (1.0, 1.0, 1.0), roughness=0.85, texture="box")
SIGN = Material("sign", (1.0, 1.0, 1.0), roughness=0.65, texture="signs")

SIGN_GRID, SIGN_PIXELS = 3, 256
"""Faces of the signs stand in a square of so many by so many, each so large [pixels]."""


def static_surfaces(shape: StaticShape) -> Iterator[Surface]:
    """Something that stands fast, just as it is hit."""
    material, label = MATERIALS[shape.material], LABELS[shape.material]
    positions, normals, triangles, _ = _cuboid(shape.size) if shape.kind == BOX else _cylinder(*shape.size[:2])
    yield _placed(positions, normals, triangles, (*shape.position, shape.yaw), material, label)


def box_surfaces(size: tuple[float, float, float]) -> Iterator[Surface]:
    """A construction box around its middle; every side shows the whole texture, the top and bottom its plain part."""
    half = (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
    positions, normals, triangles, uvs = _cuboid(half)
    lid = np.abs(normals[:, 2]) > 0.5
    uvs[lid] = uvs[lid] * (0.9, 0.14) + (0.05, 0.015)
    yield Surface(BOARD, positions, normals, triangles, Label.BOX, uvs=uvs)


def prop_surfaces(prop: Prop) -> Iterator[Surface]:
    """What a sign or a traffic light has beyond its solid shapes: its face, or its lenses and their visors."""
    if prop.kind != "traffic_light":
        ahead = POST_RADIUS + PLATE_THICKNESS + 0.0004
        yield _face(prop, ahead)
        return
    for color, height in LAMP_HEIGHTS.items():
        positions, normals, triangles = _disc(0.0058)
        at = (*_ahead(prop, 0.5 * HOUSING_DEPTH + 0.0005, height), prop.pose[2])
        yield _placed(positions, normals, triangles, at, LENSES[color], Label.TRAFFIC_LIGHT)
        positions, normals, triangles = _visor(0.0068, 0.009)
        at = (*_ahead(prop, 0.5 * HOUSING_DEPTH, height), prop.pose[2])
        yield _placed(positions, normals, triangles, at, MATERIALS["housing"], Label.TRAFFIC_LIGHT)


@cache
def sign_atlas() -> NDArray[np.uint8]:
    """All faces on the grey of the plates, sRGB, shape (n, n, 3)."""
    atlas = np.zeros((SIGN_GRID * SIGN_PIXELS, SIGN_GRID * SIGN_PIXELS, 3), np.uint8)
    for i, kind in enumerate(SIGNS):
        face = decode_png(bytes(resvg_py.svg_to_bytes(svg_string=icon_svg(kind, SIGN_PIXELS), skip_system_fonts=True)))  # pyright: ignore[reportArgumentType]
        alpha = face[..., 3:] / 255.0
        row, column = SIGN_PIXELS * (i // SIGN_GRID), SIGN_PIXELS * (i % SIGN_GRID)
        mixed = alpha * face[..., :3] + (1.0 - alpha) * np.array([178.0, 180.0, 182.0])
        atlas[row : row + SIGN_PIXELS, column : column + SIGN_PIXELS] = np.round(mixed).astype(np.uint8)
    return atlas


def _face(prop: Prop, ahead: float) -> Surface:
    half = 0.5 * PLATE_SIZE
    # seen from ahead the plate's y points to the right
    positions = np.array([(0, half, -half), (0, -half, -half), (0, -half, half), (0, half, half)], np.float32)
    positions = positions[::-1]
    normals = np.tile(np.array([1, 0, 0], np.float32), (4, 1))
    number = SIGNS.index(prop.kind)
    corner = np.array([number % SIGN_GRID, number // SIGN_GRID], np.float32)
    # the driver sees the face with y to the right: +y is the right edge of the picture
    across = np.array([1.0, 0.0, 0.0, 1.0])
    down = np.array([0.0, 0.0, 1.0, 1.0])
    uvs = (corner + np.column_stack([across, down])) / SIGN_GRID
    triangles = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)[:, ::-1]
    at = (*_ahead(prop, ahead, PLATE_HEIGHT), prop.pose[2])
    return _placed(positions, normals, triangles, at, SIGN, Label.SIGN, uvs.astype(np.float32))


def _ahead(prop: Prop, distance: float, height: float) -> tuple[float, float, float]:
    x, y, yaw = prop.pose
    return x + distance * math.cos(yaw), y + distance * math.sin(yaw), height


# -- shapes around their own middle: positions, normals, triangles ----------------------------------------------


def _cuboid(half: tuple[float, float, float]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    positions, normals, uvs = [], [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = sign * np.eye(3)[axis]
            up = np.eye(3)[2] if axis != 2 else np.eye(3)[0]
            right = np.cross(up, normal)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                positions.append((normal + a * right + b * up) * half)
                normals.append(normal)
                uvs.append((0.5 + 0.5 * a, 0.5 - 0.5 * b))
    return (*_arrays(positions, normals), _quads(6), np.array(uvs, np.float32))


def _cylinder(radius: float, half: float, sections: int = 14) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Upright, with a lid."""
    angle = np.linspace(0.0, 2.0 * np.pi, sections + 1)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    low, high = (
        np.column_stack([radius * rim, np.full(len(rim), -half)]),
        np.column_stack([radius * rim, np.full(len(rim), half)]),
    )
    side = np.column_stack([rim, np.zeros(len(rim))])
    i = np.arange(sections)
    n = sections + 1
    walls = np.concatenate([np.column_stack([i, i + 1, i + n + 1]), np.column_stack([i, i + n + 1, i + n])])
    lid = np.column_stack([np.full(sections - 1, 2 * n), 2 * n + i[1:], 2 * n + i[1:] + 1])
    positions = np.concatenate([low, high, high])
    normals = np.concatenate([side, side, np.tile([0.0, 0.0, 1.0], (n, 1))])
    return (*_arrays(positions, normals), np.concatenate([walls, lid]).astype(np.uint32), np.zeros((len(positions), 2)))


def _disc(radius: float, sections: int = 18) -> tuple[NDArray, NDArray, NDArray]:
    """Facing x."""
    angle = np.arange(sections) * 2.0 * np.pi / sections
    positions = np.column_stack([np.zeros(sections), radius * np.cos(angle), radius * np.sin(angle)])
    i = np.arange(1, sections - 1)
    triangles = np.column_stack([np.zeros_like(i), i, i + 1]).astype(np.uint32)
    return (*_arrays(positions, np.tile([1.0, 0.0, 0.0], (sections, 1))), triangles)


def _visor(radius: float, depth: float, sections: int = 10) -> tuple[NDArray, NDArray, NDArray]:
    """Half a tube over a lens, seen from both sides."""
    angle = np.linspace(-0.1 * np.pi, 1.1 * np.pi, sections + 1)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    back = np.column_stack([np.zeros(len(rim)), radius * rim])
    front = back + np.array([depth, 0.0, 0.0])
    outward = np.column_stack([np.zeros(len(rim)), rim])
    i, n = np.arange(sections), sections + 1
    outer = np.concatenate([np.column_stack([i, i + n, i + n + 1]), np.column_stack([i, i + n + 1, i + 1])])
    inner = outer[:, ::-1] + 2 * n
    positions, normals = np.concatenate([back, front] * 2), np.concatenate([outward, outward, -outward, -outward])
    return (*_arrays(positions, normals), np.concatenate([outer[:, ::-1], inner[:, ::-1]]).astype(np.uint32))


def _arrays(positions: object, normals: object) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    return np.array(positions, np.float32), np.array(normals, np.float32)


def _quads(count: int) -> NDArray[np.uint32]:
    starts = 4 * np.arange(count)[:, None, None]
    return (starts + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.uint32)


def _placed(
    positions: NDArray,
    normals: NDArray,
    triangles: NDArray,
    at: tuple[float, float, float, float],
    material: Material,
    label: Label,
    uvs: NDArray | None = None,
) -> Surface:
    """At x, y, z [m], turned by a yaw [rad]."""
    c, s = math.cos(at[3]), math.sin(at[3])
    turn: Floats = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    placed = positions @ turn.T + at[:3]
    normals = normals @ turn.T
    a, b, c_ = (placed[triangles[:, i]] for i in range(3))
    is_inside_out = np.einsum("ij,ij->i", np.cross(b - a, c_ - a), normals[triangles[:, 0]]) < 0.0
    triangles = np.where(is_inside_out[:, None], triangles[:, ::-1], triangles)
    return Surface(material, placed.astype(np.float32), normals.astype(np.float32), triangles, label, uvs)
