"""Modules: the pieces of which a map is made, each described by a YAML file of `data/modules`."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

import shapely
from pydantic import Field, model_validator
from shapely.geometry.base import BaseGeometry

from autodrive import descriptions
from autodrive.descriptions import Spec
from autodrive.maps.lanes import lane_path
from autodrive.maps.shapes import NotNegative, Pose, Positive, Rectangle, Shape, rectangle
from autodrive.state import Floats
from autodrive.units import DEGREE

DRIVING_SIDE = -1
"""Traffic keeps right (-1); +1 would be left. The signs of Tiny Town stand for traffic that keeps right ("side road
left" is passed by the lane on its right only), and so does its spawn at y = -0.15 m, heading +x."""

ModuleType: TypeAlias = Literal["road", "intersection", "parking", "terrain", "obstruction"]
MarkingKind: TypeAlias = Literal["edge", "separation", "crossing", "stop_line", "bay"]


class Port(Spec):
    """Where the road of a module meets the next: a pose facing outward, in the axes of the module.

    A blind port is where a road ends inside a module: lanes begin and end there, no neighbour is expected.
    """

    x: float
    y: float
    yaw_deg: float
    width: Positive
    is_blind: bool = False

    @property
    def pose(self) -> Pose:
        """Facing outward."""
        return self.x, self.y, self.yaw_deg * DEGREE

    @property
    def pose_in(self) -> Pose:
        """Where the lane that comes in begins, heading inward."""
        x, y, yaw = self._beside(-DRIVING_SIDE)
        return x, y, yaw + math.pi

    @property
    def pose_out(self) -> Pose:
        """Where the lane that goes out ends, heading outward."""
        return self._beside(DRIVING_SIDE)

    def _beside(self, side: int) -> Pose:
        x, y, yaw = self.pose
        shift = side * self.width / 4.0
        return x - shift * math.sin(yaw), y + shift * math.cos(yaw), yaw


class StopLine(Spec):
    """A stop line across the lane that comes in at a port, `distance` behind the port (to the line's middle)."""

    port: str
    distance: NotNegative
    width: Positive


class Bay(Rectangle):
    """Where one vehicle may park: a rectangle with the heading of a parked vehicle."""

    name: str


class ModuleSpec(Spec):
    """A module. Its origin is the centre of its rectangular footprint; x along `length`, y along `width`."""

    title: str
    """Name for people, as in table 11 of the report."""
    type: ModuleType
    note: str = ""
    length: Positive
    """Extent of the footprint along x [m]."""
    width: Positive
    """Extent of the footprint along y [m]."""
    height: NotNegative = 0.0
    """Of an obstruction [m]."""
    mass: Positive | None = None
    """Of an obstruction [kg]."""
    ports: dict[str, Port] = Field(default_factory=dict)
    lanes: tuple[tuple[str, str], ...] = ()
    """Pairs of ports: where a lane comes in and where it goes out."""
    drivable: tuple[Shape, ...] = ()
    """Shapes whose union may be driven on."""
    markings: dict[MarkingKind, tuple[Shape, ...]] = Field(default_factory=dict)
    """Painted white."""
    stop_lines: tuple[StopLine, ...] = ()
    bays: tuple[Bay, ...] = ()

    @model_validator(mode="after")
    def _is_sound(self) -> ModuleSpec:
        faults = [*self._unknown_ports(), *self._ports_off_the_footprint(), *self._lanes_without_path()]
        is_solid = [self.mass is not None, self.height > 0.0]
        if not all(is_solid) if self.type == "obstruction" else any(is_solid):
            faults.append("an obstruction has height and mass, and nothing else has")
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def _unknown_ports(self) -> Iterator[str]:
        named = [*(name for lane in self.lanes for name in lane), *(line.port for line in self.stop_lines)]
        for name in dict.fromkeys(named):
            if name not in self.ports:
                yield f"port '{name}' is not known. {descriptions.suggest(name, sorted(self.ports))}"

    def _ports_off_the_footprint(self) -> Iterator[str]:
        for name, port in self.ports.items():
            cos, sin = math.cos(port.yaw_deg * DEGREE), math.sin(port.yaw_deg * DEGREE)
            outward = port.x * cos + port.y * sin
            edge = abs(cos) * self.length / 2.0 + abs(sin) * self.width / 2.0
            if not port.is_blind and (abs(outward - edge) > 1e-6 or min(abs(cos), abs(sin)) > 1e-6):
                yield f"port '{name}' must stand on an edge of the footprint and face straight outward"

    def _lanes_without_path(self) -> Iterator[str]:
        for start, end in self.lanes:
            if start in self.ports and end in self.ports:
                try:
                    lane_path(self.ports[start].pose_in, self.ports[end].pose_out)
                except ValueError as error:
                    yield f"lane from '{start}' to '{end}': {error}"


@dataclass(frozen=True)
class Module:
    """A module, compiled: polygons and lane centre lines in its own axes [m]."""

    name: str
    spec: ModuleSpec
    footprint: shapely.Polygon
    drivable: BaseGeometry
    markings: tuple[tuple[MarkingKind, BaseGeometry], ...]
    lanes: tuple[Floats, ...]
    """Points of each lane of the spec, shape (n, 2)."""


def load_module(name: str | Path) -> Module:
    """The module of that name, or of that YAML file. Raises `SpecError`."""
    path = descriptions.find("module", name)
    return _load(path, path.stat().st_mtime_ns)


def compile_module(spec: ModuleSpec, name: str = "module") -> Module:
    """The polygons and lanes that a description stands for."""
    shapes: list[tuple[MarkingKind, BaseGeometry]] = [
        (kind, shape.geometry()) for kind, shapes in spec.markings.items() for shape in shapes
    ]
    stops: list[tuple[MarkingKind, BaseGeometry]] = [("stop_line", _stop_line(spec, line)) for line in spec.stop_lines]
    return Module(
        name,
        spec,
        footprint=rectangle((0.0, 0.0, 0.0), spec.length, spec.width),
        drivable=shapely.union_all([shape.geometry() for shape in spec.drivable]),
        markings=(*shapes, *stops),
        lanes=tuple(lane_path(spec.ports[a].pose_in, spec.ports[b].pose_out) for a, b in spec.lanes),
    )


@functools.lru_cache(maxsize=256)
def _load(path: Path, _modified: int) -> Module:
    return compile_module(descriptions.read("module", path, ModuleSpec), path.stem)


def _stop_line(spec: ModuleSpec, line: StopLine) -> BaseGeometry:
    port = spec.ports[line.port]
    x, y, yaw = port.pose_in
    centre = (x + line.distance * math.cos(yaw), y + line.distance * math.sin(yaw), yaw)
    # a little shorter than the lane, so that it meets neither the edge line nor the opposite lane
    return rectangle(centre, line.width, 0.85 * port.width / 2.0)
