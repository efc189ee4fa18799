"""Divides the ground of a map into regions that do not overlap: floor, lawn, pavement, kerb, road, paint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.protocol.labels import Label
from autodrive.scenario.maps.map import GRID
from autodrive.scenario.maps.shapes import rectangle

if TYPE_CHECKING:
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.module import MarkingKind

SIMPLIFY_TOLERANCE = 5e-4
"""Largest distance of a drawn edge from the edge of the drivable area [m]: one pixel, seen from 0.3 m."""
BEVEL, KERB_WIDTH, PAVEMENT_WIDTH = 0.003, 0.024, 0.055
"""Widths outside the road [m]: slope of the kerb, kerb including its slope, pavement behind the kerb. Our values."""
TILE = 1.0
"""Edge length of the square tiles of the ground [m]."""
FLOOR_MARGIN = 250.0
"""Extent of the floor beyond everything that was placed [m]. Seen from a vehicle camera, it ends one pixel below the
horizon."""

MARKING_LABELS: dict[MarkingKind, Label] = {
    "separation": Label.SEPARATION_LINE,
    "edge": Label.EDGE_LINE,
    "bay": Label.BAY_LINE,
    "crossing": Label.CROSSING,
    "stop_line": Label.STOP_LINE,
}
"""In order of painting: where two overlap, the later one is visible."""


@dataclass(frozen=True)
class Region:
    """Ground of one kind. The regions of a map neither overlap nor leave gaps."""

    name: str
    """'floor', 'lawn', 'pavement', 'kerb', 'bevel', 'road', 'track' or 'paint'."""
    label: Label
    geometry: BaseGeometry


def regions(map_: Map, *, tolerance: float = SIMPLIFY_TOLERANCE) -> list[Region]:
    """All regions of a map. `tolerance`: largest distance of a simplified edge from the original [m]."""
    # without the precision of the polygon, which a copy in another process does not have: the bits are the same in both
    road = shapely.simplify(shapely.set_precision(map_.drivable, 0.0), tolerance)
    open_ends = _open_ends(map_)
    found: list[Region] = []
    taken: BaseGeometry = shapely.Polygon()

    def add(name: str, label: Label, geometry: BaseGeometry) -> None:
        nonlocal taken
        if geometry.geom_type not in ("Polygon", "MultiPolygon"):  # paint beside a road touches it in a line
            geometry = shapely.union_all([part for part in shapely.get_parts(geometry) if part.area > 0.0])
        if not geometry.is_empty:
            found.append(Region(name, label, shapely.difference(geometry, taken, grid_size=GRID)))
            taken = shapely.union(taken, geometry, grid_size=GRID)

    for kind, label in reversed(MARKING_LABELS.items()):
        lines = shapely.union_all([m.geometry for m in map_.markings if m.kind == kind], grid_size=GRID)
        add("paint", label, shapely.intersection(shapely.simplify(lines, tolerance), road, grid_size=GRID))
    add("road" if map_.track is None else "track", Label.ROAD, road)
    if map_.track is not None and map_.track.barrier.kind == "duct":  # a duct leaves the floor below its sides visible
        add("track", Label.GROUND, road.buffer(0.5 * map_.track.barrier.width, join_style="mitre"))
    strips = (("bevel", BEVEL), ("kerb", KERB_WIDTH), ("pavement", KERB_WIDTH + PAVEMENT_WIDTH))
    for name, width in strips if not road.is_empty and map_.track is None else ():
        strip = shapely.simplify(road.buffer(width, join_style="round"), 2.0 * tolerance)
        add(name, Label.KERB, shapely.difference(strip, open_ends, grid_size=GRID))
    add("lawn", Label.LAWN, map_.lawn)
    add("floor", Label.GROUND, shapely.box(*floor_extent(map_)))
    return found


def floor_extent(map_: Map) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of the drawn ground [m]."""
    half = (map_.ground.length / 2.0, map_.ground.width / 2.0)
    x0, y0, x1, y1 = tile_extent(map_)
    m = FLOOR_MARGIN
    return min(x0 - m, -half[0]), min(y0 - m, -half[1]), max(x1 + m, half[0]), max(y1 + m, half[1])


def tile_extent(map_: Map) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of the tiles [m]; the floor beyond them is one piece."""
    margin = KERB_WIDTH + PAVEMENT_WIDTH
    low = np.floor((np.array(map_.bounds[:2]) - margin) / TILE) * TILE
    high = np.ceil((np.array(map_.bounds[2:]) + margin) / TILE) * TILE
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _open_ends(map_: Map) -> BaseGeometry:
    """Areas at the open ends of roads, which have no kerb."""
    width = KERB_WIDTH + PAVEMENT_WIDTH
    open_ends = []
    for i, one in enumerate(map_.modules):
        for port in one.ports:
            if not port.is_blind and (i, port.name) not in map_.joins:
                x, y, yaw = port.pose
                centre = (x + width * np.cos(yaw), y + width * np.sin(yaw), yaw)
                open_ends.append(rectangle(centre, 2.0 * width, port.width + 4.0 * width))
    return shapely.union_all(open_ends, grid_size=GRID)
