"""The map of a World for map_server of ROS."""

from __future__ import annotations

from autodrive.base.errors import CommandError
from autodrive.base.png import encode_png
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.raster import occupancy, sheet
from autodrive.scenario.tracks.importer import solid_and_free
from autodrive.scenario.tracks.ros_map import drawn

MAX_PIXELS = 2**23
"""Half as many as an import accepts: the drawing takes 50 bytes for each."""


def exported_map(map_: Map, name: str, resolution: float) -> tuple[str, bytes]:
    """The YAML file of NAME.png, and that picture; `resolution`: edge of a pixel [m]. Raises `CommandError`."""
    x0, y0, x1, y1 = map_.bounds
    columns, rows = (round((extent + 1.0) / resolution) for extent in (x1 - x0, y1 - y0))
    if columns * rows > MAX_PIXELS:
        raise CommandError(f"the picture would have {columns} x {rows} pixels; choose a greater edge of a pixel")
    if map_.track:
        return drawn(name, *solid_and_free(map_.track, resolution), resolution=resolution)
    return sheet(map_, name, resolution), encode_png(occupancy(map_, resolution))
