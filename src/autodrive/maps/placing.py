"""Placing modules in a map: which ports meet, what overlaps, and every fault in it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.descriptions import Spec
from autodrive.errors import SpecError
from autodrive.maps.module import Module, load_module
from autodrive.maps.shapes import NotNegative, Pose, Positive, moved, rectangle
from autodrive.state import Floats
from autodrive.units import DEGREE

PORT_TOLERANCE = 1e-3
"""How far apart two ports may be that meet [m]; also the difference in width that they may have."""
HEADING_TOLERANCE = 0.1 * DEGREE
"""How far two ports that meet may be from facing each other [rad]: 0.5 mm at the edge of the road."""
REACH = 0.3
"""Ports nearer than half a road are meant to meet; if they do not, that is a fault [m]."""
SLIVER = 1e-5
"""Footprints may overlap by less than this area [m^2] (rounding of placements to a tenth of a millimetre)."""

PortId: TypeAlias = tuple[int, str]
"""Index of the placed module, name of its port."""


class Placement(Spec):
    """A module at a place: x, y [m] and yaw of the centre of its footprint."""

    module: str
    name: str = ""
    x: float
    y: float
    yaw_deg: float = 0.0
    open: bool | tuple[str, ...] = False
    """True, or the names of the ports that may meet nothing."""
    length: Positive | None = None
    """Terrain and boxes only: instead of the module's own [m]."""
    width: Positive | None = None
    height: Positive | None = None
    """Boxes only [m]."""
    z: NotNegative = 0.0
    """Boxes only: height of the underside above ground [m]."""
    mass: Positive | None = None
    """Boxes only [kg]."""

    @property
    def pose(self) -> Pose:
        """Of the module's origin."""
        return self.x, self.y, self.yaw_deg * DEGREE


@dataclass(frozen=True)
class PlacedPort:
    """A port of a placed module, in the axes of the map."""

    name: str
    pose: Pose
    """x [m], y [m], yaw [rad] outward."""
    width: float
    is_blind: bool
    is_open: bool
    """It may meet nothing."""


@dataclass(frozen=True)
class PlacedModule:
    """A module where it was placed: its parts in the axes of the map [m]."""

    label: str
    """For messages: "placement 4 'curved_road'"."""
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


def place(numbered: Iterable[tuple[int, Placement]], folder: Path | None) -> tuple[list[PlacedModule], list[str]]:
    """The placed modules, and the faults of those placements that name an unknown module or do not suit theirs.

    Modules given as a path are looked for beside the map, in `folder`.
    """
    placed: list[PlacedModule] = []
    faults: list[str] = []
    names: set[str] = set()
    for number, placement in numbered:
        label = f"placement {number} '{placement.name or placement.module}'"
        try:
            is_path = placement.module.endswith((".yaml", ".yml"))
            module = load_module(folder / placement.module if folder and is_path else placement.module)
        except SpecError as error:
            faults.append(f"{label}: {error}")
            continue
        faults += [f"{label}: {fault}" for fault in _unsuitable(placement, module)]
        name = placement.name or f"{module.name}_{number}"
        if name in names:
            faults.append(f"{label}: the name '{name}' is taken; names must differ")
        names.add(name)
        placed.append(_placed(label, name, module, placement))
    return placed, faults


def join(placed: Sequence[PlacedModule], *, is_complete: bool = True) -> tuple[dict[PortId, PortId], list[str]]:
    """Which port meets which (both ways round), and a fault for every port that meets none, or not well.

    When some placements could not be read (`is_complete` False), a port that meets nothing is no fault.
    """
    ports = [(i, port) for i, one in enumerate(placed) for port in one.ports if not port.is_blind]
    joins: dict[PortId, PortId] = {}
    faults: list[str] = []
    if not ports:
        return joins, faults
    at = np.array([port.pose[:2] for _, port in ports])
    owner = np.array([i for i, _ in ports])
    for k, (i, port) in enumerate(ports):
        distance = np.where(owner == i, np.inf, np.hypot(*(at - at[k]).T))
        nearest = int(np.argmin(distance))
        j, other = ports[nearest]
        if distance[nearest] > REACH:
            if is_complete and not port.is_open:
                faults.append(f"{placed[i].label}: port '{port.name}' meets nothing. {_remedy(port)}")
            continue
        problem = _mismatch(port, other)
        if not problem:
            joins[i, port.name] = (j, other.name)
        elif i < j or np.hypot(*(at - at[nearest]).T)[k] > REACH:
            faults.append(
                f"{placed[i].label}: port '{port.name}' and port '{other.name}' of {placed[j].label} {problem}"
            )
    return joins, faults


def overlaps(solids: Sequence[tuple[str, BaseGeometry, float, float]], movable: int) -> list[str]:
    """A fault for every two things that overlap, given as label, footprint, bottom and top [m].

    Only the first `movable` of them are at fault; what the others do among themselves is theirs.
    """
    if not movable:
        return []
    plans = np.array([plan for _, plan, _, _ in solids], dtype=object)
    first, second = shapely.STRtree(plans).query(plans[:movable], predicate="intersects")
    area = shapely.area(shapely.intersection(plans[first], plans[second]))
    span = np.array([(low, high) for _, _, low, high in solids])
    common = np.minimum(span[first, 1], span[second, 1]) - np.maximum(span[first, 0], span[second, 0])
    is_fault = (first < second) & (area > SLIVER) & (common > PORT_TOLERANCE)
    return [
        f"{solids[i][0]} overlaps {solids[j][0]} by {a * 1e4:.4g} cm^2. Move one of them."
        for i, j, a in sorted(zip(first[is_fault], second[is_fault], area[is_fault], strict=True))
    ]


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


def _unsuitable(placement: Placement, module: Module) -> list[str]:
    faults = []
    given = placement.model_fields_set
    allowed = {"terrain": {"length", "width"}, "obstruction": {"length", "width", "height", "z", "mass"}}
    for field in ("length", "width", "height", "z", "mass"):
        if field in given and field not in allowed.get(module.spec.type, set()):
            faults.append(f"{field} cannot be set for {module.name}, which is {_with_article(module.spec.type)}")
    for port in placement.open if isinstance(placement.open, tuple) else ():
        if port not in module.spec.ports:
            known = ", ".join(module.spec.ports) or "none"
            faults.append(f"open: {module.name} has no port '{port}'. It has: {known}")
    return faults


def _mismatch(a: PlacedPort, b: PlacedPort) -> str:
    """What is wrong between two ports that should meet, and what would be right; '' if they match."""
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


def _remedy(port: PlacedPort) -> str:
    x, y, yaw = port.pose
    heading = math.remainder(yaw + math.pi, 2.0 * math.pi) / DEGREE
    return (
        f"Put a port of another module at ({_text(x)}, {_text(y)}) that faces {heading:.4g} degrees, "
        f"or say 'open: [{port.name}]'"
    )


def _with_article(word: str) -> str:
    return f"an {word}" if word[0] in "aeiou" else f"a {word}"


def _text(metres: float) -> str:
    """To a tenth of a millimetre, without needless zeros."""
    return f"{round(metres, 4) + 0.0:g}"
