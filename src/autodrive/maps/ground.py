"""The ground of a map, cut into regions of which each point has exactly one: floor, lawn, road, kerb, paint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.maps.map import GRID
from autodrive.maps.shapes import rectangle
from autodrive.render.asset import Label

if TYPE_CHECKING:
    from autodrive.maps.map import Map
    from autodrive.maps.module import MarkingKind

SIMPLER = 5e-4
"""How far a drawn edge may be from that of the drivable area [m]: a pixel from 0.3 m away."""
BEVEL, KERB_WIDTH, PAVEMENT_WIDTH = 0.003, 0.024, 0.055
"""Outside of the road, from its edge: slope of the kerb, kerb with it, pavement behind it [m]; ours."""
TILE = 1.0
"""Ground is drawn in squares of that size [m]."""
FLOOR_MARGIN = 250.0
"""The floor goes on so far beyond all that was placed [m]: it ends a pixel below the sky
(from a car's camera)."""

MARKING_LABELS: dict[MarkingKind, Label] = {
    "separation": Label.SEPARATION_LINE,
    "edge": Label.EDGE_LINE,
    "bay": Label.BAY_LINE,
    "crossing": Label.CROSSING,
    "stop_line": Label.STOP_LINE,
}
"""Painted in this order: where two meet, the later one is seen."""


@dataclass(frozen=True)
class Region:
    """Ground of one kind. Regions of a map do not overlap, and leave nothing out between them."""

    name: str
    """'floor', 'lawn', 'pavement', 'kerb', 'bevel', 'road' or 'paint'."""
    label: Label
    geometry: BaseGeometry


def regions(map_: Map, *, simpler: float = SIMPLER) -> list[Region]:
    """All of them; the floor reaches as far as `floor_extent`."""
    road = shapely.simplify(map_.drivable, simpler)
    mouths = _mouths(map_)
    found: list[Region] = []
    taken: BaseGeometry = shapely.Polygon()

    def add(name: str, label: Label, geometry: BaseGeometry) -> None:
        nonlocal taken
        if not geometry.is_empty:
            found.append(Region(name, label, shapely.difference(geometry, taken, grid_size=GRID)))
            taken = shapely.union(taken, geometry, grid_size=GRID)

    for kind, label in reversed(MARKING_LABELS.items()):
        lines = shapely.union_all([m.geometry for m in map_.markings if m.kind == kind], grid_size=GRID)
        add("paint", label, shapely.intersection(shapely.simplify(lines, simpler), road, grid_size=GRID))
    add("road", Label.ROAD, road)
    strips = (("bevel", BEVEL), ("kerb", KERB_WIDTH), ("pavement", KERB_WIDTH + PAVEMENT_WIDTH))
    for name, width in strips if not road.is_empty else ():
        strip = shapely.simplify(road.buffer(width, join_style="round"), 2.0 * simpler)
        add(name, Label.KERB, shapely.difference(strip, mouths, grid_size=GRID))
    for surface in map_.surfaces:
        if surface.kind == "lawn":
            add("lawn", Label.LAWN, surface.geometry)
    add("floor", Label.GROUND, shapely.box(*floor_extent(map_)))
    return found


def floor_extent(map_: Map) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of all ground that is drawn [m]."""
    half = (map_.ground.length / 2.0, map_.ground.width / 2.0)
    x0, y0, x1, y1 = tile_extent(map_)
    m = FLOOR_MARGIN
    return min(x0 - m, -half[0]), min(y0 - m, -half[1]), max(x1 + m, half[0]), max(y1 + m, half[1])


def tile_extent(map_: Map) -> tuple[float, float, float, float]:
    """The whole tiles that hold all that was placed, x_min, y_min, x_max, y_max [m]; floor beyond is one piece."""
    margin = KERB_WIDTH + PAVEMENT_WIDTH
    low = np.floor((np.array(map_.bounds[:2]) - margin) / TILE) * TILE
    high = np.ceil((np.array(map_.bounds[2:]) + margin) / TILE) * TILE
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _mouths(map_: Map) -> BaseGeometry:
    """Where roads are left open: no kerb across them."""
    width = KERB_WIDTH + PAVEMENT_WIDTH
    mouths = []
    for i, one in enumerate(map_.modules):
        for port in one.ports:
            if not port.is_blind and (i, port.name) not in map_.joins:
                x, y, yaw = port.pose
                centre = (x + width * np.cos(yaw), y + width * np.sin(yaw), yaw)
                mouths.append(rectangle(centre, 2.0 * width, port.width + 4.0 * width))
    return shapely.union_all(mouths, grid_size=GRID)
