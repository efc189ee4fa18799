"""Placement of modules in a map: connects ports, finds overlaps, reports errors."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import shapely
from pydantic import Field
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.specs import MAX_ERRORS, Coordinate, Degrees, Length, Mass, Name, Spec
from autodrive.base.units import DEGREE
from autodrive.base.yaml_files import Source
from autodrive.scenario.maps.module import Module, load_module
from autodrive.scenario.maps.shapes import Extent, Pose, moved, rectangle

PORT_TOLERANCE = 1e-3
"""Largest distance between connected ports, and largest difference of their widths [m]."""
HEADING_TOLERANCE = 0.1 * DEGREE
"""Largest deviation of connected ports from opposite headings [rad]: 0.5 mm at the edge of the road."""
REACH = 0.3
"""Ports nearer than this (half a road width) must be connected; otherwise it is an error [m]."""
MAX_CORNERS = 200_000
"""Of the polygons and lanes of all placed modules."""
MAX_PAIRS = 10_000
"""Pairs of touching solids that are checked for an overlap."""
SLIVER = 1e-5
"""Largest allowed overlap of footprints [m^2] (placements are rounded to 0.1 mm)."""

PortId: TypeAlias = tuple[int, str]
"""Index of the placed module, name of the port."""


class Placement(Spec):
    """Pose of a module: x, y [m] and yaw of the centre of its footprint."""

    module: str
    name: Name = ""
    x: Coordinate
    y: Coordinate
    yaw_deg: Degrees = 0.0
    open: bool | tuple[str, ...] = False
    """Ports that may stay unconnected: True for all, or their names."""
    length: Extent | None = None
    """Terrain and boxes only: replaces the length of the module [m]."""
    width: Extent | None = None
    height: Length | None = None
    """Boxes only [m]."""
    z: float = Field(default=0.0, ge=0.0, le=1e4)
    """Boxes only: height of the underside above ground [m]."""
    mass: Mass | None = None
    """Boxes only [kg]."""

    @property
    def pose(self) -> Pose:
        """Pose of the origin of the module."""
        return self.x, self.y, self.yaw_deg * DEGREE


@dataclass(frozen=True)
class PlacedPort:
    """A port of a placed module, in the map frame."""

    name: str
    pose: Pose
    """x [m], y [m], yaw [rad] outward."""
    width: float
    is_blind: bool
    is_open: bool
    """True if the port may stay unconnected."""


@dataclass(frozen=True)
class PlacedModule:
    """A placed module: its parts in the map frame [m]."""

    label: str
    """For error messages: "placement 4 'curved_road' (line 9)"."""
    name: str
    module: Module
    placement: Placement
    footprint: shapely.Polygon
    drivable: BaseGeometry
    markings: tuple[BaseGeometry, ...]
    """As in the module."""
    lanes: tuple[Floats, ...]
    """As in the module."""
    ports: tuple[PlacedPort, ...]

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width, height [m]."""
        spec, own = self.module.spec, self.placement
        return own.length or spec.length, own.width or spec.width, own.height or spec.height


def place(
    numbered: Iterable[tuple[int, Placement]], folder: Path | None, source: Source | None = None
) -> tuple[list[PlacedModule], list[str]]:
    """The placed modules, and an error for each unknown module, unknown port and field that its module does not allow.

    Relative paths of modules start at `folder`, the folder of the map. `source`: its text, for lines in errors.
    """
    placed: list[PlacedModule] = []
    errors: list[str] = []
    names: set[str] = set()
    corners = 0
    faulty: dict[str, SpecError] = {}
    for number, placement in numbered:
        line = source.line("placements", number - 1) if source else None
        label = f"placement {number} '{placement.name or placement.module}'{f' (line {line})' if line else ''}"
        try:
            if placement.module in faulty:
                raise faulty[placement.module]
            is_path = placement.module.endswith((".yaml", ".yml"))
            module = load_module(folder / placement.module if folder and is_path else placement.module)
        except SpecError as error:
            faulty[placement.module] = error
            errors.append(f"{label}: {error}")
            continue
        corners += module.corners
        if corners > MAX_CORNERS:
            errors.append(f"{label}: the modules up to here have {corners} corners; at most {MAX_CORNERS} are possible")
            break
        errors += [f"{label}: {error}" for error in _disallowed_fields(placement, module)]
        name = placement.name or f"{module.name}_{number}"
        if name in names:
            errors.append(f"{label}: the name '{name}' is already used; names must be unique")
        names.add(name)
        placed.append(_placed(label, name, module, placement))
    return placed, errors


def join(placed: Sequence[PlacedModule], *, is_complete: bool = True) -> tuple[dict[PortId, PortId], list[str]]:
    """The connected ports (in both directions), and an error for each port that is unconnected or does not match.

    If some placements could not be read (`is_complete` False), unconnected ports are not errors.
    """
    ports = [(i, port) for i, one in enumerate(placed) for port in one.ports if not port.is_blind]
    joins: dict[PortId, PortId] = {}
    errors: list[str] = []
    if not ports:
        return joins, errors
    at = np.array([port.pose[:2] for _, port in ports])
    owner = np.array([i for i, _ in ports])
    for k, (i, port) in enumerate(ports):
        distance = np.where(owner == i, np.inf, np.hypot(*(at - at[k]).T))
        nearest = int(np.argmin(distance))
        j, other = ports[nearest]
        if distance[nearest] > REACH:
            if is_complete and not port.is_open:
                errors.append(f"{placed[i].label}: port '{port.name}' is not connected. {_fix(port)}")
            continue
        problem = _mismatch(port, other)
        if not problem:
            joins[i, port.name] = (j, other.name)
        elif i < j or np.hypot(*(at - at[nearest]).T)[k] > REACH:
            errors.append(
                f"{placed[i].label}: port '{port.name}' and port '{other.name}' of {placed[j].label} {problem}"
            )
    return joins, errors


