"""Divides the ground of a map into square tiles: cells that belong to one layer each, and their surfaces.

A tile follows from the outlines within it and from the layers of its cells, and is made once: an edit of a map changes
few tiles. Adjacent cells share bit-identical vertices, so that there are no cracks between them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import manifold3d
import numpy as np
import shapely
from shapely.geometry.polygon import orient

from autodrive.graphics.assets.asset import Material
from autodrive.graphics.meshes.polygons import Mesh
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.ground import Layer
from autodrive.scenario.maps.map import GRID

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.graphics.assets.asset import MeshSurface

T = TypeVar("T")
Integers: TypeAlias = "NDArray[np.int64]"
Extent: TypeAlias = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max."""
Rings: TypeAlias = tuple[Integers, ...]
"""Rings of a cell, each of shape (n, 2): the outer one, turning left, then its holes."""

KERB_HEIGHT, KERB_STEP = 0.0045, 0.003
"""Heights of kerb and pavement, and of the face of the kerb towards the road [m]; all outside the drivable area. They
are drawn only: for wheels and LIDARs the ground is level."""

WHITE = Material("paint", (0.82, 0.82, 0.79), roughness=0.7)
"""Material of paint; its colour is `PAINT` in render/shaders/light.glsl."""
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
"""Material of each layer, and the period of its texture [m]."""
RAISED = ("bevel", "kerb", "pavement")
LEVEL = ("kerb", "pavement")

SCALE = round(1.0 / GRID)
"""Outlines have integer coordinates [1/SCALE m], from here on."""
MAX_TILES = 10_000
"""Most tiles that are remembered."""


@dataclass(frozen=True, eq=False)
class _Tile:
    """Equal tiles are one object, as long as it is remembered."""

    cells: tuple[Rings, ...]
    layers: tuple[tuple[str, Label], ...]
    """Name and label of the layer of each cell."""
    level: frozenset[int]
    """The vertices of kerb and pavement; see `_packed`."""
    edges: dict[tuple[int, int], int]
    """The cell of each edge of raised cells."""


_cells: dict[Hashable, tuple[tuple[Rings, ...], Floats]] = {}
"""The rings of the cells of a tile, and a point within each cell [m], by the outlines and borders within the tile."""
_tiles: dict[Hashable, _Tile] = {}
_made: dict[Hashable, tuple[MeshSurface, ...]] = {}


def tile_surfaces(
    layers: Sequence[Layer], extent: Extent, far: Extent, *, size: float
) -> Iterator[tuple[int, tuple[MeshSurface, ...]]]:
    """Number and surfaces of each tile; -1: the floor around them, as far as `far` [m].

    `layers`: a point belongs to the first one that contains it, to paint only on the road, else to the floor.
    `extent`: of the tiles [m], in multiples of the length `size` of their edges. They are numbered from the least y,
    and in each row from the least x.
    """
    edge = round(size * SCALE)
    x0, y0, x1, y1 = within = _integers(extent)
    columns, rows = (x1 - x0) // edge, (y1 - y0) // edge
    pieces = _cut(_cut(_outlines(layers), edge, 0), edge, 1)
    vertical, horizontal = _borders(pieces, within, edge)
    outlines = _by_tile(pieces, vertical, horizontal, within, edge)
    keys = [outline.tobytes() for outline in outlines]
    cells = [
        _known(_cells, key, lambda outline=outline: _polygonized(outline))
        for key, outline in zip(keys, outlines, strict=True)
    ]
    kinds = iter(_layers_at(layers, np.concatenate([points for _, points in cells])))
    tiles: list[_Tile] = []
    for key, (rings, _) in zip(keys, cells, strict=True):
        own = tuple(next(kinds) for _ in rings)
        tiles.append(_known(_tiles, (key, own), lambda rings=rings, own=own: _tile(rings, own)))
    road = next((layer.name for layer in layers if layer.name in ("road", "track")), "road")
    yield -1, (_level(_floor(vertical, horizontal, within, _integers(far)), "floor", Label.GROUND),)
    for number, tile in enumerate(tiles):
        row, column = divmod(number, columns)
        near = [(r, c) for r in (row - 1, row, row + 1) for c in (column - 1, column, column + 1)]
        # what is raised depends on the tiles around it; others need not be made again with them
        around = [tiles[r * columns + c] for r, c in near if 0 <= r < rows and 0 <= c < columns] if tile.edges else []
        yield number, _known(_made, (road, tile, *around), lambda tile=tile, near=around: _surfaces(tile, near, road))


