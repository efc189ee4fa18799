"""Builds the assets of maps and construction boxes from the polygons that the simulation uses.

The ground is one layer without overlaps (paint fills holes of the road, roads fill holes of the lawn), so that nothing
flickers. Adjacent pieces share bit-identical vertices, so that there are no cracks between them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from autodrive.graphics.assets.asset import Asset, AssetNode
from autodrive.graphics.meshes.ground_tiles import RAISED, tile_surfaces
from autodrive.graphics.meshes.map_solids import box_asset, solid_nodes, solid_texture
from autodrive.graphics.meshes.strips import StripLine, painted_lines, shade_along, strips
from autodrive.scenario.maps.ground import (
    MARKING_LABELS,
    SIMPLIFY_TOLERANCE,
    Layer,
    floor_extent,
    layers,
    tile_extent,
    tile_size,
)
from autodrive.scenario.maps.map import GRID

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.graphics.assets.asset import MeshSurface
    from autodrive.scenario.maps.map import Map

__all__ = ["GroundPart", "box_asset", "map_asset", "map_parts"]

PART = 8
"""Tiles of a part of the ground along x and y."""
KERB_SHADE, KERB_SHADE_WIDTH = 0.4, 0.012
WALL_SHADE, WALL_SHADE_WIDTH = 0.55, 0.1
"""Share of the sky that a kerb, and a wall or a building, hides from the ground at its foot, and how far [m]."""
DUCT_SHADE = 0.45
"""Share of the sky that a duct hides from the ground at its foot, a quarter of its width far."""


def map_asset(map_: Map) -> Asset:
    """The static part of a map. Nodes: 'tile_<i>' and 'floor' for the ground, and one for each solid, with its name."""
    ground = _Ground.of(map_)
    tiles = [
        AssetNode(f"tile_{i}" if i >= 0 else "floor", surfaces={"full": surfaces, "reduced": surfaces})
        for i, surfaces in ground.tiles
    ]
    nodes = (*tiles, *solid_nodes(map_))
    return Asset(map_.name, nodes, _textures(nodes), strips([*ground.paint, *ground.shade]), tile_extent(map_))


class GroundPart(NamedTuple):
    """A part of the ground, about `PART` wide and long. Those that an edit of the map did not change are equal."""

    tiles: tuple[tuple[str, tuple[MeshSurface, ...]], ...]
    """Names and surfaces."""
    lines: tuple[StripLine, ...]

    @property
    def asset(self) -> Asset:
        """The asset for the page: without other levels of detail, and with the textures of the map."""
        nodes = tuple(AssetNode(name, surfaces={"full": surfaces}) for name, surfaces in self.tiles)
        return Asset("ground", nodes, strips=strips(self.lines), foreign_textures=_texture_names(nodes))


def map_parts(map_: Map) -> tuple[Asset, list[GroundPart]]:
    """The map of `map_asset` in several assets: the solids, with all textures, and parts of the ground."""
    ground, size = _Ground.of(map_), tile_size(map_)
    x0, y0, x1, _ = tile_extent(map_)
    columns = round((x1 - x0) / size)
    tiles: dict[tuple[int, int], list[tuple[str, tuple[MeshSurface, ...]]]] = {}
    lines: dict[tuple[int, int], list[StripLine]] = {}
    rest: list[tuple[str, tuple[MeshSurface, ...]]] = []
    for number, surfaces in ground.tiles:
        column, row = number % columns + round(x0 / size), number // columns + round(y0 / size)
        own = tiles.setdefault((column // PART, row // PART), []) if number >= 0 else rest
        own.append((f"tile_{column}_{row}" if number >= 0 else "floor", surfaces))
    for line in ground.paint:
        x, y = np.floor(line.left[0] / (PART * size)).astype(int).tolist()
        lines.setdefault((x, y), []).append(line)
    parts = [GroundPart(tuple(own), tuple(lines.pop(place, ()))) for place, own in tiles.items()]
    others = [line for own in lines.values() for line in own]
    nodes = (*solid_nodes(map_),)
    of_ground = (AssetNode("", surfaces={"full": surfaces}) for _, surfaces in ground.tiles)
    solids = Asset(map_.name, nodes, _textures((*nodes, *of_ground)), extent=tile_extent(map_))
    return solids, [*parts, GroundPart(tuple(rest), (*others, *ground.shade))]


class _Ground(NamedTuple):
    tiles: list[tuple[int, tuple[MeshSurface, ...]]]
    """Number and surfaces of each tile, from `tile_surfaces`."""
    paint: list[StripLine]
    shade: list[StripLine]

    @staticmethod
    def of(map_: Map) -> _Ground:
        paint, lines = _paint(map_)
        bare = layers(map_)
        tiles = tile_surfaces([*paint, *bare], tile_extent(map_), floor_extent(map_), size=tile_size(map_))
        return _Ground([*tiles], lines, [*_shade(map_, bare)])


def _textures(nodes: Iterable[AssetNode]) -> dict[str, NDArray[np.uint8]]:
    return {name: solid_texture(name) for name in sorted({*_texture_names(nodes), "clouds"})}


def _texture_names(nodes: Iterable[AssetNode]) -> tuple[str, ...]:
    materials = (s.material for node in nodes for level in node.surfaces.values() for s in level)
    return tuple(sorted({(material.beneath or material).texture for material in materials} - {""}))


def _paint(map_: Map) -> tuple[list[Layer], list[StripLine]]:
    """The layers of paint, from the top down, and the strips of those polygons of paint that are lines."""
    kinds = [marking.kind for marking in map_.markings for _ in range(shapely.get_num_geometries(marking.geometry))]
    polygons = shapely.get_parts(np.array([marking.geometry for marking in map_.markings], dtype=object))
    lines = painted_lines(polygons, map_.drivable)
    kind, is_line = np.array(kinds, dtype=str), np.array([line is not None for line in lines], bool)
    simple = shapely.simplify(polygons, SIMPLIFY_TOLERANCE)
    paint = [
        Layer(name, label, simple[(kind == marking) & (is_line == (name == "paint"))])
        for marking, label in reversed(MARKING_LABELS.items())
        for name in ("plain_paint", "paint")
    ]
    return paint, [line for line in lines if line is not None]


def _shade(map_: Map, bare: list[Layer]) -> Iterator[StripLine]:
    """Shade at the feet of kerbs, walls, buildings and barriers."""
    if map_.track is not None:
        barrier = map_.track.barrier
        for face in map_.track.walls:
            line = np.vstack([face, face[:1]])[::-1]
            if barrier.kind == "duct":
                yield shade_along(line, 0.25 * barrier.width, DUCT_SHADE)
            else:
                yield shade_along(line, WALL_SHADE_WIDTH, WALL_SHADE)
        return
    raised = shapely.union_all(
        np.concatenate([layer.polygons for layer in bare if layer.name in RAISED] or [()]), grid_size=GRID
    )
    road = shapely.multipolygons([polygon for layer in bare if layer.is_driven for polygon in layer.polygons])
    kerbs = shapely.difference(raised, road, grid_size=GRID)
    yield from _shade_around(kerbs, KERB_SHADE_WIDTH, KERB_SHADE)
    solids = shapely.union_all([shape.plan for shape in map_.statics if shape.material in ("wall", "block")])
    yield from _shade_around(solids, WALL_SHADE_WIDTH, WALL_SHADE)


def _shade_around(area: BaseGeometry, width: float, shade: float) -> Iterator[StripLine]:
    for polygon in shapely.get_parts(shapely.simplify(area, SIMPLIFY_TOLERANCE)):
        for ring in shapely.get_rings(orient(polygon)):  # the area is on the left
            yield shade_along(shapely.get_coordinates(ring), width, shade)
