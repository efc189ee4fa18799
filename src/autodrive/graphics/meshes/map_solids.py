"""Builds the meshes of the solids of a map: walls, blocks, traffic signs, traffic lights, construction boxes."""

# ruff: noqa: E501 (SVG elements are kept on one line)

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import resvg_py
import shapely

from autodrive.base.png import decode_png
from autodrive.base.transforms import Vector, quaternion_from_yaw
from autodrive.base.units import DEGREE
from autodrive.graphics.assets.asset import Asset, AssetNode, Detail, Material, MeshSurface
from autodrive.graphics.assets.textures import SIZE, texture
from autodrive.graphics.meshes.polygons import Mesh, box_faces, joined, level, quad
from autodrive.graphics.meshes.solids import box, plate, rotated_by, surface, without_faces
from autodrive.graphics.meshes.track import barrier_nodes
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.icons import icon
from autodrive.scenario.maps.props import (
    HOUSING_DEPTH,
    LAMP_HEIGHTS,
    PLATE_SIZE,
    PLATE_THICKNESS,
    SIGNS,
    Prop,
    plate_position,
)
from autodrive.scenario.maps.solids import StaticShape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.scenario.maps.map import Map

WALL = Material("wall", (0.62, 0.63, 0.62), roughness=0.9, texture="panels")
COPING = Material("coping", (0.36, 0.37, 0.38), roughness=0.8)
BLOCK = Material("block", (1.0, 1.0, 1.0), roughness=0.9, window_light=(2.1, 1.15, 0.45))
BLOCK_COLORS = ((0.95, 0.86, 0.70), (0.92, 0.74, 0.60), (0.83, 0.86, 0.84), (0.90, 0.88, 0.83), (0.72, 0.78, 0.86))
ROOF = Material("roof", (1.0, 1.0, 1.0), roughness=0.9, texture="roof")
ROOF_COLORS = ((0.60, 0.56, 0.51), (0.66, 0.38, 0.29), (0.50, 0.53, 0.56), (0.64, 0.59, 0.50), (0.55, 0.46, 0.42))
PANEL, BAY, STOREY = 0.5, 0.15, 0.12
"""Widths of a panel of a wall and of a window with the wall beside it, and height of a storey, about [m]."""
FOOT = 0.65
"""Share of the sky that the foot of a wall sees."""
STEEL = Material("steel", (0.36, 0.37, 0.38), roughness=0.6)
FACE = Material("sign_face", (1.0, 1.0, 1.0), roughness=0.6, texture="signs")
HOUSING = Material("housing", (0.022, 0.024, 0.026), roughness=0.65)
LENSES = {
    "red": Material("lens_red", (0.34, 0.012, 0.010), roughness=0.3, emission=(5.0, 0.12, 0.08)),
    "yellow": Material("lens_yellow", (0.42, 0.20, 0.010), roughness=0.3, emission=(5.0, 2.2, 0.1)),
    "green": Material("lens_green", (0.012, 0.22, 0.075), roughness=0.3, emission=(0.15, 5.0, 1.6)),
}
"""The emission is that of a lit lamp; the values are ours."""
VISOR_DEPTH = 0.0045
"""Length of a visor beyond the housing of a traffic light [m]; the housing is what LIDARs and vehicles hit."""
CARDBOARD = Material("cardboard", (1.0, 1.0, 1.0), roughness=0.9, texture="box")
ATLAS = 3
"""Number of sign faces in each row and column of their texture."""


def solid_nodes(map_: Map) -> Iterator[AssetNode]:
    """One node for each static shape, and one for each lens of a traffic light; of a track, its barriers."""
    props = {prop.name: prop for prop in map_.props}
    if map_.track is not None:
        yield from barrier_nodes(map_.track)
        return
    for shape in map_.statics:
        name, _, part = shape.name.rpartition(".")
        if part == shape.material == "plate":
            yield _plate_node(shape.name, props[name])
        elif shape.material != "plate":
            yield _node(shape)
        if shape.material == "housing":
            yield from _lenses(shape, name)


