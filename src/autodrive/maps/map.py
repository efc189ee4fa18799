"""Maps: a YAML file that places modules, walls, blocks and signs, compiled to what is driven on, hit and seen."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from pydantic import TypeAdapter, ValidationError
from shapely.geometry.base import BaseGeometry

from autodrive import descriptions
from autodrive.descriptions import Spec
from autodrive.errors import SpecError
from autodrive.maps.area import drivable_edges
from autodrive.maps.lanes import LaneGraph, Piece, lane_graph
from autodrive.maps.module import MarkingKind
from autodrive.maps.placing import PlacedModule, Placement, PortId, join, overlaps, place
from autodrive.maps.props import Prop, PropSpec, prop_shapes
from autodrive.maps.shapes import NotNegative, Pose, Positive, Shape, rectangle
from autodrive.maps.solids import BlockSpec, BoxPlacement, StaticShape, WallSpec, block_shape, wall_shapes
from autodrive.state import Floats
from autodrive.units import DEGREE

GRID = 1e-6
"""Polygons are united on this grid [m], so that modules that touch leave no sliver between them."""


class GroundSpec(Spec):
    """The floor under everything: the plane z = 0."""

    length: Positive = 20.0
    """Extent along x that is drawn [m]; the plane itself has no end."""
    width: Positive = 20.0
    """Extent along y that is drawn [m]."""
    friction: NotNegative = 0.6
    """Coulomb coefficient between the ground and bodies such as boxes (Unity's default material)."""
    grip: NotNegative = 1.0
    """Factor on the friction of the tyres: 1 on dry road, less on a wet one."""


class MapSpec(Spec):
    """A map: modules at places, and what stands around them."""

    title: str
    note: str = ""
    ground: GroundSpec = GroundSpec()
    paved: tuple[Shape, ...] = ()
    """Ground that may be driven on, besides the roads of the modules."""
    placements: tuple[Placement, ...] = ()
    walls: tuple[WallSpec, ...] = ()
    blocks: tuple[BlockSpec, ...] = ()
    props: tuple[PropSpec, ...] = ()


@dataclass(frozen=True)
class Surface:
    """Ground of one kind, to be drawn; later ones lie over earlier ones."""

    kind: str
    """'lawn' or 'road'."""
    geometry: BaseGeometry


@dataclass(frozen=True)
class Marking:
    """Something painted on the road."""

    kind: MarkingKind
    colour: str
    geometry: BaseGeometry
    z_order: int
    """Higher is painted later."""


@dataclass(frozen=True)
class ParkingBay:
    """Where one vehicle may park."""

    name: str
    pose: Pose
    """Centre and heading of a parked vehicle [m, m, rad]."""
    length: float
    width: float


@dataclass(frozen=True)
class Map:
    """A compiled map. Everything is in its axes, metres and radians."""

    name: str
    title: str
    ground: GroundSpec
    drivable: BaseGeometry
    """Union of all that may be driven on."""
    drivable_edges: Floats
    """x0, y0, x1, y1 of every edge of every ring of `drivable` [m], shape (n, 4), for `area.is_inside`."""
    statics: tuple[StaticShape, ...]
    boxes: tuple[BoxPlacement, ...]
    surfaces: tuple[Surface, ...]
    markings: tuple[Marking, ...]
    props: tuple[Prop, ...]
    bays: tuple[ParkingBay, ...]
    lane_graph: LaneGraph
    bounds: tuple[float, float, float, float]
    """x_min, y_min, x_max, y_max of all that was placed; of the ground if nothing was [m]."""
    modules: tuple[PlacedModule, ...]
    joins: dict[PortId, PortId]
    """Which port of which module meets which, both ways round."""


def load_map(name: str | Path) -> Map:
    """The map of that name, or of that YAML file, compiled. Raises `SpecError` with all faults of the file."""
    path = descriptions.find("map", name)
    text = path.read_text(encoding="utf-8")
    try:
        spec = descriptions.parse(text, MapSpec, where=str(path))
    except SpecError as error:
        faults = [f"map '{path.stem}': {fault}" for fault in error.faults]
        raise SpecError([*faults, *_faults_of_the_rest(text, path)], str(path)) from None
    return compile_map(spec, path.stem, path=path)


def compile_map(spec: MapSpec, name: str = "map", *, path: Path | None = None) -> Map:
    """What a description stands for. `path` is the file's, for messages and for modules beside it."""
    folder = path.parent if path else None
    placed, faults = place(enumerate(spec.placements, 1), folder)
    joins, unjoined = join(placed, is_complete=len(placed) == len(spec.placements))
    statics, props = _statics(spec)
    boxes = tuple(_box(one) for one in placed if one.module.spec.type == "obstruction")
    faults += [*unjoined, *_overlaps(placed, statics), *_twice([*statics, *boxes])]
    if faults:
        raise SpecError([f"map '{name}': {fault}" for fault in faults], str(path or ""))

    drivable = _united([*(one.drivable for one in placed), *(s.geometry() for s in spec.paved)])
    lawns = [one.footprint for one in placed if one.module.spec.type == "terrain"]
    lawn = shapely.difference(shapely.union_all(lawns, grid_size=GRID), drivable, grid_size=GRID)
    return Map(
        name,
        spec.title,
        spec.ground,
        drivable,
        drivable_edges(drivable),
        statics,
        boxes,
        surfaces=(Surface("lawn", lawn), Surface("road", drivable)),
        markings=_markings(placed),
        props=props,
        bays=_bays(placed),
        lane_graph=_lane_graph(placed, joins),
        bounds=_bounds(spec, placed, statics),
        modules=tuple(placed),
        joins=joins,
    )


def _united(polygons: Sequence[BaseGeometry]) -> BaseGeometry:
    """Their union; what meets but for rounding is one, as edges of turned modules are."""
    wider = [polygon.buffer(GRID, join_style="mitre") for polygon in polygons if not polygon.is_empty]
    return shapely.set_precision(shapely.union_all(wider).buffer(-GRID, join_style="mitre"), GRID)


def _faults_of_the_rest(text: str, path: Path) -> list[str]:
    """Faults in how the readable placements of an otherwise faulty file fit together."""
    try:
        tree: Any = yaml.safe_load(text)
    except yaml.YAMLError:
        return []
    raw = tree.get("placements") if isinstance(tree, dict) else None
    numbered: list[tuple[int, Placement]] = []
    for number, item in enumerate(raw if isinstance(raw, list) else [], 1):
        try:
            numbered.append((number, TypeAdapter(Placement).validate_python(item)))
        except ValidationError:
            continue
    placed, faults = place(numbered, path.parent)
    _, unjoined = join(placed, is_complete=False)
    return [f"map '{path.stem}': {fault}" for fault in [*faults, *unjoined, *_overlaps(placed, ())]]


def _overlaps(placed: list[PlacedModule], statics: tuple[StaticShape, ...]) -> list[str]:
    """Flat modules must not overlap each other; boxes must not overlap boxes or what stands fast."""
    flat = [one for one in placed if one.module.spec.type not in {"terrain", "obstruction"}]
    boxes = [one for one in placed if one.module.spec.type == "obstruction"]
    solid = [(box.label, box.footprint, box.placement.z, box.placement.z + box.size[2]) for box in boxes]
    for shape in statics if boxes else ():
        low, high = shape.span
        solid.append((f"'{shape.name}'", shape.plan, low, high))
    return [
        *overlaps([(one.label, one.footprint, 0.0, 1.0) for one in flat], len(flat)),
        *overlaps(solid, len(boxes)),
    ]


def _twice(solids: Sequence[StaticShape | BoxPlacement]) -> list[str]:
    """Solid things are known by their names."""
    count = Counter(solid.name for solid in solids)
    return [f"the name '{name}' is given to {n} solid things; names must differ" for name, n in count.items() if n > 1]


def _box(one: PlacedModule) -> BoxPlacement:
    own = one.placement
    mass = own.mass or one.module.spec.mass
    assert mass is not None
    return BoxPlacement(one.name, one.size, mass, (own.x, own.y, own.z + one.size[2] / 2.0), own.pose[2])


def _statics(spec: MapSpec) -> tuple[tuple[StaticShape, ...], tuple[Prop, ...]]:
    props = tuple(Prop(prop.name or f"{prop.kind}_{i}", prop.kind, prop.pose) for i, prop in enumerate(spec.props, 1))
    walls = [shape for wall in spec.walls for shape in wall_shapes(wall)]
    blocks = [block_shape(block, block.name or f"block_{i}") for i, block in enumerate(spec.blocks, 1)]
    return (*walls, *blocks, *(shape for prop in props for shape in prop_shapes(prop))), props


def _markings(placed: list[PlacedModule]) -> tuple[Marking, ...]:
    return tuple(
        Marking(kind, "white", geometry, z_order=1)
        for one in placed
        for (kind, _), geometry in zip(one.module.markings, one.markings, strict=True)
    )


def _bays(placed: list[PlacedModule]) -> tuple[ParkingBay, ...]:
    bays = []
    for one in placed:
        x0, y0, yaw = one.placement.pose
        for bay in one.module.spec.bays:
            x = x0 + math.cos(yaw) * bay.x - math.sin(yaw) * bay.y
            y = y0 + math.sin(yaw) * bay.x + math.cos(yaw) * bay.y
            bays.append(ParkingBay(f"{one.name}.{bay.name}", (x, y, yaw + bay.yaw_deg * DEGREE), bay.length, bay.width))
    return tuple(bays)


def _lane_graph(placed: list[PlacedModule], joins: dict[PortId, PortId]) -> LaneGraph:
    """A lane that ends at a port ends where those begin that come in at the port that it meets."""
    pieces: list[Piece] = []
    for i, one in enumerate(placed):
        yaw = {port.name: port.pose[2] for port in one.ports}
        for (port_in, port_out), points in zip(one.module.spec.lanes, one.lanes, strict=True):
            met = joins.get((i, port_out))
            end = ("in", met) if met else ("out", (i, port_out))
            yaws = (_wrapped(yaw[port_in] + math.pi), _wrapped(yaw[port_out]))
            pieces.append(Piece(f"{one.name}:{port_in}>{port_out}", points, yaws, ("in", (i, port_in)), end))
    return lane_graph(pieces)


def _wrapped(angle: float) -> float:
    """The same angle within half a turn of zero [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


def _bounds(
    spec: MapSpec, placed: list[PlacedModule], statics: tuple[StaticShape, ...]
) -> tuple[float, float, float, float]:
    content = [one.footprint for one in placed] + [shape.plan for shape in statics]
    content += [shape.geometry() for shape in spec.paved]
    content = content or [rectangle((0.0, 0.0, 0.0), spec.ground.length, spec.ground.width)]
    x0, y0, x1, y1 = shapely.total_bounds(np.array(content, dtype=object))
    return float(x0), float(y0), float(x1), float(y1)
