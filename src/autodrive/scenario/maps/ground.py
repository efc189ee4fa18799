"""The layers of the ground of a map: road, kerb, pavement, lawn; and the extent of its tiles and floor."""

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
    from numpy.typing import NDArray

    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.module import MarkingKind

SIMPLIFY_TOLERANCE = 5e-4
"""Largest distance of a drawn edge from the edge of the drivable area [m]: one pixel, seen from 0.3 m."""
BEVEL, KERB_WIDTH, PAVEMENT_WIDTH = 0.003, 0.024, 0.055
"""Widths outside the road [m]: slope of the kerb, kerb including its slope, pavement behind the kerb. Our values."""
TILE = 1.0
"""Edge length of the square tiles of the ground [m]; in a map with more than `MOST_TILES`, a multiple of it."""
MOST_TILES = 10_000
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
"""Label of each kind of marking, in order of painting: where two overlap, the later one is visible."""


@dataclass(frozen=True)
class Layer:
    """Ground of one kind."""

    name: str
    """'lawn', 'pavement', 'kerb', 'bevel', 'road', 'track', 'paint' or 'plain_paint'."""
    label: Label
    polygons: NDArray[np.object_]
    """Areas of the layer, which may overlap."""

    @property
    def is_paint(self) -> bool:
        """Whether it is only where the map is driven on."""
        return self.name in ("paint", "plain_paint")

    @property
    def is_driven(self) -> bool:
        """Whether it is the road or track, without paint."""
        return self.label is Label.ROAD


def layers(map_: Map, *, tolerance: float = SIMPLIFY_TOLERANCE) -> list[Layer]:
    """The layers of a map without paint, from the top down; the floor is below them.

    `tolerance`: largest distance of a simplified edge from the original [m].
    """
    # without the precision of the polygon, which a copy in another process does not have: the bits are the same there
    road = _simplified(shapely.set_precision(map_.drivable, 0.0), tolerance)
    areas: list[tuple[str, Label, BaseGeometry]] = [("road" if map_.track is None else "track", Label.ROAD, road)]
    if map_.track is not None and map_.track.barrier.kind == "duct":  # a duct leaves the floor below its sides visible
        areas += [("track", Label.GROUND, road.buffer(0.5 * map_.track.barrier.width, join_style="mitre"))]
    if not road.is_empty and map_.track is None:
        open_ends = _open_ends(map_)
        for name, width in (("bevel", BEVEL), ("kerb", KERB_WIDTH), ("pavement", KERB_WIDTH + PAVEMENT_WIDTH)):
            strip = _simplified(road.buffer(width, join_style="round"), 2.0 * tolerance)
            areas += [(name, Label.KERB, shapely.difference(strip, open_ends, grid_size=GRID))]
    # not `map_.lawn`: its edge along the road is not simplified
    lawns = [placed.footprint for placed in map_.modules if placed.module.spec.type == "terrain"]
    return [
        *(Layer(name, label, shapely.get_parts(area)) for name, label, area in areas),
        Layer("lawn", Label.LAWN, np.array(lawns, dtype=object)),
    ]


def floor_extent(map_: Map) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of the drawn ground [m]."""
    half = (map_.ground.length / 2.0, map_.ground.width / 2.0)
    x0, y0, x1, y1 = tile_extent(map_)
    m = FLOOR_MARGIN
    return min(x0 - m, -half[0]), min(y0 - m, -half[1]), max(x1 + m, half[0]), max(y1 + m, half[1])


def tile_extent(map_: Map) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max of the tiles [m]; the floor beyond them is one piece."""
    return _tile_extent(map_, tile_size(map_))


def tile_size(map_: Map) -> float:
    """Edge length of the tiles [m]."""
    size = TILE
    while True:
        x0, y0, x1, y1 = _tile_extent(map_, size)
        if (x1 - x0) * (y1 - y0) <= MOST_TILES * size * size:
            return size
        size *= 2.0


def _tile_extent(map_: Map, size: float) -> tuple[float, float, float, float]:
    margin = KERB_WIDTH + PAVEMENT_WIDTH
    low = np.floor((np.array(map_.bounds[:2]) - margin) / size) * size
    high = np.ceil((np.array(map_.bounds[2:]) + margin) / size) * size
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _simplified(area: BaseGeometry, tolerance: float) -> BaseGeometry:
    """Where a ring begins decides which points stay: at the least one, whatever other areas there are."""
    return shapely.simplify(shapely.normalize(area), tolerance)


def _open_ends(map_: Map) -> BaseGeometry:
    """Areas at the open ends of roads, which have no kerb."""
    width = KERB_WIDTH + PAVEMENT_WIDTH
    open_ends = []
    for i, module in enumerate(map_.modules):
        for port in module.ports:
            if not port.is_blind and (i, port.name) not in map_.joins:
                x, y, yaw = port.pose
                centre = (x + width * np.cos(yaw), y + width * np.sin(yaw), yaw)
                open_ends.append(rectangle(centre, 2.0 * width, port.width + 4.0 * width))
    return shapely.union_all(open_ends, grid_size=GRID)