def box_asset(size: tuple[float, float, float]) -> Asset:
    """A construction box (length, width, height [m]) around its centre: cardboard with tape and stripes."""
    half = (size[0] / 2.0, size[1] / 2.0, size[2] / 2.0)
    whole = joined(quad(corners, _box_uvs(name)) for name, corners in box_faces(half).items())
    surfaces = (whole.surface(CARDBOARD, Label.BOX),)
    node = AssetNode("box", surfaces={"full": surfaces, "reduced": surfaces, "shadow": surfaces})
    return Asset("box", (node,), {"box": _box_texture()})


def _node(shape: StaticShape) -> AssetNode:
    return _placed(shape.name, shape.position, shape.yaw, _LOOKS[shape.material](shape))


def _plate_node(name: str, prop: Prop) -> AssetNode:
    """The whole plate of a sign, of which the shapes are parts."""
    return _placed(name, plate_position(prop), prop.pose[2], _plate(prop, PLATE_THICKNESS / 2.0))


def _placed(name: str, position: Vector, yaw: float, surfaces: tuple[MeshSurface, ...]) -> AssetNode:
    levels: dict[Detail, tuple[MeshSurface, ...]] = {"full": surfaces, "reduced": surfaces, "shadow": surfaces}
    return AssetNode(name, "", position, quaternion_from_yaw(yaw), surfaces=levels)


# -- walls and blocks -------------------------------------------------------------------------------------------


def _walls(shape: StaticShape) -> tuple[MeshSurface, ...]:
    top = quad(box_faces(shape.size)["top"]).surface(COPING, Label.WALL)
    return _sides(shape, PANEL).surface(WALL, Label.WALL), top


def _block(shape: StaticShape) -> tuple[MeshSurface, ...]:
    """A building: whole windows on each side, and a flat roof with a parapet."""
    storeys = min(max(round(2.0 * shape.size[2] / STOREY), 1), STOREYS)
    number = zlib.crc32(shape.name.encode())
    color, roof_color = BLOCK_COLORS[number % len(BLOCK_COLORS)], ROOF_COLORS[number % len(ROOF_COLORS)]
    facade = replace(BLOCK, color=color, texture=f"facade_{storeys}")
    roof = quad(box_faces(shape.size)["top"], np.array([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]))
    return _sides(shape, BAYS * BAY, BAYS).surface(facade, Label.BLOCK), roof.surface(
        replace(ROOF, color=roof_color), Label.BLOCK
    )


def _sides(shape: StaticShape, period: float, parts: int = 1) -> Mesh:
    """The sides of a box. Their texture is as high as they are; a whole number of its `parts` fits each side."""
    faces, e = box_faces(shape.size), 1.0 / SIZE
    walls = []
    for name in ("front", "left", "back", "right"):
        corners = faces[name]
        along = max(1.0, round(parts * np.linalg.norm(corners[1] - corners[0]) / period)) / parts
        walls.append(quad(corners, np.array([(0.0, 1.0 - e), (along, 1.0 - e), (along, e), (0.0, e)])))
    half = shape.size[2]
    return joined(walls).dim_below(2.0 * half, FOOT, floor=-half)


def _post(shape: StaticShape) -> tuple[MeshSurface, ...]:
    radius, half_height, _ = shape.size
    post = plate(shapely.Polygon(_circle(10, radius)), -half_height, half_height)
    return (surface([without_faces(post, (0.0, 0.0, -1.0))], STEEL, Label.POST),)


# -- facades ----------------------------------------------------------------------------------------------------

GLASS = (("#1f263d", "#4d5574"), ("#1f313d", "#4d6374"), ("#1f393d", "#4d6f74"))
"""Colours of windows, and of the sky that they mirror, bluish as nothing else; `window_light` in shaders/light.glsl."""
BAYS, STOREYS = 4, 4
"""Windows beside each other in the texture of a facade, and the most above each other."""


def solid_texture(name: str) -> NDArray[np.uint8]:
    """The texture of that name, of the ground or of solids."""
    if name == "signs":
        return sign_faces()
    if name in ("panels", "roof"):
        return _on_plaster(_PANELS if name == "panels" else _ROOF)
    if name == "duct":
        return _rasterized(_DUCT, 100)
    return _on_plaster(_facade(int(name[-1]))) if name.startswith("facade") else texture(name)


@cache
def _on_plaster(svg: str) -> NDArray[np.uint8]:
    """A drawing on white, of 100 x 100, with the grain of plaster."""
    image = _rasterized(f'<rect width="100" height="100" fill="#fff"/>{svg}', 100).astype(np.float64)
    grain = texture("plaster").astype(np.float64)
    return np.clip(image * (grain / grain.mean((0, 1))) * 0.82, 0, 255).astype(np.uint8)