def overlaps(solids: Sequence[tuple[str, BaseGeometry, float, float]], movable: int) -> list[str]:
    """An error for each pair of solids that overlap; a solid is label, footprint, bottom and top [m].

    At least one of a pair is among the first `movable` solids: the others may overlap each other.
    """
    if not movable:
        return []
    plans = np.array([plan for _, plan, _, _ in solids], dtype=object)
    pairs = shapely.STRtree(plans).query(plans[:movable], predicate="intersects")
    first, second = pairs[:, pairs[0] < pairs[1]][:, :MAX_PAIRS]
    area = shapely.area(shapely.intersection(plans[first], plans[second]))
    span = np.array([(low, high) for _, _, low, high in solids])
    common = np.minimum(span[first, 1], span[second, 1]) - np.maximum(span[first, 0], span[second, 0])
    is_error = (area > SLIVER) & (common > PORT_TOLERANCE)
    errors = [
        f"{solids[i][0]} overlaps {solids[j][0]} by {a * 1e4:.4g} cm^2. Move one of them."
        for i, j, a in sorted(zip(first[is_error], second[is_error], area[is_error], strict=True))
    ]
    more = len(errors) - MAX_ERRORS
    return [*errors[:MAX_ERRORS], f"and {more} more overlaps"] if more > 0 else errors


def _placed(label: str, name: str, module: Module, placement: Placement) -> PlacedModule:
    pose, spec = placement.pose, module.spec
    opened = set(spec.ports) if placement.open is True else set(placement.open or ())
    shapes = shapely.transform(
        np.array([module.drivable, *(shape for _, shape in module.markings)], dtype=object), lambda p: moved(p, pose)
    )
    ports = []
    for port_name, port in spec.ports.items():
        x, y = moved(np.array([[port.x, port.y]]), pose)[0]
        yaw = pose[2] + port.yaw_deg * DEGREE
        ports.append(PlacedPort(port_name, (x, y, yaw), port.width, port.is_blind, port_name in opened))
    return PlacedModule(
        label,
        name,
        module,
        placement,
        footprint=rectangle(pose, placement.length or spec.length, placement.width or spec.width),
        drivable=shapes[0],
        markings=tuple(shapes[1:]),
        lanes=tuple(moved(lane, pose) for lane in module.lanes),
        ports=tuple(ports),
    )


def _disallowed_fields(placement: Placement, module: Module) -> list[str]:
    errors = []
    given = placement.model_fields_set
    allowed = {"terrain": {"length", "width"}, "obstruction": {"length", "width", "height", "z", "mass"}}
    for field in ("length", "width", "height", "z", "mass"):
        if field in given and field not in allowed.get(module.spec.type, set()):
            errors.append(f"{field} cannot be set for {module.name}, which is {_with_article(module.spec.type)}")
    for port in placement.open if isinstance(placement.open, tuple) else ():
        if port not in module.spec.ports:
            known = ", ".join(module.spec.ports) or "none"
            errors.append(f"open: {module.name} has no port '{port}'. It has: {known}")
    return errors


def _mismatch(a: PlacedPort, b: PlacedPort) -> str:
    """The error between two ports that should be connected, and how to fix it; '' if they match."""
    dx, dy = b.pose[0] - a.pose[0], b.pose[1] - a.pose[1]
    distance = math.hypot(dx, dy)
    if distance > PORT_TOLERANCE:
        return (
            f"do not meet: the first is at ({_text(a.pose[0])}, {_text(a.pose[1])}), the second {distance:.3g} m away. "
            f"Move the second module by ({_text(-dx)}, {_text(-dy)}) m"
        )
    turn = math.remainder(b.pose[2] - a.pose[2] - math.pi, 2.0 * math.pi)
    if abs(turn) > HEADING_TOLERANCE:
        return f"do not face each other: turn the second module by {-turn / DEGREE:.4g} degrees"
    if abs(a.width - b.width) > PORT_TOLERANCE:
        return f"are not equally wide: {a.width:.4g} m and {b.width:.4g} m"
    return ""


def _fix(port: PlacedPort) -> str:
    x, y, yaw = port.pose
    heading = math.remainder(yaw + math.pi, 2.0 * math.pi) / DEGREE
    return (
        f"Place a module with a port at ({_text(x)}, {_text(y)}) that faces {heading:.4g} degrees, "
        f"or set 'open: [{port.name}]'"
    )


def _with_article(word: str) -> str:
    return f"an {word}" if word[0] in "aeiou" else f"a {word}"


def _text(metres: float) -> str:
    """Rounded to 0.1 mm, without trailing zeros."""
    return f"{round(metres, 4) + 0.0:g}"
