"""Files of ROS map_server: a YAML file and an image of occupied, free and unknown pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Annotated, Any, Literal

import numpy as np
import shapely
from pydantic import BeforeValidator, ConfigDict, Field
from shapely.geometry.base import BaseGeometry

from autodrive.base import yaml_files
from autodrive.base.arrays import Floats
from autodrive.base.cache import make_folder, write_file
from autodrive.base.elementary import cos, sin
from autodrive.base.errors import SpecError
from autodrive.base.png import encode_png
from autodrive.base.specs import Coordinate, Spec
from autodrive.scenario.tracks.image import grey_of, read_grey

FREE, OCCUPIED, UNKNOWN = 254, 0, 205
"""Grey values, as map_saver of ROS writes them."""


def _lower(mode: Any) -> Any:
    return mode.lower() if isinstance(mode, str) else mode


Probability = Annotated[float, Field(ge=0.0, le=1.0)]


class RosMapSpec(Spec):
    """The YAML file. Keys that map_server does not use are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    image: str
    """Path of the image, from the folder of the YAML file."""
    resolution: float = Field(ge=1e-4, le=1.0)
    """Edge of a pixel [m]."""
    origin: Annotated[tuple[Coordinate, ...], Field(min_length=2, max_length=3)]
    """x [m], y [m], yaw [rad] of the lower left corner of the image."""
    negate: bool | Literal[0, 1] = False
    """True: white is occupied."""
    occupied_thresh: Probability = 0.65
    """A pixel is occupied if its probability is greater, even if it is below `free_thresh`."""
    free_thresh: Probability = 0.196
    """A pixel that is neither occupied nor, with a smaller probability, free is unknown."""
    mode: Annotated[Literal["trinary", "scale", "raw"], BeforeValidator(_lower)] = "trinary"


@dataclass(frozen=True)
class RosMap:
    """A map of map_server."""

    spec: RosMapSpec
    occupancy: Floats
    """Probability that a pixel is occupied, shape (rows, columns), first row at the top."""
    warning: str = ""
    """What is probably a mistake in the file; empty if nothing is."""

    def metres(self, pixels: Floats) -> Floats:
        """Positions in the map frame [m] of positions in the image from its lower left corner [pixel], shape (n, 2)."""
        x, y = pixels[:, 0] * self.spec.resolution, pixels[:, 1] * self.spec.resolution
        yaw = self.yaw
        c, s = cos(yaw), sin(yaw)
        return np.column_stack([self.spec.origin[0] + c * x - s * y, self.spec.origin[1] + s * x + c * y])

    def pixels(self, x: float, y: float) -> tuple[float, float]:
        """The inverse of `metres`, for one point."""
        dx, dy = x - self.spec.origin[0], y - self.spec.origin[1]
        c, s = cos(self.yaw), sin(self.yaw)
        return (c * dx + s * dy) / self.spec.resolution, (c * dy - s * dx) / self.spec.resolution

    @property
    def yaw(self) -> float:
        """Heading of the x axis of the image in the map frame [rad]."""
        return self.spec.origin[2] if len(self.spec.origin) > 2 else 0.0


def read_ros_map(path: Path) -> RosMap:
    """The map of a YAML file. Raises `SpecError` with all errors."""
    spec = _spec(yaml_files.source(path))
    image, warning = path.parent / spec.image, ""
    if not image.is_file():
        warning = f"image: the file '{spec.image}' does not exist"
        # absolute paths are those of another computer; files of f1tenth_racetracks name images that were renamed since
        beside = path.parent / PureWindowsPath(spec.image).name, path.with_suffix(".png"), path.with_suffix(".pgm")
        others = [other for other in beside if other.is_file()]
        if not others:
            raise SpecError([f"{warning}, and no image of that name is in the folder of the map"], str(path))
        image = others[0]
        warning += f"; '{image.name}' is read instead"
    return _ros_map(spec, read_grey(image), warning)


