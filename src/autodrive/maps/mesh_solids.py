"""What stands on a map, as it looks: walls, blocks, traffic signs, traffic lights, construction boxes."""

# ruff: noqa: E501 (drawings are left whole)

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import resvg_py

from autodrive.maps.icons import icon
from autodrive.maps.mesh_parts import Mesh, box, box_faces, joined, moved, plane, quad, rim, tube
from autodrive.maps.props import HOUSING_DEPTH, LAMP_HEIGHTS, PLATE_SIZE, SIGNS, Prop
from autodrive.maps.solids import StaticShape
from autodrive.render.asset import Asset, Detail, Label, Material, Node, Surface
from autodrive.render.png import decode_png
from autodrive.render.textures import SIZE, texture
from autodrive.transforms import quaternion_from_yaw

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.maps.map import Map
    from autodrive.state import Floats

WALL = Material("wall", (0.62, 0.63, 0.62), roughness=0.9, texture="plaster")
COPING = Material("coping", (0.36, 0.37, 0.38), roughness=0.8)
BLOCK = Material("block", (0.95, 0.88, 0.76), roughness=0.9, texture="plaster")
ROOF = Material("roof", (0.13, 0.125, 0.12), roughness=0.9)
STEEL = Material("steel", (0.36, 0.37, 0.38), roughness=0.6)
FACE = Material("sign_face", (1.0, 1.0, 1.0), roughness=0.6, texture="signs")
HOUSING = Material("housing", (0.022, 0.024, 0.026), roughness=0.65)
LENSES = {
    "red": Material("lens_red", (0.34, 0.012, 0.010), roughness=0.3),
    "yellow": Material("lens_yellow", (0.42, 0.20, 0.010), roughness=0.3),
    "green": Material("lens_green", (0.012, 0.22, 0.075), roughness=0.3),
}
CARDBOARD = Material("cardboard", (1.0, 1.0, 1.0), roughness=0.9, texture="box")
ATLAS = 3
"""Faces of signs in each row and column of their picture."""


def solid_nodes(map_: Map) -> Iterator[Node]:
    """A node for each solid thing that never moves; traffic lights have one for each lens, too."""
    props = {prop.name: prop for prop in map_.props}
    for shape in map_.statics:
        name, _, part = shape.name.rpartition(".")
        yield _node(shape, props.get(name) if part == shape.material else None)
        if shape.material == "housing":
            yield from _lenses(shape, name)


def box_asset(size: tuple[float, float, float]) -> Asset:
    """A construction box of that length, width and height [m] around its centre: cardboard, taped, striped."""
    half = (size[0] / 2.0, size[1] / 2.0, size[2] / 2.0)
    whole = joined(quad(corners, _box_uvs(name)) for name, corners in box_faces(half).items())
    surfaces = (whole.surface(CARDBOARD, Label.BOX),)
    node = Node("box", surfaces={"full": surfaces, "reduced": surfaces, "shadow": surfaces})
    return Asset("box", (node,), {"box": _box_picture()})


def _node(shape: StaticShape, prop: Prop | None) -> Node:
    if shape.material == "plate" and prop is not None:
        surfaces = _plate(prop, shape.size[0])
    else:
        surfaces = _LOOKS[shape.material](shape)
    levels: dict[Detail, tuple[Surface, ...]] = {"full": surfaces, "reduced": surfaces, "shadow": surfaces}
    return Node(shape.name, "", shape.position, quaternion_from_yaw(shape.yaw), surfaces=levels)


# -- walls and blocks -------------------------------------------------------------------------------------------


def _wall(shape: StaticShape) -> tuple[Surface, ...]:
    """Plaster under a coping."""
    return _capped(shape, WALL, COPING, Label.WALL)


def _block(shape: StaticShape) -> tuple[Surface, ...]:
    """A house without windows: bright walls, dark roof behind a parapet."""
    return _capped(shape, BLOCK, ROOF, Label.BLOCK)


def _capped(shape: StaticShape, sides: Material, top: Material, label: Label) -> tuple[Surface, ...]:
    faces = box_faces(shape.size)
    walls = []
    for name in ("front", "left", "back", "right"):
        corners = faces[name]
        along, up = np.linalg.norm(corners[1] - corners[0]) / 0.5, 2.0 * shape.size[2] / 0.5
        walls.append(quad(corners, np.array([(0.0, 0.0), (along, 0.0), (along, -up), (0.0, -up)])))
    return joined(walls).surface(sides, label), quad(faces["top"]).surface(top, label)


def _post(shape: StaticShape) -> tuple[Surface, ...]:
    return (tube(shape.size[0], -shape.size[1], shape.size[1], 10).surface(STEEL, Label.POST),)


# -- signs ------------------------------------------------------------------------------------------------------


def _plate(prop: Prop, half_thickness: float) -> tuple[Surface, ...]:
    """A plate with the outline of its sign: face along x, back and edge of steel."""
    outline = OUTLINES.get(prop.kind, SQUARE)
    column, row = SIGNS.index(prop.kind) % ATLAS, SIGNS.index(prop.kind) // ATLAS
    front = plane(outline * PLATE_SIZE, half_thickness)
    # as a driver sees it: y of the plate to his right
    picture = np.column_stack([outline[:, 0] / 1.04 + 0.5, 0.5 - outline[:, 1] / 1.04])
    front = front._replace(uvs=(picture + np.array((column, row))) / ATLAS)
    back = plane(outline * PLATE_SIZE, -half_thickness)
    back = back._replace(normals=-back.normals, triangles=back.triangles[:, ::-1])
    edge = rim(outline * PLATE_SIZE, -half_thickness, half_thickness)
    return (
        _upright(front).surface(FACE, Label.SIGN),
        _upright(joined([back, edge])).surface(STEEL, Label.SIGN),
    )