def _known(known: dict[Hashable, T], key: Hashable, make: Callable[[], T]) -> T:
    """What was made for that key, or is made now."""
    if (made := known.get(key)) is None:
        if len(known) >= MAX_TILES:
            known.clear()
        made = known[key] = make()
    return made


def _integers(extent: Extent) -> tuple[int, int, int, int]:
    x0, y0, x1, y1 = (round(value * SCALE) for value in extent)
    return x0, y0, x1, y1


# -- outlines: lines from x0, y0 to x1, y1, shape (n, 4) -------------------------------------------------------------


def _outlines(layers: Iterable[Layer]) -> Integers:
    """The edges of all polygons; equal ones have the same direction."""
    rings = shapely.get_rings(np.concatenate([layer.polygons for layer in layers]))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    points = np.rint(points * SCALE).astype(np.int64)
    a, b = points[:-1][ring[1:] == ring[:-1]], points[1:][ring[1:] == ring[:-1]]
    is_turned = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    lines = np.hstack([a, b])
    lines[is_turned] = lines[is_turned][:, [2, 3, 0, 1]]
    return lines[(a != b).any(axis=1)]


def _cut(lines: Integers, edge: int, axis: int) -> Integers:
    """The pieces of lines between the borders of tiles, which are at multiples of `edge` along that axis."""
    a, b = lines[:, axis], lines[:, axis + 2]
    first, last = np.minimum(a, b) // edge + 1, -(-np.maximum(a, b) // edge) - 1
    cuts = np.maximum(last - first + 1, 0)
    line = np.repeat(np.arange(len(lines)), cuts + 1)
    number = np.arange(len(line)) - np.repeat(np.cumsum(cuts + 1) - cuts - 1, cuts + 1)
    pieces = lines[line]
    for end in (0, 2):
        before = number - 1 + end // 2  # cuts of the line before this end of the piece
        is_cut = (before >= 0) & (before < cuts[line])
        own, before = line[is_cut], before[is_cut]
        at = np.where(a[own] < b[own], first[own] + before, last[own] - before) * edge
        share = (at - a[own]) / (b[own] - a[own])
        start, stop = lines[own, 1 - axis], lines[own, 3 - axis]
        pieces[is_cut, end + axis] = at
        pieces[is_cut, end + 1 - axis] = np.rint(start + share * (stop - start)).astype(np.int64)
    return pieces[(pieces[:, :2] != pieces[:, 2:]).any(axis=1)]


def _borders(pieces: Integers, extent: tuple[int, int, int, int], edge: int) -> tuple[Integers, Integers]:
    """The borders of the tiles along y and those along x, in pieces between all points on them."""
    x0, y0, x1, y1 = extent
    xs, ys = np.arange(x0, x1 + 1, edge), np.arange(y0, y1 + 1, edge)
    corners = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    ends = pieces.reshape(-1, 2)
    ends = ends[((ends >= (x0, y0)) & (ends <= (x1, y1))).all(axis=1)]

    def along(axis: int) -> Integers:
        points = np.concatenate([corners, ends[ends[:, 1 - axis] % edge == 0]])
        points = points[np.lexsort((points[:, axis], points[:, 1 - axis]))]
        is_piece = (points[1:, 1 - axis] == points[:-1, 1 - axis]) & (points[1:, axis] != points[:-1, axis])
        return np.hstack([points[:-1], points[1:]])[is_piece]

    return along(1), along(0)


def _by_tile(
    pieces: Integers, vertical: Integers, horizontal: Integers, extent: tuple[int, int, int, int], edge: int
) -> list[Integers]:
    """The pieces and borders within each tile, in ascending order."""
    x0, y0, x1, y1 = extent
    columns, rows = (x1 - x0) // edge, (y1 - y0) // edge
    is_border = [(pieces[:, i] == pieces[:, i + 2]) & (pieces[:, i] % edge == 0) for i in (0, 1)]
    pieces = pieces[~(is_border[0] | is_border[1])]
    lines = np.concatenate([pieces, vertical, vertical, horizontal, horizontal])
    column = (lines[:, 0] + lines[:, 2]) // (2 * edge) - x0 // edge
    row = (lines[:, 1] + lines[:, 3]) // (2 * edge) - y0 // edge
    n, v, h = len(pieces), len(vertical), len(horizontal)
    column[n : n + v] -= 1
    row[n + 2 * v : n + 2 * v + h] -= 1
    is_inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    tile, lines = (row * columns + column)[is_inside], lines[is_inside]
    order = np.lexsort((*lines.T[::-1], tile))
    tile, lines = tile[order], lines[order]
    is_new = np.concatenate([[True], (tile[1:] != tile[:-1]) | (lines[1:] != lines[:-1]).any(axis=1)])
    tile, lines = tile[is_new], lines[is_new]
    return np.split(lines, np.searchsorted(tile, np.arange(1, columns * rows)))


