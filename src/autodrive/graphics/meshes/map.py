"""Builds the assets of maps and construction boxes from the polygons that the simulation uses.

The ground is one layer without overlaps (paint fills holes of the road, roads fill holes of the lawn), so that nothing
flickers. Adjacent pieces share bit-identical vertices, so that there are no cracks between them.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import manifold3d
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from autodrive.graphics.assets.asset import Asset, AssetNode, Material
from autodrive.graphics.meshes.map_solids import box_asset, solid_nodes, solid_texture
from autodrive.graphics.meshes.polygons import Mesh
from autodrive.graphics.meshes.strips import Line, painted_lines, shade_along, strips
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.ground import SIMPLIFY_TOLERANCE, TILE, Region, floor_extent, regions, tile_extent
from autodrive.scenario.maps.map import GRID

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.graphics.assets.asset import MeshSurface
    from autodrive.scenario.maps.map import Map

__all__ = ["box_asset", "map_asset"]

KERB_HEIGHT, KERB_STEP = 0.006, 0.003
"""Heights of kerb and pavement, and of the face of the kerb towards the road [m]; all outside the drivable area."""

WHITE = Material("paint", (0.82, 0.82, 0.79), roughness=0.7)
"""As `PAINT` in render/shaders/light.glsl."""
MATERIALS = {
    "floor": (Material("floor", (1.0, 1.0, 1.0), roughness=0.9, texture="floor"), 1.6),
    "lawn": (Material("lawn", (1.0, 1.0, 1.0), roughness=1.0, texture="grass"), 0.8),
    "road": (Material("road", (1.0, 1.0, 1.0), roughness=0.9, texture="asphalt"), 0.5),
    "track": (Material("track", (0.80, 0.80, 0.78), roughness=0.6, texture="floor"), 1.6),
    "pavement": (Material("pavement", (1.0, 1.0, 1.0), roughness=0.9, texture="pavement"), 0.5),
    "kerb": (Material("kerb", (1.0, 1.0, 1.0), roughness=0.85, texture="kerb"), 0.5),
    "bevel": (Material("kerb", (1.0, 1.0, 1.0), roughness=0.85, texture="kerb"), 0.5),
    "plain_paint": (WHITE, 1.0),
}
"""Material of each region, and the period of its texture [m]."""
RAISED = ("bevel", "kerb", "pavement")
KERB_SHADE, KERB_SHADE_WIDTH = 0.4, 0.012
WALL_SHADE, WALL_SHADE_WIDTH = 0.55, 0.1
"""Share of the sky that a kerb, and a wall or a building, hides from the ground at its foot, and how far [m]."""
DUCT_SHADE = 0.3
"""Likewise of a duct, from the ground below its face; a quarter of its width far."""


def map_asset(map_: Map) -> Asset:
    """The static part of a map. Nodes: 'tile_<i>' and 'floor' for the ground, and one for each solid, with its name."""
    kinds = regions(map_)
    lines, plain = painted_lines(
        [polygon for marking in map_.markings for polygon in shapely.get_parts(marking.geometry)], map_.drivable
    )
    nodes = [*_ground(map_, kinds, shapely.union_all(plain)), *solid_nodes(map_)]
    materials = [s.material for node in nodes for level in node.surfaces.values() for s in level]
    used = {(material.beneath or material).texture for material in materials} - {""} | {"clouds"}
    textures = {name: solid_texture(name) for name in sorted(used)}
    return Asset(map_.name, tuple(nodes), textures, strips([*lines, *_shade(map_, kinds)]))


def _shade(map_: Map, kinds: list[Region]) -> Iterator[Line]:
    """Shade at the feet of kerbs, walls, buildings and barriers."""
    if map_.track is not None:
        barrier = map_.track.barrier
        for face in map_.track.walls:  # a duct touches the floor half its width behind its face
            line = np.vstack([face, face[:1]])[::-1]
            if barrier.kind == "duct":
                yield shade_along(line, 0.25 * barrier.width, DUCT_SHADE, behind=0.5 * barrier.width)
            else:
                yield shade_along(line, WALL_SHADE_WIDTH, WALL_SHADE)
        return
    kerbs = shapely.union_all([kind.geometry for kind in kinds if kind.name in RAISED], grid_size=GRID)
    yield from _shade_around(kerbs, KERB_SHADE_WIDTH, KERB_SHADE)
    solids = shapely.union_all([shape.plan for shape in map_.statics if shape.material in ("wall", "block")])
    yield from _shade_around(solids, WALL_SHADE_WIDTH, WALL_SHADE)


def _shade_around(area: BaseGeometry, width: float, shade: float) -> Iterator[Line]:
    for polygon in shapely.get_parts(shapely.simplify(area, SIMPLIFY_TOLERANCE)):
        for ring in shapely.get_rings(orient(polygon)):  # the area is on the left
            yield shade_along(shapely.get_coordinates(ring), width, shade)


# -- ground -----------------------------------------------------------------------------------------------------


def _ground(map_: Map, of_map: list[Region], plain: BaseGeometry) -> Iterator[AssetNode]:
    """One node for each tile, and one for the floor around the tiles. `plain`: paint that is not in `Asset.strips`."""
    cells, kinds = _cells(map_, of_map)
    x0, y0, x1, y1 = tile_extent(map_)
    columns, rows = round((x1 - x0) / TILE), round((y1 - y0) / TILE)
    vertices = _Vertices(cells)
    is_kerb = np.array([kind.name in RAISED for kind in kinds])
    heights = vertices.heights([kind.name for kind in kinds])
    inside = shapely.point_on_surface(np.array(cells, dtype=object))
    is_plain = shapely.intersects(inside, plain)
    kinds = [
        replace(kind, name="plain_paint") if one and kind.name == "paint" else kind
        for kind, one in zip(kinds, is_plain, strict=True)
    ]
    middle = shapely.get_coordinates(inside)
    column, row = np.floor((middle - (x0, y0)) / TILE).astype(int).T
    is_outside = (column < 0) | (row < 0) | (column >= columns) | (row >= rows)
    tile = np.where(is_outside, -1, row * columns + column)
    walls = vertices.open_edges(is_kerb)
    road = "road" if map_.track is None else "track"
    for number in np.unique(tile):
        surfaces = _tile(np.flatnonzero(tile == number), kinds, vertices, heights, walls, road)
        name = "floor" if number < 0 else f"tile_{number}"
        yield AssetNode(name, surfaces={"full": surfaces, "reduced": surfaces})


def _cells(map_: Map, kinds: list[Region]) -> tuple[list[shapely.Polygon], list[Region]]:
    """Polygons that fill the extent of the floor, cut at the borders of tiles, and the region of each polygon."""
    x0, y0, x1, y1 = tile_extent(map_)
    far = floor_extent(map_)
    cuts = [shapely.LineString([(x, y0), (x, y1)]) for x in np.arange(x0, x1 + TILE / 2.0, TILE)]
    cuts += [shapely.LineString([(x0, y), (x1, y)]) for y in np.arange(y0, y1 + TILE / 2.0, TILE)]
    cuts += [shapely.LineString([a, b]) for a, b in zip(_corners(x0, y0, x1, y1), _corners(*far), strict=True)]
    lines = [shapely.boundary(kind.geometry) for kind in kinds]
    noded = shapely.union_all([*lines, *cuts], grid_size=GRID)
    cells = list(shapely.get_parts(shapely.polygonize(shapely.get_parts(noded))))
    tree = shapely.STRtree([kind.geometry for kind in kinds])
    points = shapely.point_on_surface(np.array(cells, dtype=object))
    which = np.full(len(cells), -1)
    found = tree.query(points, predicate="intersects")
    which[found[0]] = found[1]
    kept = [i for i in range(len(cells)) if which[i] >= 0]
    return [orient(cells[i]) for i in kept], [kinds[which[i]] for i in kept]


def _corners(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


class _Vertices:
    """The vertices of all cells, without duplicates."""

    def __init__(self, cells: list[shapely.Polygon]) -> None:
        self.rings: list[list[Floats]] = [
            [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(cell)] for cell in cells
        ]
        flat = np.concatenate([ring for rings in self.rings for ring in rings])
        _, first, index = np.unique(
            np.round(flat / GRID).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        self.points = flat[first]
        index = index.ravel()
        starts = np.cumsum([0, *(len(ring) for rings in self.rings for ring in rings)])
        pieces = iter(np.split(index, starts[1:-1]))
        self.ids: list[list[NDArray[np.integer]]] = [[next(pieces) for _ in rings] for rings in self.rings]

    def heights(self, names: list[str]) -> dict[str, Floats]:
        """Height of each vertex for each raised region [m]; a bevel is lower where it touches the road."""
        low = np.zeros(len(self.points), bool)
        for name, rings in zip(names, self.ids, strict=True):
            if name in ("road", "paint", "plain_paint"):
                for ring in rings:
                    low[ring] = True
        bevel = np.where(low, KERB_STEP, KERB_HEIGHT)
        level = np.full(len(low), KERB_HEIGHT)
        return {"bevel": bevel, "kerb": level, "pavement": level}

    def open_edges(self, is_raised: NDArray[np.bool_]) -> dict[int, list[tuple[int, int]]]:
        """For each raised cell, its edges to ground that is not raised."""
        owner: dict[tuple[int, int], int] = {}
        for cell in np.flatnonzero(is_raised):
            for ring in self.ids[cell]:
                owner.update(dict.fromkeys(zip(ring.tolist(), np.roll(ring, -1).tolist(), strict=True), int(cell)))
        found: dict[int, list[tuple[int, int]]] = {}
        for (a, b), cell in owner.items():
            if (b, a) not in owner:
                found.setdefault(cell, []).append((a, b))
        return found


MAX_TILES = 4000
_tiles: dict[Hashable, tuple[MeshSurface, ...]] = {}
"""Surfaces of tiles, by all that they follow from: an edit of a map changes few of them."""


def _tile(
    cells: NDArray[np.integer],
    kinds: list[Region],
    vertices: _Vertices,
    heights: dict[str, Floats],
    walls: dict[int, list[tuple[int, int]]],
    road: str,
) -> tuple[MeshSurface, ...]:
    """The surfaces of a tile, which are those of an equal one, if there was one."""
    key: list[Hashable] = [road]
    for cell in cells.tolist():
        kind = kinds[cell]
        key += [kind.name, kind.label]
        for ring, ids in zip(vertices.rings[cell], vertices.ids[cell], strict=True):
            key += [ring.tobytes(), vertices.points[ids].tobytes()]
            if kind.name in heights:
                key.append(heights[kind.name][ids].tobytes())
        key.append(vertices.points[walls[cell]].tobytes() if cell in walls else b"")
    if (found := _tiles.get(known := tuple(key))) is None:
        if len(_tiles) >= MAX_TILES:
            _tiles.clear()
        found = _tiles[known] = tuple(_surfaces(cells, kinds, vertices, heights, walls, road))
    return found


def _surfaces(
    cells: NDArray[np.integer],
    kinds: list[Region],
    vertices: _Vertices,
    heights: dict[str, Floats],
    walls: dict[int, list[tuple[int, int]]],
    road: str,
) -> Iterator[MeshSurface]:
    """The surfaces of a tile, one for each kind of ground. `road`: the kind beneath paint."""
    groups: dict[tuple[str, Label], list[int]] = {}
    for cell in cells.tolist():
        groups.setdefault((kinds[cell].name, kinds[cell].label), []).append(cell)
    for (name, label), members in groups.items():
        material, period = MATERIALS[road if name == "paint" else name]
        if name == "paint":
            material = replace(WHITE, beneath=material)
        ids = np.concatenate([_triangles(vertices.rings[cell], vertices.ids[cell]) for cell in members])
        used, triangles = np.unique(ids, return_inverse=True)
        z = heights[name][used] if name in heights else np.zeros(len(used))
        positions = np.column_stack([vertices.points[used], z])
        normals = np.tile((0.0, 0.0, 1.0), (len(used), 1))
        triangles = triangles.reshape(-1, 3)
        if name == "bevel":
            normals = _smooth(positions, triangles)
        yield Mesh(positions, normals, triangles, _uvs(positions, period)).surface(material, label)
    edges = [(edge, heights[kinds[cell].name]) for cell in cells.tolist() for edge in walls.get(cell, [])]
    if edges:
        material, period = MATERIALS["kerb"]
        yield _faces(vertices.points, edges, period).surface(material, Label.KERB)


def _triangles(rings: list[Floats], ids: list[NDArray[np.integer]]) -> NDArray[np.integer]:
    """Triangulates a cell. Uses every vertex of its rings, also on straight sides, so that there are no cracks."""
    return np.concatenate(ids)[np.asarray(manifold3d.triangulate(rings)).reshape(-1, 3)]


def _faces(points: Floats, edges: list[tuple[tuple[int, int], Floats]], period: float) -> Mesh:
    """Vertical faces from raised edges down to the ground."""
    a, b = np.array([edge for edge, _ in edges]).T
    top_a, top_b = np.array([(z[i], z[j]) for (i, j), z in edges]).T
    zero = np.zeros(len(a))
    corners = [(a, zero), (b, zero), (b, top_b), (a, top_a)]
    positions = np.stack([np.column_stack([points[i], z]) for i, z in corners], axis=1)
    along = points[b] - points[a]
    normal = np.column_stack([along[:, 1], -along[:, 0], zero]) / np.linalg.norm(along, axis=1)[:, None]
    triangles = 4 * np.arange(len(a))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    flat = positions.reshape(-1, 3)
    uvs = _uvs(flat, period) + np.column_stack([np.zeros(len(flat)), flat[:, 2] / period])
    return Mesh(flat, np.repeat(normal, 4, axis=0), triangles.reshape(-1, 3), uvs)


def _uvs(positions: Floats, period: float) -> Floats:
    """Texture coordinates in the map frame, so that textures continue across borders of modules."""
    return positions[:, :2] * (1.0 / period, -1.0 / period)


def _smooth(positions: Floats, triangles: NDArray[np.integer]) -> Floats:
    """Normals of the vertices: area-weighted means of the normals of their triangles."""
    a, b, c = (positions[triangles[:, i]] for i in range(3))
    facing = np.cross(b - a, c - a)
    normals = np.zeros_like(positions)
    for i in range(3):
        np.add.at(normals, triangles[:, i], facing)
    return normals / np.linalg.norm(normals, axis=1)[:, None]
