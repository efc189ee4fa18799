"""How a map looks: ground from the very polygons that are driven on, and the solid things that stand on it.

Every point of the ground belongs to one surface only: markings are cut out of the road, the road and its kerb out of
the lawn and the floor. So nothing lies over another thing, and nothing flickers, from however far it is seen.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.maps.map import GRID, Map
from autodrive.maps.mesh_solids import box_surfaces, prop_surfaces, sign_atlas, static_surfaces
from autodrive.maps.module import MarkingKind
from autodrive.maps.shapes import rectangle
from autodrive.render.asset import Asset, Label, Material, Node, Surface
from autodrive.render.textures import texture
from autodrive.state import Floats

TILE = 1.0
"""Edge of the pieces that the ground is cut into, so that what is out of sight is left out [m]."""
KERB_WIDTH, KERB_HEIGHT = 0.02, 0.006
"""Kerb stones of 0.28 m and 0.08 m at scale 1:14; not in the report [m]."""
HORIZON = 40.0
"""The floor goes on so far around the map [m]."""
UNDERLAY = -0.004
"""A dark plane below, so that no light comes through where triangles meet [m]."""

LABELS: dict[MarkingKind, Label] = {
    "edge": Label.EDGE_LINE,
    "separation": Label.SEPARATION_LINE,
    "stop_line": Label.STOP_LINE,
    "crossing": Label.CROSSING,
    "bay": Label.BAY_LINE,
}

ASPHALT = Material("asphalt", (1.0, 1.0, 1.0), roughness=0.92, texture="asphalt")
GRASS = Material("grass", (1.0, 1.0, 1.0), roughness=0.95, texture="grass")
FLOOR = Material("concrete", (1.0, 1.0, 1.0), roughness=0.85, texture="concrete")
KERB = Material("kerbstone", (1.0, 1.0, 1.0), roughness=0.85, texture="kerbstone")
PAINT = Material("road_paint", (0.74, 0.74, 0.71), roughness=0.75)
DARK = Material("underlay", (0.06, 0.06, 0.06), roughness=1.0)

REPEAT = {"asphalt": 0.5, "grass": 0.6, "concrete": 1.0, "kerbstone": 0.25}
"""A texture covers a square of that edge [m]."""


def map_asset(map_: Map) -> Asset:
    """All of a map that does not move."""
    ground = list(ground_layers(map_))
    x0, y0, x1, y1 = map_.bounds
    nodes = [_node("floor", *_outside(map_))]
    for i, x in enumerate(np.arange(x0, x1, TILE)):
        for j, y in enumerate(np.arange(y0, y1, TILE)):
            square = shapely.box(x, y, min(x + TILE, x1), min(y + TILE, y1))
            cut = [(m, label, _areas(shapely.intersection(g, square, grid_size=GRID))) for m, label, g in ground]
            surfaces = [level(g, m, label) for m, label, g in cut if g.area > 1e-7]
            kerb = [side for m, _, g in cut if m is KERB and g.area > 1e-7 for side in [_kerb_sides(g, square)] if side]
            nodes.append(_node(f"tile_{i}_{j}", *surfaces, *kerb))
    nodes += [_node(shape.name, *static_surfaces(shape), casts=True) for shape in map_.statics]
    nodes += [_node(f"{prop.name}.face", *prop_surfaces(prop)) for prop in map_.props]
    used = {s.material.texture for node in nodes for s in node.surfaces["full"] if s.material.texture}
    return Asset(
        map_.name, tuple(nodes), {name: sign_atlas() if name == "signs" else texture(name) for name in sorted(used)}
    )


def box_asset(size: tuple[float, float, float]) -> Asset:
    """A construction box of that length, width and height [m], around its middle."""
    return Asset("box", (_node("box", *box_surfaces(size), casts=True),), {"box": texture("box")})


def ground_layers(map_: Map) -> Iterator[tuple[Material, Label, BaseGeometry]]:
    """Material, label and area of all ground within the map's bounds; the areas do not overlap."""
    free = shapely.box(*map_.bounds)
    road = map_.drivable
    for marking_kind, label in LABELS.items():
        painted = shapely.union_all([m.geometry for m in map_.markings if m.kind == marking_kind], grid_size=GRID)
        painted = shapely.intersection(painted, road, grid_size=GRID)
        road = shapely.difference(road, painted, grid_size=GRID)
        yield PAINT, label, painted
    yield ASPHALT, Label.ROAD, road
    kerb = shapely.intersection(kerb_area(map_), free, grid_size=GRID)
    yield KERB, Label.KERB, kerb
    free = shapely.difference(free, shapely.union(map_.drivable, kerb, grid_size=GRID), grid_size=GRID)
    lawn = shapely.intersection(_of(map_, "lawn"), free, grid_size=GRID)
    yield GRASS, Label.LAWN, lawn
    yield FLOOR, Label.GROUND, shapely.difference(free, lawn, grid_size=GRID)