_PANELS = (
    '<path d="M0 88 H100 V100 H0 Z" fill="#b9b7b2"/><path d="M0 94 H100 V100 H0 Z" fill="#a3a19b"/>'
    '<path d="M0 0 H100 V4 H0 Z" fill="#c9c8c4"/><path d="M0 0 V100 M100 0 V100" stroke="#8d8c88" stroke-width="1.6"/>'
    '<path d="M1.4 4 V100" stroke="#e9e8e4" stroke-width=".7"/>'
)
_DUCT = '<rect width="100" height="100" fill="#aeb0b3"/><rect x="46" width="8" height="100" fill="#3f3f42"/>'
_ROOF = (
    '<rect width="100" height="100" fill="#b4b1ab"/><rect x="2" y="2" width="96" height="96" fill="none" stroke="#e4e2dc" stroke-width="4"/>'
    '<rect x="4.4" y="4.4" width="91.2" height="91.2" fill="none" stroke="#7d7b77" stroke-width="1"/>'
    '<rect x="60" y="20" width="14" height="10" fill="#d4d1cb" stroke="#7f7d79" stroke-width="1"/><circle cx="28" cy="66" r="4" fill="#83817d"/>'
)


def _facade(storeys: int) -> str:
    """Plinth, windows, a door in the second of four bays, and a parapet with a cornice."""
    bottom, top = 93.0, 9.0
    tall, wide = (bottom - top) / storeys, 100.0 / BAYS
    parts = [
        '<path d="M0 93 H100 V100 H0 Z" fill="#8f8a83"/><path d="M0 93 H100" stroke="#6e6a64" stroke-width=".8"/>'
        '<path d="M0 0 H100 V5.5 H0 Z" fill="#dad6cd"/><path d="M0 5.5 H100 V7.4 H0 Z" fill="#9a958c"/>'
        '<path d="M0 7.4 H100 V9 H0 Z" fill="#cbc6bc"/>'
    ]
    for storey in range(storeys):
        y = bottom - (storey + 1) * tall
        if storey:
            parts.append(f'<path d="M0 {y + tall} H100" stroke="#c4bfb4" stroke-width="1"/>')
        for bay in range(BAYS):
            x = bay * wide
            if storey == 0 and bay == 1:
                parts.append(
                    f'<rect x="{x + 0.30 * wide}" y="{y + 0.2 * tall}" width="{0.4 * wide}" height="{0.8 * tall + 7}" fill="#d8d3c8"/>'
                    f'<rect x="{x + 0.34 * wide}" y="{y + 0.25 * tall}" width="{0.32 * wide}" height="{0.75 * tall + 7}" fill="#4a3527"/>'
                    f'<rect x="{x + 0.39 * wide}" y="{y + 0.32 * tall}" width="{0.22 * wide}" height="{0.22 * tall}" fill="#31414d"/>'
                )
                continue
            glass, mirroring = GLASS[(5 * bay + 3 * storey) % len(GLASS)]
            blind = 0.18 * tall * ((3 * bay + 2 * storey) % 4 == 1)
            left, upper, w, h = x + 0.26 * wide, y + 0.2 * tall, 0.48 * wide, 0.56 * tall
            parts.append(
                f'<rect x="{left - 1.2}" y="{upper - 1}" width="{w + 2.4}" height="{h + 2}" fill="#e8e4da"/>'
                f'<rect x="{left}" y="{upper}" width="{w}" height="{h}" fill="{glass}"/>'
                f'<path d="M{left} {upper} h{w} v{0.45 * h} l{-w} {0.25 * h} Z" fill="{mirroring}"/>'
                f'<rect x="{left}" y="{upper}" width="{w}" height="{blind}" fill="#cfc7b4"/>'
                f'<path d="M{left + 0.5 * w} {upper} v{h} M{left} {upper + 0.36 * h} h{w}" stroke="#e8e4da" stroke-width="1"/>'
                f'<rect x="{left - 2.2}" y="{upper + h + 0.6}" width="{w + 4.4}" height="1.5" fill="#efece4"/>'
                f'<rect x="{left - 2.2}" y="{upper + h + 2.1}" width="{w + 4.4}" height="1.1" fill="#8f8a80"/>'
            )
    return "".join(parts)