def _upright(mesh: Mesh) -> Mesh:
    """What lies level, seen from above with x to the right, to be seen from +x: right is +y, up is +z."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return mesh._replace(positions=mesh.positions @ turn.T, normals=mesh.normals @ turn.T)


def _round(segments: int, radius: float, start: float = 0.0) -> Floats:
    angle = start + np.arange(segments) * (2.0 * math.pi / segments)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


SQUARE = 0.475 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
_DIAMOND = np.array([(0.0, -0.5), (0.5, 0.0), (0.0, 0.5), (-0.5, 0.0)])
OUTLINES: dict[str, Floats] = {
    "stop": _round(8, 0.5 / math.cos(math.pi / 8.0), math.pi / 8.0),
    "give_way": np.array([(0.0, -0.5), (0.5, 0.4), (-0.5, 0.4)]),
    "no_parking": _round(24, 0.48),
    **dict.fromkeys(("left_curve", "right_curve", "side_road_left", "side_road_right"), _DIAMOND),
}
"""Of the plates of the signs, as in `maps.icons`; the others are square."""


@cache
def sign_faces() -> NDArray[np.uint8]:
    """The faces of all signs in one picture."""
    faces = "".join(
        f'<g transform="translate({i % ATLAS + 0.5} {i // ATLAS + 0.5}) scale({1 / 1.04} {-1 / 1.04})">{icon(sign)}</g>'  # pyright: ignore[reportArgumentType]
        for i, sign in enumerate(SIGNS)
    )
    return _drawn(f'<rect width="{ATLAS}" height="{ATLAS}" fill="#8d9092"/>{faces}', ATLAS)


def _drawn(elements: str, extent: float) -> NDArray[np.uint8]:
    """A square drawing of that extent as a picture."""
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}" '
        f'viewBox="0 0 {extent} {extent}">{elements}</svg>'
    )
    return decode_png(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=True))[..., :3]


# -- traffic lights ---------------------------------------------------------------------------------------------


def _housing(shape: StaticShape) -> tuple[Surface, ...]:
    return (box(shape.size).surface(HOUSING, Label.TRAFFIC_LIGHT),)


def _lenses(shape: StaticShape, name: str) -> Iterator[Node]:
    """Each under its visor."""
    for color, height in LAMP_HEIGHTS.items():
        lens = _upright(moved(plane(_round(14, 0.0055)), (0.0, 0.0, 0.0005))).surface(
            LENSES[color], Label.TRAFFIC_LIGHT
        )
        surfaces = (lens, _visor().surface(HOUSING, Label.TRAFFIC_LIGHT))
        x, y, _ = shape.position
        ahead = HOUSING_DEPTH / 2.0
        place = (x + ahead * math.cos(shape.yaw), y + ahead * math.sin(shape.yaw), height)
        orientation = quaternion_from_yaw(shape.yaw)
        yield Node(f"{name}.{color}", "", place, orientation, surfaces={"full": surfaces, "reduced": surfaces})


@cache
def _visor() -> Mesh:
    """The upper half of a short pipe, seen from inside and outside."""
    angle = np.linspace(-0.15, math.pi + 0.15, 9)
    arc = 0.0066 * np.column_stack([np.zeros(9), np.cos(angle), np.sin(angle)])
    depth = np.array([0.007, 0.0, 0.0])
    outer = [quad(np.array([a, a + depth, b + depth, b])) for a, b in itertools.pairwise(arc)]
    inner = [quad(piece.positions[::-1]) for piece in outer]
    return joined([*outer, *inner])


_LOOKS = {"wall": _wall, "block": _block, "post": _post, "housing": _housing}


# -- construction boxes -----------------------------------------------------------------------------------------

_CELLS = {
    "front": (0.0, 0.0, 0.4, 1.0),
    "back": (0.0, 0.0, 0.4, 1.0),
    "left": (0.4, 0.0, 0.8, 1.0),
    "right": (0.4, 0.0, 0.8, 1.0),
    "top": (0.8, 0.0, 1.0, 0.2),
    "bottom": (0.8, 0.2, 1.0, 0.4),
}
"""Where in the picture each face is: left, upper, right, lower."""


def _box_uvs(face: str) -> Floats:
    left, upper, right, lower = _CELLS[face]
    e = 1.5 / SIZE  # not into the neighbour
    return np.array([(left + e, lower - e), (right - e, lower - e), (right - e, upper + e), (left + e, upper + e)])


@cache
def _box_picture() -> NDArray[np.uint8]:
    """Stout cardboard with brown tape, a band of orange and white on all sides, and the usual marks."""
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
    elements = f'<rect width="100" height="100" fill="#ba9264"/>{band}{tape}{arrows}{label}{lid}{edges}'
    drawn = _drawn(elements, 100).astype(np.float64)
    paper = texture("cardboard").astype(np.float64)
    return np.clip(drawn * (paper / paper.mean((0, 1))), 0, 255).astype(np.uint8)
