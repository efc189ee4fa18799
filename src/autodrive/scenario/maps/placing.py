"""Placement of modules in a map: connects ports, finds overlaps, reports problems."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.specs import MAX_ERRORS, PlaceInFile, Problem
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.module import Module, compile_module
from autodrive.scenario.maps.shapes import Pose, moved, rectangle
from autodrive.scenario.maps.spec import DescribedMap, Placement

PORT_TOLERANCE = 1e-3
"""Largest distance between connected ports, and largest difference of their widths [m]."""
HEADING_TOLERANCE = 0.1 * DEGREE
"""Largest deviation of connected ports from opposite headings [rad]: 0.5 mm at the edge of the road."""
REACH = 0.3
"""Ports nearer than this (half a road width) must be connected; otherwise it is an error [m]."""
MAX_CORNERS = 200_000
"""Most corners of the polygons and lanes of all placed modules."""
MAX_PAIRS = 10_000
"""Pairs of touching solids that are checked for an overlap."""
SLIVER = 1e-5
"""Largest allowed overlap of footprints [m^2] (placements are rounded to 0.1 mm)."""

PortId: TypeAlias = tuple[int, str]
"""Index of the placed module, name of the port."""
Solid: TypeAlias = tuple[PlaceInFile | str, BaseGeometry, float, float]
"""Label, footprint, bottom and top [m]."""


@dataclass(frozen=True)
class PlacedPort:
    """A port of a placed module, in the map frame."""

    name: str
    pose: Pose
    """x [m], y [m], yaw [rad] outward."""
    width: float
    lanes: int
    is_blind: bool
    is_open: bool
    """True if the port may stay unconnected."""


@dataclass(frozen=True)
class PlacedModule:
    """A placed module: its parts in the map frame [m]."""

    label: PlaceInFile
    """Title in error messages: "placement 4 'curved_road'"."""
    name: str
    module: Module
    placement: Placement
    footprint: shapely.Polygon
    drivable: BaseGeometry
    markings: tuple[BaseGeometry, ...]
    """Markings of the module, moved to the place."""
    lanes: tuple[Floats, ...]
    """Lanes of the module, moved to the place."""
    ports: tuple[PlacedPort, ...]

    @property
    def size(self) -> tuple[float, float, float]:
        """Length, width, height [m]."""
        spec, own = self.module.spec, self.placement
        return own.length or spec.length, own.width or spec.width, own.height or spec.height


ProblemKind: TypeAlias = Literal[
    "module",
    "field",
    "name",
    "corners",
    "extent",
    "unconnected",
    "apart",
    "turned",
    "width",
    "overlap",
    "solids",
    "blocked",
    "bend",
    "touch",
    "narrow",
]
"""Kinds of problems. A file that cannot be read: 'module'. Too large: 'corners', 'extent'. Ports: 'unconnected',
'apart', 'turned', 'width'. 'overlap': roads overlap; 'solids': boxes, walls or blocks do; 'blocked': a wall, block or
sign stands on a lane. For the kinds of a track by points see `points.Fault`."""


OF_DRAFT: frozenset[ProblemKind] = frozenset(
    {"unconnected", "apart", "turned", "width", "overlap", "blocked", "bend", "touch", "narrow"}
)
"""What may be wrong while a map is being built: such a map can be simulated."""


@dataclass(frozen=True)
class PlacingProblem:
    """What is wrong with a map; `text` follows from the other values."""

    kind: ProblemKind
    part: PlaceInFile | str
    """The placement, wall, block or sign."""
    detail: str = ""
    """The end of the text, if it does not follow from the values below."""
    port: PlacedPort | None = None
    other: PlaceInFile | str = ""
    """The second part of two."""
    other_port: PlacedPort | None = None
    dx: float = 0.0
    """Moving the second module by (dx, dy) [m] or turning it by `turn` [rad], left positive, repairs it."""
    dy: float = 0.0
    turn: float = 0.0
    area: float = 0.0
    """Area of an overlap [m^2]."""
    at: tuple[float, float] | None = None
    """Where a lane is blocked, or the fault of a track [m]."""

    @property
    def text(self) -> Problem:
        """The parts of the message."""
        if self.detail:
            return self.part, self.detail
        if self.at:
            return self.part, " stands on a lane of ", self.other, ". Move it."
        if self.area:
            return self.part, " overlaps ", self.other, f" by {self.area * 1e4:.4g} cm^2. Move one of them."
        assert self.port is not None
        if self.other_port is None:
            return self.part, f": port '{self.port.name}' is not connected. {_fix(self.port)}"
        ports_of = f": port '{self.port.name}' and port '{self.other_port.name}' of "
        return self.part, ports_of, self.other, f" {self._mismatch(self.port, self.other_port)}"

    def _mismatch(self, first: PlacedPort, second: PlacedPort) -> str:
        if self.kind == "apart":
            return (
                f"do not meet: the first is at ({_text(first.pose[0])}, {_text(first.pose[1])}), the second "
                f"{math.hypot(self.dx, self.dy):.3g} m away. Move the second module by ({_text(self.dx)}, "
                f"{_text(self.dy)}) m"
            )
        if self.kind == "turned":
            return f"do not face each other: turn the second module by {self.turn / DEGREE:.4g} degrees"
        if first.lanes != second.lanes:
            return f"have different numbers of lanes: {first.lanes} and {second.lanes} in each direction"
        return f"have different widths: {first.width:.4g} m and {second.width:.4g} m"


def place(described: DescribedMap) -> tuple[list[PlacedModule], list[PlacingProblem]]:
    """The placed modules, and a problem for each module, port and field that is not valid."""
    placed: list[PlacedModule] = []
    problems: list[PlacingProblem] = []
    names: set[str] = set()
    corners = 0
    for number, placement in described.placements:
        title = f"placement {number} '{placement.name or placement.module}'"
        label = PlaceInFile("map", ("placements", number - 1), title)
        described_module = described.modules[placement.module]
        if described_module.spec_or_none is None:
            problems.append(PlacingProblem("module", label, f": {described_module.error}"))
            continue
        module = compile_module(described_module)
        corners += module.corners
        if corners > MAX_CORNERS:
            text = f": the modules up to here have {corners} corners; at most {MAX_CORNERS} are possible"
            problems.append(PlacingProblem("corners", label, text))
            break
        problems += [PlacingProblem("field", label, f": {text}") for text in _disallowed_fields(placement, module)]
        name = placement.name or f"{module.name}_{number}"
        if name in names:
            problems.append(PlacingProblem("name", label, f": the name '{name}' is already used; names must be unique"))
        names.add(name)
        placed.append(_placed(label, name, module, placement))
    return placed, problems


def join(placed: Sequence[PlacedModule], *, is_complete: bool) -> tuple[dict[PortId, PortId], list[PlacingProblem]]:
    """The connected ports (in both directions), and a problem for each port that is unconnected or does not match.

    If some placements are not valid (`is_complete` False), unconnected ports are no problem.
    """
    ports = [(i, port) for i, module in enumerate(placed) for port in module.ports if not port.is_blind]
    joins: dict[PortId, PortId] = {}
    problems: list[PlacingProblem] = []
    if not ports:
        return joins, problems
    at = np.array([port.pose[:2] for _, port in ports])
    owner = np.array([i for i, _ in ports])
    for k, (i, port) in enumerate(ports):
        distance = np.where(owner == i, np.inf, np.hypot(*(at - at[k]).T))
        nearest = int(np.argmin(distance))
        j, other = ports[nearest]
        if distance[nearest] > REACH:
            if is_complete and not port.is_open:
                problems.append(PlacingProblem("unconnected", placed[i].label, port=port))
            continue
        mismatch = _mismatch(placed[i].label, port, placed[j].label, other)
        if not mismatch:
            joins[i, port.name] = (j, other.name)
        elif i < j or np.hypot(*(at - at[nearest]).T)[k] > REACH:
            problems.append(mismatch)
    return joins, problems


def overlaps(solids: Sequence[Solid], movable: int, kind: ProblemKind = "solids") -> list[PlacingProblem]:
    """A problem of that kind for each pair of solids that overlap.

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
    problems = [
        PlacingProblem(kind, solids[i][0], other=solids[j][0], area=float(a))
        for i, j, a in sorted(zip(first[is_error], second[is_error], area[is_error], strict=True))
    ]
    more = len(problems) - MAX_ERRORS
    return [*problems[:MAX_ERRORS], PlacingProblem(kind, "", f"and {more} more overlaps")] if more > 0 else problems


