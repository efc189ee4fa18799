"""Raster images of a map: occupancy grid for ROS map_server, and semantic labels seen from above."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
import shapely

from autodrive.base.cache import make_folder, write_file
from autodrive.base.png import encode_png
from autodrive.physics.model import CYLINDER
from autodrive.protocol.labels import Label
from autodrive.scenario.maps.ground import MARKING_LABELS, layers
from autodrive.scenario.maps.map import GRID

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    from autodrive.base.arrays import Floats
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.solids import StaticShape

Free: TypeAlias = Literal["ground", "drivable"]
"""Free cells: all ground without solid objects (as a LIDAR sees it), or only the drivable part of it."""

FREE, OCCUPIED = 254, 0
"""Grey values, as map_saver of ROS writes them."""
SOLID_LABELS = {
    "wall": Label.WALL,
    "duct": Label.WALL,
    "block": Label.BLOCK,
    "post": Label.POST,
    "plate": Label.SIGN,
    "housing": Label.TRAFFIC_LIGHT,
}
"""Label of each material of a `StaticShape`."""
LABEL_COLOURS: dict[Label, str] = {
    Label.NOTHING: "000000",
    Label.GROUND: "d9d4c7",
    Label.LAWN: "7fae5f",
    Label.ROAD: "50545b",
    Label.KERB: "a39d92",
    Label.EDGE_LINE: "ffffff",
    Label.SEPARATION_LINE: "ffd23f",
    Label.STOP_LINE: "ff4d4d",
    Label.CROSSING: "4cc3ff",
    Label.BAY_LINE: "b78cff",
    Label.WALL: "7a5c45",
    Label.BLOCK: "c08a5a",
    Label.BOX: "f2902b",
    Label.SIGN: "e0218a",
    Label.TRAFFIC_LIGHT: "00a878",
    Label.POST: "1d3557",
    Label.VEHICLE: "1746ff",
}
"""sRGB colour of each label, for people; our values."""


def occupancy(map_: Map, resolution: float = 0.01, *, free: Free = "ground") -> NDArray[np.uint8]:
    """Grey values of a grid over the bounds of the map, first row at the greatest y; the centre of a cell decides.

    Walls, blocks, posts, plates and boxes are occupied. `resolution`: edge of a cell [m].
    """
    x, y = _middles(map_, resolution)
    solid = shapely.union_all([*(outline(shape) for shape in map_.statics), *(box.plan for box in map_.boxes)])
    shapely.prepare(solid)
    is_free = ~shapely.intersects_xy(solid, x, y)
    if free == "drivable":
        shapely.prepare(map_.drivable)
        is_free &= shapely.intersects_xy(map_.drivable, x, y)
    return np.where(is_free, FREE, OCCUPIED).astype(np.uint8)


def write_occupancy(map_: Map, folder: Path, resolution: float = 0.01, *, free: Free = "ground") -> Path:
    """Write NAME.png and NAME.yaml for map_server of ROS; returns the path of the YAML file."""
    make_folder(folder)
    write_file(folder / f"{map_.name}.png", encode_png(occupancy(map_, resolution, free=free)))
    path = folder / f"{map_.name}.yaml"
    write_file(path, sheet(map_, map_.name, resolution))
    return path


def sheet(map_: Map, name: str, resolution: float) -> str:
    """The YAML file of the picture NAME.png."""
    x, y = map_.bounds[:2]
    return (
        f"image: {name}.png\nmode: trinary\nresolution: {resolution:g}\norigin: [{x:.9g}, {y:.9g}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def labels(map_: Map, resolution: float = 0.01) -> NDArray[np.uint8]:
    """`Label` of each cell seen from above; rows and cells as in `occupancy`."""
    x, y = _middles(map_, resolution)
    seen = np.full(x.shape, Label.GROUND, np.uint8)
    of_ground = [(layer.label, layer.polygons) for layer in reversed(layers(map_, tolerance=0.0))]
    solids = [(SOLID_LABELS[shape.material], [outline(shape)]) for shape in map_.statics]
    solids += [(Label.BOX, [box.plan]) for box in map_.boxes]
    paint = [
        (label, [marking.geometry for marking in map_.markings if marking.kind == kind])
        for kind, label in MARKING_LABELS.items()
    ]
    on_road = _within(map_.drivable, x, y)
    for label, polygons in of_ground:
        if label != Label.GROUND:
            seen[_within(shapely.union_all(polygons), x, y)] = label
    for label, lines in paint:
        seen[_within(shapely.union_all(lines, grid_size=GRID), x, y) & on_road] = label
    for label, plans in solids:
        seen[_within(shapely.union_all(plans), x, y)] = label
    return seen


def _within(area: BaseGeometry, x: Floats, y: Floats) -> NDArray[np.bool_]:
    shapely.prepare(area)
    return shapely.intersects_xy(area, x, y)


def write_labels(map_: Map, path: Path, resolution: float = 0.01) -> None:
    """Write the labels as a PNG with a palette: the index of a pixel is its label."""
    palette = np.array([list(bytes.fromhex(LABEL_COLOURS[label])) for label in Label], np.uint8)
    write_file(path, encode_png(labels(map_, resolution), palette))


def outline(shape: StaticShape) -> shapely.Polygon:
    """The ground that a shape covers; a disc for a cylinder."""
    return shapely.Point(shape.position[:2]).buffer(shape.size[0]) if shape.kind == CYLINDER else shape.plan


def _middles(map_: Map, resolution: float) -> tuple[Floats, Floats]:
    """X and y of the centres of the cells [m], each with shape (rows, columns)."""
    x0, y0, x1, y1 = map_.bounds
    columns, rows = (max(1, int(np.ceil(extent / resolution - 1e-6))) for extent in (x1 - x0, y1 - y0))
    across, up = (np.arange(columns) + 0.5) * resolution, (np.arange(rows)[::-1] + 0.5) * resolution
    x, y = np.meshgrid(x0 + across, y0 + up)
    return x.astype(np.float64), y.astype(np.float64)