# -- signs ------------------------------------------------------------------------------------------------------


def _plate(prop: Prop, half_thickness: float) -> tuple[MeshSurface, ...]:
    """A plate with the outline of its sign: its face looks along x; back and edge are steel."""
    outline = OUTLINES.get(prop.kind, SQUARE)
    column, row = SIGNS.index(prop.kind) % ATLAS, SIGNS.index(prop.kind) // ATLAS
    # +y of the plate is to the right of a driver who faces the sign
    picture = np.column_stack([outline[:, 0] / 1.04 + 0.5, 0.5 - outline[:, 1] / 1.04])
    uvs = (picture + np.array((column, row))) / ATLAS
    front = level(outline * PLATE_SIZE, half_thickness, uvs)
    steel = plate(shapely.Polygon(outline * PLATE_SIZE), -half_thickness, half_thickness)
    steel = without_faces(steel, (0.0, 0.0, 1.0))
    back = surface([rotated_by(steel, UPRIGHT)], STEEL, Label.SIGN, crease=1.0 * DEGREE)
    return front.rotated(UPRIGHT).surface(FACE, Label.SIGN), back


def _circle(segments: int, radius: float, start: float = 0.0) -> Floats:
    angle = start + np.arange(segments) * (2.0 * math.pi / segments)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