def blocked_lanes(
    placed: Sequence[PlacedModule], solids: Sequence[tuple[PlaceInFile, BaseGeometry]]
) -> list[PlacingProblem]:
    """A problem for each solid that stands on a lane, and each module whose lane that is."""
    lanes = [(module, shapely.LineString(line)) for module in placed for line in module.lanes]
    if not lanes or not solids:
        return []
    tree = shapely.STRtree([plan for _, plan in solids])
    problems: dict[tuple[PlaceInFile, PlaceInFile], PlacingProblem] = {}
    for i, k in tree.query([line for _, line in lanes], predicate="intersects").T[:MAX_PAIRS]:
        (module, line), (part, plan) = lanes[i], solids[k]
        middle = line.intersection(plan).centroid
        problem = PlacingProblem("blocked", part, other=module.label, at=(middle.x, middle.y))
        problems.setdefault((part, module.label), problem)
    return [*problems.values()][:MAX_ERRORS]


def _placed(label: PlaceInFile, name: str, module: Module, placement: Placement) -> PlacedModule:
    pose, spec = placement.pose, module.spec
    opened = set(spec.ports) if placement.open is True else set(placement.open or ())
    shapes = shapely.transform(
        np.array([module.drivable, *(shape for _, shape in module.markings)], dtype=object), lambda p: moved(p, pose)
    )
    ports = []
    for port_name, port in spec.ports.items():
        x, y = moved(np.array([[port.x, port.y]]), pose)[0].tolist()
        yaw = pose[2] + port.yaw_deg * DEGREE
        ports.append(PlacedPort(port_name, (x, y, yaw), port.width, port.lanes, port.is_blind, port_name in opened))
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
    given_fields = placement.model_fields_set
    allowed = {"terrain": {"length", "width"}, "obstruction": {"length", "width", "height", "z", "mass"}}
    for field in ("length", "width", "height", "z", "mass"):
        if field in given_fields and field not in allowed.get(module.spec.type, set()):
            errors.append(f"{field} cannot be set for {module.name}, which is {_with_article(module.spec.type)}")
    for port in placement.open if isinstance(placement.open, tuple) else ():
        if port not in module.spec.ports:
            known = ", ".join(module.spec.ports) or "none"
            errors.append(f"open: {module.name} has no port '{port}'. Ports of {module.name}: {known}")
    return errors


def _mismatch(part: PlaceInFile, a: PlacedPort, other: PlaceInFile, b: PlacedPort) -> PlacingProblem | None:
    """The problem of two ports that should be connected; None if they match."""
    problem = functools.partial(PlacingProblem, part=part, port=a, other=other, other_port=b)
    dx, dy = a.pose[0] - b.pose[0], a.pose[1] - b.pose[1]
    if math.hypot(dx, dy) > PORT_TOLERANCE:
        return problem("apart", dx=dx, dy=dy)
    turn = -math.remainder(b.pose[2] - a.pose[2] - math.pi, 2.0 * math.pi)
    if abs(turn) > HEADING_TOLERANCE:
        return problem("turned", turn=turn)
    return problem("width") if abs(a.width - b.width) > PORT_TOLERANCE or a.lanes != b.lanes else None


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