# -- cells ------------------------------------------------------------------------------------------------------------


def _polygonized(lines: Integers) -> tuple[tuple[Rings, ...], Floats]:
    """The cells between the lines, and a point within each of them [m], shape (n, 2)."""
    noded = shapely.union_all(_lines(lines.reshape(-1, 2, 2) / SCALE), grid_size=GRID)
    cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    return _rings(cells), shapely.get_coordinates(shapely.point_on_surface(cells))


def _lines(ends: Floats) -> Any:
    """Lines between the ends [m], shape (n, 2, 2)."""
    return shapely.linestrings(ends)


def _rings(cells: Iterable[shapely.Polygon]) -> tuple[Rings, ...]:
    return tuple(
        tuple(
            np.rint(shapely.get_coordinates(ring)[:-1] * SCALE).astype(np.int64)
            for ring in shapely.get_rings(orient(cell))
        )
        for cell in cells
    )


def _layers_at(layers: Sequence[Layer], points: Floats) -> list[tuple[str, Label]]:
    """Name and label of the layer at each point, shape (n, 2) [m]."""
    places: Any = shapely.points(points)
    tree = shapely.STRtree(places)

    def within(layer: Layer) -> NDArray[np.bool_]:
        is_inside = np.zeros(len(points), bool)
        is_inside[tree.query(layer.polygons, predicate="intersects")[1]] = True
        return is_inside

    inside = [within(layer) for layer in layers]
    is_driven = np.any([is_inside for layer, is_inside in zip(layers, inside, strict=True) if layer.is_driven], axis=0)
    numbers = np.full(len(points), len(layers))
    for i, (layer, is_inside) in reversed([*enumerate(zip(layers, inside, strict=True))]):
        numbers[is_inside & (is_driven if layer.is_paint else True)] = i
    kinds = [*((layer.name, layer.label) for layer in layers), ("floor", Label.GROUND)]
    return [kinds[i] for i in numbers.tolist()]


def _tile(cells: tuple[Rings, ...], layers: tuple[tuple[str, Label], ...]) -> _Tile:
    """The tile with these cells; those of one layer beside each other become one."""
    layer_of = {edge: layer for rings, layer in zip(cells, layers, strict=True) for edge in _edges(rings)}
    borders = {(min(a, b), max(a, b)) for (a, b), layer in layer_of.items() if layer_of.get((b, a)) != layer}
    if len(borders) < len({(min(a, b), max(a, b)) for a, b in layer_of}):
        lines = _lines(_unpacked(np.array(sorted(borders)).ravel()).reshape(-1, 2, 2))
        cells = _rings(shapely.get_parts(shapely.polygonize(lines)))
        layers = tuple(layer_of[next(_edges(rings))] for rings in cells)
    raised = [(number, rings) for number, rings in enumerate(cells) if layers[number][0] in RAISED]
    level = frozenset(a for number, rings in raised if layers[number][0] in LEVEL for a, _ in _edges(rings))
    return _Tile(cells, layers, level, {edge: number for number, rings in raised for edge in _edges(rings)})


def _edges(rings: Rings) -> Iterator[tuple[int, int]]:
    """The edges of a cell, which is on their left."""
    for ring in rings:
        ids = _packed(ring)
        yield from zip(ids.tolist(), np.roll(ids, -1).tolist(), strict=True)


def _packed(points: Integers) -> Integers:
    """An integer for each point, which sorts them by x, then y; maps are smaller than 2^31 / SCALE."""
    return (points[:, 0] << 32) + points[:, 1]