UPRIGHT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation that turns a drawing in the x-y plane upright: z becomes x, x becomes y, y becomes z."""
SQUARE = 0.475 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
_DIAMOND = np.array([(0.0, -0.5), (0.5, 0.0), (0.0, 0.5), (-0.5, 0.0)])
OUTLINES: dict[str, Floats] = {
    "stop": _circle(8, 0.5 / math.cos(math.pi / 8.0), math.pi / 8.0),
    "give_way": np.array([(0.0, -0.5), (0.5, 0.4), (-0.5, 0.4)]),
    "no_parking": _circle(24, 0.48),
    **dict.fromkeys(("left_curve", "right_curve", "side_road_left", "side_road_right"), _DIAMOND),
}
"""Outlines of the plates, as in `maps.icons` and `maps.props.PLATES`; all others are square."""


@cache
def sign_faces() -> NDArray[np.uint8]:
    """The faces of all signs in one texture."""
    faces = "".join(
        f'<g transform="translate({i % ATLAS + 0.5} {i // ATLAS + 0.5}) scale({1 / 1.04} {-1 / 1.04})">{icon(sign)}</g>'  # pyright: ignore[reportArgumentType]
        for i, sign in enumerate(SIGNS)
    )
    return _rasterized(f'<rect width="{ATLAS}" height="{ATLAS}" fill="#8d9092"/>{faces}', ATLAS)


@cache
def _rasterized(shapes: str, extent: float) -> NDArray[np.uint8]:
    """A square SVG drawing of that extent as an image."""
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}" '
        f'viewBox="0 0 {extent} {extent}">{shapes}</svg>'
    )
    return decode_png(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=True))[..., :3]


# -- traffic lights ---------------------------------------------------------------------------------------------


def _housing(shape: StaticShape) -> tuple[MeshSurface, ...]:
    x, y, z = shape.size
    return (surface([box((2.0 * x, 2.0 * y, 2.0 * z))], HOUSING, Label.TRAFFIC_LIGHT),)


def _lenses(shape: StaticShape, name: str) -> Iterator[AssetNode]:
    """One node for each lens, with its visor."""
    for color, height in LAMP_HEIGHTS.items():
        outline = _circle(14, 0.0055)
        lens = level(outline, 0.0005, outline).rotated(UPRIGHT).surface(LENSES[color], Label.TRAFFIC_LIGHT)
        surfaces = (lens, _visor().surface(HOUSING, Label.TRAFFIC_LIGHT))
        x, y, _ = shape.position
        ahead = HOUSING_DEPTH / 2.0
        place = (x + ahead * math.cos(shape.yaw), y + ahead * math.sin(shape.yaw), height)
        orientation = quaternion_from_yaw(shape.yaw)
        levels: dict[Detail, tuple[MeshSurface, ...]] = {"full": surfaces, "reduced": surfaces}
        yield AssetNode(f"{name}.{color}", "", place, orientation, lamp=color, surfaces=levels)


@cache
def _visor() -> Mesh:
    """The upper half of a short pipe, with faces on both sides."""
    angle = np.linspace(-0.15, math.pi + 0.15, 9)
    arc = 0.0066 * np.column_stack([np.zeros(9), np.cos(angle), np.sin(angle)])
    depth = np.array([VISOR_DEPTH, 0.0, 0.0])
    outer = [quad(np.array([a, a + depth, b + depth, b])) for a, b in itertools.pairwise(arc)]
    inner = [quad(piece.positions[::-1]) for piece in outer]
    return joined([*outer, *inner])


_LOOKS = {
    "wall": _walls,
    "block": _block,
    "post": _post,
    "housing": _housing,
}


# -- construction boxes -----------------------------------------------------------------------------------------

_CELLS = {
    "front": (0.0, 0.0, 0.4, 1.0),
    "back": (0.0, 0.0, 0.4, 1.0),
    "left": (0.4, 0.0, 0.8, 1.0),
    "right": (0.4, 0.0, 0.8, 1.0),
    "top": (0.8, 0.0, 1.0, 0.2),
    "bottom": (0.8, 0.2, 1.0, 0.4),
}
"""Position of each face in the texture: left, upper, right, lower."""


def _box_uvs(face: str) -> Floats:
    left, upper, right, lower = _CELLS[face]
    e = 1.5 / SIZE  # keeps texture filtering within the face
    return np.array([(left + e, lower - e), (right - e, lower - e), (right - e, upper + e), (left + e, upper + e)])


@cache
def _box_texture() -> NDArray[np.uint8]:
    """Cardboard with brown tape, an orange and white band on all sides, and shipping marks."""
    stripes = "".join(f'<path d="M{x} 42 l10 -20 h10 l-10 20 Z" fill="#e8641b"/>' for x in range(-20, 90, 20))
    band = f'<path d="M0 22 H80 V42 H0 Z" fill="#f1eee6"/>{stripes}<path d="M0 22 H80 M0 42 H80" stroke="#8a5a26" stroke-opacity=".5" stroke-width=".5"/>'
    tape = '<path d="M16.2 0 h7.6 v16 l-1 -.8 -1 .8 -1 -.8 -1 .8 -1 -.8 -1 .8 -1.6 -.8 Z" fill="#a8753a" fill-opacity=".85"/>'
    arrows = (
        '<g fill="#3a2a18" fill-opacity=".8"><path d="M49 86 v-9 h-2.4 l4.4 -6 4.4 6 h-2.4 v9 Z M60 86 v-9 h-2.4 l4.4 -6 4.4 6 h-2.4 v9 Z"/>'
        '<path d="M46 89 h21 v1.6 h-21 Z"/></g>'
    )
    label = (
        '<rect x="6" y="62" width="19" height="13" fill="#f3f1ea"/><g fill="#26221d"><path d="M8 64 h9 v1.4 h-9 Z M8 66.6 h12 v.8 h-12 Z '
        'M8 68.2 h10 v.8 h-10 Z"/><path d="M8 70.4 h.6 v3 h-.6 Z m1.2 0 h1 v3 h-1 Z m1.6 0 h.5 v3 h-.5 Z m1.1 0 h1.2 v3 h-1.2 Z m1.8 0 h.5 v3 h-.5 Z '
        'm1 0 h1 v3 h-1 Z m1.6 0 h.5 v3 h-.5 Z"/></g>'
    )
    lid = '<path d="M80 10 H100" stroke="#5b3d1c" stroke-width=".35"/><path d="M80 6.2 h20 v7.6 h-20 Z" fill="#a8753a" fill-opacity=".85"/>'
    edges = '<path d="M0 0 V100 M40 0 V100 M80 0 V100 M0 0 H100 M80 20 H100 M0 100 H100" stroke="#7d5527" stroke-opacity=".45" stroke-width=".8" fill="none"/>'
    svg = f'<rect width="100" height="100" fill="#ba9264"/>{band}{tape}{arrows}{label}{lid}{edges}'
    image = _rasterized(svg, 100).astype(np.float64)
    paper = texture("cardboard").astype(np.float64)
    return np.clip(image * (paper / paper.mean((0, 1))), 0, 255).astype(np.uint8)