LACKING_SHEET = """the picture does not state its scale: write these lines as {sheet} and import that file,
  image: {image}
  resolution: 0.05       # edge of a pixel [m]
  origin: [0, 0, 0]      # x [m], y [m], yaw [rad] of the lower left corner
  negate: 0              # 1: white is occupied
  occupied_thresh: 0.65  # darker pixels are walls
  free_thresh: 0.196     # brighter pixels are free
or give the edge of a pixel in metres, such as --resolution 0.05"""
"""Error of a picture without its YAML file."""


def read_picture(path: Path, resolution: float | None) -> RosMap:
    """The map of a picture without a YAML file, whose lower left corner is the origin; `resolution`: in `RosMapSpec`.

    Raises `SpecError`, also without a resolution.
    """
    sheet = path.with_suffix(".yaml")
    if resolution is None and sheet.is_file():
        raise SpecError([f"the picture does not state its scale: import '{sheet.name}' in the same folder"], str(path))
    if resolution is None:
        raise SpecError([LACKING_SHEET.format(image=path.name, sheet=sheet.name)], str(path))
    spec = RosMapSpec(image=path.name, resolution=resolution, origin=(0.0, 0.0))
    return _ros_map(spec, read_grey(path))


def ros_map_of(text: str, picture: bytes) -> RosMap:
    """The map of the text of a YAML file and the bytes of its image, see `grey_of`. Raises `SpecError`."""
    spec = _spec(yaml_files.Source(text, "the YAML file of the picture"))
    return _ros_map(spec, grey_of(picture, "the picture"))


def _spec(source: yaml_files.Source) -> RosMapSpec:
    spec = yaml_files.checked_source(source, RosMapSpec)
    if spec.mode == "raw":
        raise SpecError(["mode raw has no fixed meaning of grey values; save the map as trinary or scale"], source.path)
    return spec


def _ros_map(spec: RosMapSpec, grey: Floats, warning: str = "") -> RosMap:
    """The map of an image; changes the grey values."""
    if not spec.negate:
        np.subtract(255.0, grey, out=grey)
    grey /= 255.0
    return RosMap(spec, grey, warning)


def write_ros_map(
    folder: Path, name: str, solid: BaseGeometry, free: BaseGeometry, *, resolution: float, margin: float = 0.5
) -> Path:
    """Write NAME_map.png and NAME_map.yaml, as `drawn` returns them; the path of the YAML file."""
    text, picture = drawn(f"{name}_map", solid, free, resolution=resolution, margin=margin)
    make_folder(folder)
    write_file(folder / f"{name}_map.png", picture)
    path = folder / f"{name}_map.yaml"
    write_file(path, text)
    return path


def drawn(
    name: str, solid: BaseGeometry, free: BaseGeometry, *, resolution: float, margin: float = 0.5
) -> tuple[str, bytes]:
    """The YAML file of NAME.png, and that picture; pixels whose centre is neither in `solid` nor `free` are unknown."""
    x0, y0, x1, y1 = solid.bounds
    x0, y0 = (math.floor((low - margin) / resolution) * resolution for low in (x0, y0))
    columns, rows = math.ceil((x1 + margin - x0) / resolution), math.ceil((y1 + margin - y0) / resolution)
    x, y = np.meshgrid(x0 + (np.arange(columns) + 0.5) * resolution, y0 + (np.arange(rows)[::-1] + 0.5) * resolution)
    image = np.full(x.shape, UNKNOWN, np.uint8)
    for area, value in ((free, FREE), (solid, OCCUPIED)):
        shapely.prepare(area)
        image[shapely.intersects_xy(area, x, y)] = value
    text = (
        f"image: {name}.png\nresolution: {resolution:.9g}\norigin: [{x0:.9g}, {y0:.9g}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.45\nfree_thresh: 0.196\n"
    )
    return text, encode_png(image)