def _unpacked(ids: Integers) -> Floats:
    """Coordinates of points [m], shape (n, 2)."""
    y = (ids + (1 << 31)) % (1 << 32) - (1 << 31)
    return np.column_stack([(ids - y) >> 32, y]) / SCALE


def _floor(
    vertical: Integers, horizontal: Integers, extent: tuple[int, int, int, int], far: tuple[int, int, int, int]
) -> list[Rings]:
    """The four cells around the tiles."""
    x0, y0, x1, y1 = extent
    fx0, fy0, fx1, fy1 = far

    def side(lines: Integers, axis: int, at: int) -> Integers:
        """The points on a border, in ascending order."""
        own = lines[lines[:, axis] == at]
        return np.concatenate([own[:, :2], own[-1:, 2:]])

    outer = np.array([(fx0, fy0), (fx1, fy0), (fx1, fy1), (fx0, fy1)])
    inner = (
        side(horizontal, 1, y0)[::-1],
        side(vertical, 0, x1)[::-1],
        side(horizontal, 1, y1),
        side(vertical, 0, x0),
    )
    return [(np.concatenate([outer[[i, (i + 1) % 4]], inner[i]]),) for i in range(4)]


# -- surfaces ---------------------------------------------------------------------------------------------------------


def _surfaces(tile: _Tile, around: Sequence[_Tile], road: str) -> tuple[MeshSurface, ...]:
    """The surfaces of a tile, one for each kind of ground. `road`: the kind beneath paint."""
    groups: dict[tuple[str, Label], list[Rings]] = {}
    for rings, kind in zip(tile.cells, tile.layers, strict=True):
        groups.setdefault(kind, []).append(rings)
    high = frozenset[int]().union(*(neighbour.level for neighbour in around))
    surfaces = [_level(cells, name, label, road=road, high=high) for (name, label), cells in groups.items()]
    walls = [
        ((a, b), tile.layers[cell][0])
        for (a, b), cell in tile.edges.items()
        if not any((b, a) in neighbour.edges for neighbour in around)
    ]
    if walls:
        material, period = MATERIALS["kerb"]
        surfaces.append(_faces(walls, high, period).surface(material, Label.KERB))
    return tuple(surfaces)


def _level(
    cells: Sequence[Rings], name: str, label: Label, *, road: str = "road", high: frozenset[int] = frozenset()
) -> MeshSurface:
    """Cells of one layer. `high`: the vertices at which a bevel is as high as the kerb."""
    material, period = MATERIALS[road if name == "paint" else name]
    if name == "paint":
        material = replace(WHITE, beneath=material)
    used, triangles = np.unique(np.concatenate([_triangles(rings) for rings in cells]), return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    positions = np.column_stack([_unpacked(used), _heights(used, name, high)])
    normals = np.tile((0.0, 0.0, 1.0), (len(used), 1))
    if name == "bevel":
        normals = _smooth(positions, triangles)
    return Mesh(positions, normals, triangles, _uvs(positions, period)).surface(material, label)


def _heights(vertices: Integers, name: str, high: frozenset[int]) -> Floats:
    """Heights of vertices of that layer [m]; a bevel rises from the road to the kerb."""
    if name not in RAISED:
        return np.zeros(len(vertices))
    return np.array([KERB_HEIGHT if name in LEVEL or vertex in high else KERB_STEP for vertex in vertices.tolist()])


def _triangles(rings: Rings) -> Integers:
    """Triangulates a cell. Uses every vertex of its rings, also on straight sides, so that there are no cracks."""
    corners = np.asarray(manifold3d.triangulate([ring / SCALE for ring in rings])).reshape(-1, 3)
    return np.concatenate([_packed(ring) for ring in rings])[corners]


def _faces(walls: Sequence[tuple[tuple[int, int], str]], high: frozenset[int], period: float) -> Mesh:
    """Vertical faces from edges of raised layers, with the name of the layer, down to the ground."""
    ends = np.array([edge for edge, _ in walls]).T
    a, b = map(_unpacked, ends)
    top_a, top_b = (
        np.concatenate([_heights(vertex[None], name, high) for vertex, (_, name) in zip(end, walls, strict=True)])
        for end in ends
    )
    zero = np.zeros(len(a))
    corners = [(a, zero), (b, zero), (b, top_b), (a, top_a)]
    positions = np.stack([np.column_stack([points, z]) for points, z in corners], axis=1)
    along = b - a
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
