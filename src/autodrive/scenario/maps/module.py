"""Modules: the parts of a map, each described by a YAML file in `data/modules`."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

import shapely
from pydantic import Field, model_validator
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.specs import Coordinate, Degrees, Described, Mass, Name, Rule, RuleError, Spec
from autodrive.base.suggest import suggest
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.lanes import lane_path
from autodrive.scenario.maps.shapes import Extent, Pose, Rectangle, Shapes, rectangle

DRIVING_SIDE = -1
"""Traffic keeps right (-1); +1 is left. The signs of Tiny Town are placed for traffic that keeps right (only the right
lane passes "side road left"), and so is its initial pose at y = -0.15 m, heading +x."""

ModuleType: TypeAlias = Literal["road", "intersection", "parking", "terrain", "obstruction"]
MarkingKind: TypeAlias = Literal["edge", "separation", "crossing", "stop_line", "bay"]


class Port(Spec):
    """Where the road of a module connects to the next one: a pose facing outward, in the module frame.

    A blind port is the end of a road inside a module: lanes begin and end there without a neighbour.
    """

    x: Coordinate
    y: Coordinate
    yaw_deg: Degrees
    width: Extent
    lanes: int = Field(default=1, ge=1, le=4)
    """Lanes in each direction."""
    is_blind: bool = False

    @property
    def pose(self) -> Pose:
        """Pose of the port, facing outward."""
        return self.x, self.y, self.yaw_deg * DEGREE

    def pose_in(self, lane: int = 1) -> Pose:
        """Start of a lane that enters the module, heading inward; lane 1 is next to the middle of the road."""
        x, y, yaw = self._beside(-DRIVING_SIDE * self._middle_of(lane))
        return x, y, yaw + math.pi

    def pose_out(self, lane: int = 1) -> Pose:
        """End of a lane that leaves the module, heading outward."""
        return self._beside(DRIVING_SIDE * self._middle_of(lane))

    def line_in(self) -> Pose:
        """The middle of all lanes that enter the module, heading inward."""
        x, y, yaw = self._beside(-DRIVING_SIDE * self.width / 4.0)
        return x, y, yaw + math.pi

    def _middle_of(self, lane: int) -> float:
        return self.width * (2 * lane - 1) / (4.0 * self.lanes)

    def _beside(self, shift: float) -> Pose:
        x, y, yaw = self.pose
        return x - shift * math.sin(yaw), y + shift * math.cos(yaw), yaw


class StopLineSpec(Spec):
    """A stop line across the lanes that enter at a port; `distance` [m] is from the port to the centre of the line."""

    port: str
    distance: float = Field(ge=0.0, le=1e3)
    width: Extent


class Bay(Rectangle):
    """A parking space for one vehicle: a rectangle with the heading of a parked vehicle."""

    shape: Literal["rectangle"] = "rectangle"
    name: Name


class ModuleSpec(Spec):
    """A module. Its origin is the centre of its rectangular footprint; x along `length`, y along `width`."""

    title: str
    """Displayed name, as in table 11 of the report."""
    type: ModuleType
    note: str = ""
    length: Extent
    """Extent of the footprint along x [m]."""
    width: Extent
    """Extent of the footprint along y [m]."""
    height: float = Field(default=0.0, ge=0.0, le=100.0)
    """Height of an obstruction [m]."""
    mass: Mass | None = None
    """Mass of an obstruction [kg]."""
    ports: Annotated[dict[str, Port], Field(max_length=100)] = Field(default_factory=dict)
    lanes: Annotated[tuple[tuple[str, str], ...], Field(max_length=200)] = ()
    """Entry and exit of each lane: a port, or 'port/2' for its second lane, counted from the middle of the road."""
    drivable: Shapes = ()
    """Shapes whose union is drivable."""
    markings: dict[MarkingKind, Shapes] = Field(default_factory=dict)
    """Painted white."""
    stop_lines: Annotated[tuple[StopLineSpec, ...], Field(max_length=100)] = ()
    bays: Annotated[tuple[Bay, ...], Field(max_length=1000)] = ()

    @model_validator(mode="after")
    def _is_valid(self) -> ModuleSpec:
        errors: list[Rule] = [*self._unknown_ports(), *self._ports_off_the_footprint(), *self._lanes_without_path()]
        is_solid = [self.mass is not None, self.height >= 1e-3]
        if not all(is_solid) if self.type == "obstruction" else any(is_solid):
            errors.append((("type",), "an obstruction needs height and mass; other types must not have them"))
        if errors:
            raise RuleError(errors)
        return self

    def _unknown_ports(self) -> Iterator[Rule]:
        named: list[Rule] = [(("lanes", i), end) for i, lane in enumerate(self.lanes) for end in lane]
        named += [(("stop_lines", i), line.port) for i, line in enumerate(self.stop_lines)]
        for place, end in named:
            name, _, number = end.partition("/")
            if name not in self.ports:
                yield place, f"port '{name}' is not known. {suggest(name, sorted(self.ports))}"
            elif number and number not in map(str, range(1, self.ports[name].lanes + 1)):
                yield place, f"port '{name}' has no lane '{number}'; it has {self.ports[name].lanes}"

    def _ports_off_the_footprint(self) -> Iterator[Rule]:
        for name, port in self.ports.items():
            cos, sin = math.cos(port.yaw_deg * DEGREE), math.sin(port.yaw_deg * DEGREE)
            outward = port.x * cos + port.y * sin
            edge = abs(cos) * self.length / 2.0 + abs(sin) * self.width / 2.0
            if not port.is_blind and (abs(outward - edge) > 1e-6 or min(abs(cos), abs(sin)) > 1e-6):
                yield ("ports", name), f"port '{name}' must be on an edge of the footprint and face straight outward"

    def _lanes_without_path(self) -> Iterator[Rule]:
        known = {f"{name}{lane}" for name, port in self.ports.items() for lane in ("", *lane_names(port))}
        for i, (start, end) in enumerate(self.lanes):
            if {start, end} <= known:
                try:
                    self.path(start, end)
                except ValueError as error:
                    yield ("lanes", i), f"lane from '{start}' to '{end}': {error}"

    def path(self, start: str, end: str) -> Floats:
        """The centre line of a lane [m], shape (n, 2), in the module frame. Raises `ValueError`, see `lane_path`."""
        (entry, in_), (exit_, out) = lane_end(start), lane_end(end)
        return lane_path(self.ports[entry].pose_in(in_), self.ports[exit_].pose_out(out))


def lane_end(text: str) -> tuple[str, int]:
    """Port and number of the lane of an end of a lane: 'west' or 'west/2'."""
    port, _, number = text.partition("/")
    return port, int(number or 1)


def lane_names(port: Port) -> list[str]:
    """What may follow the name of the port in an end of a lane."""
    return [f"/{lane}" for lane in range(1, port.lanes + 1)]


@dataclass(frozen=True)
class Module:
    """A compiled module: polygons and lane centre lines in the module frame [m]."""

    name: str
    spec: ModuleSpec
    footprint: shapely.Polygon
    drivable: BaseGeometry
    markings: tuple[tuple[MarkingKind, BaseGeometry], ...]
    lanes: tuple[Floats, ...]
    """Points of each lane of the spec, shape (n, 2)."""

    @property
    def corners(self) -> int:
        """Number of corners of all polygons and lanes."""
        polygons = (self.drivable, *(shape for _, shape in self.markings))
        return int(sum(map(shapely.get_num_coordinates, polygons)) + sum(map(len, self.lanes)))


@functools.lru_cache(maxsize=256)
def compile_module(described: Described[ModuleSpec]) -> Module:
    """Compile a module to polygons and lanes."""
    spec = described.spec
    shapes: list[tuple[MarkingKind, BaseGeometry]] = [
        (kind, shape.geometry()) for kind, shapes in spec.markings.items() for shape in shapes
    ]
    stops: list[tuple[MarkingKind, BaseGeometry]] = [("stop_line", _stop_line(spec, line)) for line in spec.stop_lines]
    return Module(
        described.name,
        spec,
        footprint=rectangle((0.0, 0.0, 0.0), spec.length, spec.width),
        drivable=shapely.union_all([shape.geometry() for shape in spec.drivable]),
        markings=(*shapes, *stops),
        lanes=tuple(spec.path(a, b) for a, b in spec.lanes),
    )


def _stop_line(spec: ModuleSpec, line: StopLineSpec) -> BaseGeometry:
    port = spec.ports[line.port]
    x, y, yaw = port.line_in()
    centre = (x + line.distance * math.cos(yaw), y + line.distance * math.sin(yaw), yaw)
    # shorter than the lane is wide, so that it touches neither the edge line nor the opposite lane
    return rectangle(centre, line.width, 0.85 * port.width / 2.0)