def kerb_area(map_: Map) -> BaseGeometry:
    """The strip along the edge of the modules' roads, left open where a road leads on."""
    road = shapely.union_all([one.drivable for one in map_.modules], grid_size=GRID)
    strip = shapely.difference(road.buffer(KERB_WIDTH, join_style="round"), map_.drivable, grid_size=GRID)
    gaps = [
        rectangle(port.pose, 4.0 * KERB_WIDTH, port.width)
        for i, one in enumerate(map_.modules)
        for port in one.ports
        if not port.is_blind and (i, port.name) not in map_.joins
    ]
    solids = [shape.plan for shape in map_.statics if shape.span[0] < KERB_HEIGHT]
    return shapely.difference(strip, shapely.union_all([*gaps, *solids]), grid_size=GRID)


def level(area: BaseGeometry, material: Material, label: Label, height: float | None = None) -> Surface:
    """The area as triangles, at its height [m]."""
    rings = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    corners = shapely.get_coordinates(rings).reshape(-1, 4, 2)[:, :3]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    is_clockwise = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    corners[is_clockwise] = corners[is_clockwise, ::-1]
    points, triangles = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    if height is None:
        height = KERB_HEIGHT if material is KERB else 0.0
    return Surface(
        material,
        np.column_stack([points, np.full(len(points), height)]).astype(np.float32),
        np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(points), 1)),
        triangles.reshape(-1, 3).astype(np.uint32),
        label,
        uvs=_uvs(points, material),
    )


def _uvs(points: Floats, material: Material) -> np.ndarray | None:
    """Textures run on over all pieces of ground."""
    return (points / REPEAT[material.texture]).astype(np.float32) if material.texture else None


def _outside(map_: Map) -> Iterator[Surface]:
    """The floor from the map's bounds to the horizon, and the plane below everything."""
    x0, y0, x1, y1 = map_.bounds
    everything = shapely.box(x0 - HORIZON, y0 - HORIZON, x1 + HORIZON, y1 + HORIZON)
    yield level(_areas(everything.difference(shapely.box(*map_.bounds))), FLOOR, Label.GROUND)
    yield level(shapely.box(*map_.bounds), DARK, Label.GROUND, UNDERLAY)


def _kerb_sides(kerb: BaseGeometry, square: shapely.Polygon) -> Surface | None:
    """The upright faces of the kerb, but not where it was cut by the edge of a tile."""
    edge = kerb.boundary.difference(square.exterior.buffer(1e-5))
    parts = [part for part in shapely.get_parts(edge) if part.length > 1e-4]
    positions, normals = [], []
    for part in parts:
        at = shapely.get_coordinates(part)
        for a, b in itertools.pairwise(at):
            along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)
            outward = np.array([along[1], -along[0]])
            if shapely.contains_xy(kerb, *(0.5 * (a + b) + 1e-4 * outward)):
                a, b, outward = b, a, -outward  # noqa: PLW2901 (the same edge, the other way round)
            positions += [(*a, 0.0), (*b, 0.0), (*b, KERB_HEIGHT), (*a, KERB_HEIGHT)]
            normals += [(*outward, 0.0)] * 4
    if not positions:
        return None
    points = np.array(positions, np.float32)
    quads = 4 * np.arange(len(points) // 4)[:, None]
    triangles = (quads[..., None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3).astype(np.uint32)
    uvs = np.column_stack([points[:, 0] + points[:, 1], points[:, 2]]) / REPEAT["kerbstone"]
    return Surface(KERB, points, np.array(normals, np.float32), triangles, Label.KERB, uvs=uvs.astype(np.float32))


def _areas(geometry: BaseGeometry) -> shapely.MultiPolygon:
    """Without the lines and points that an intersection may leave."""
    return shapely.MultiPolygon([part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"])


def _of(map_: Map, kind: str) -> BaseGeometry:
    return shapely.union_all([surface.geometry for surface in map_.surfaces if surface.kind == kind])


def _node(name: str, *surfaces: Surface, casts: bool = False) -> Node:
    details = {"full": surfaces, "reduced": surfaces, **({"shadow": surfaces} if casts else {})}
    return Node(name, surfaces=details)  # pyright: ignore[reportArgumentType]
