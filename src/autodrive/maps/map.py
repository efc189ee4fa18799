"""Maps: a YAML file with placed modules, walls, blocks and signs, compiled to drivable area, solids and markings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field, ValidationError, model_validator
from shapely.geometry.base import BaseGeometry

from autodrive import specs
from autodrive.arrays import Floats
from autodrive.errors import SpecError
from autodrive.maps.area import drivable_edges
from autodrive.maps.lanes import LaneGraph, Piece, lane_graph
from autodrive.maps.module import MarkingKind
from autodrive.maps.placing import PlacedModule, Placement, PortId, join, overlaps, place
from autodrive.maps.props import Prop, PropSpec, prop_shapes
from autodrive.maps.shapes import Extent, Pose, Shapes, rectangle
from autodrive.maps.solids import BlockSpec, BoxPlacement, StaticShape, WallSpec, block_shape, wall_shapes
from autodrive.maps.track_map import barriers, lane, pieces, road, start_line
from autodrive.specs import Spec
from autodrive.tracks.track import Track, TrackSpec
from autodrive.units import DEGREE

GRID = 1e-6
"""Grid for unions of polygons [m], so that modules that touch leave no sliver between them."""


MAX_PLACEMENTS = 1000
MAX_STATICS = 2000
"""Of the points of walls, the blocks and the parts (two each) of signs and traffic lights of a map."""
MAX_EXTENT = 1000.0
"""Of a map along x and y [m]."""
RESERVED = ("ground", "world")
"""Names that the engine uses itself."""

Friction: TypeAlias = Annotated[float, Field(ge=0.0, le=100.0)]


class GroundSpec(Spec):
    """The floor under everything: the plane z = 0."""

    length: Extent = 20.0
    """Drawn extent along x [m]; the plane itself is infinite."""
    width: Extent = 20.0
    """Drawn extent along y [m]."""
    friction: Friction = 0.6
    """Coulomb coefficient between the ground and bodies such as boxes (Unity's default material)."""
    grip: Friction = 1.0
    """Factor on the friction of the tyres: 1 on a dry road, less on a wet road."""


class MapSpec(Spec):
    """A map: placed modules and the solid objects around them."""

    title: str
    note: str = ""
    ground: GroundSpec = GroundSpec()
    paved: Shapes = ()
    """Drivable ground in addition to the roads of the modules."""
    placements: Annotated[tuple[Placement, ...], Field(max_length=MAX_PLACEMENTS)] = ()
    walls: tuple[WallSpec, ...] = ()
    blocks: tuple[BlockSpec, ...] = ()
    props: tuple[PropSpec, ...] = ()

    @model_validator(mode="after")
    def _is_small_enough(self) -> MapSpec:
        count = sum(len(wall.points) for wall in self.walls) + len(self.blocks) + 2 * len(self.props)
        if count > MAX_STATICS:
            text = f"{count} points of walls, blocks, and parts of signs and lights; at most {MAX_STATICS} are possible"
            raise specs.RuleError([(("walls" if self.walls else "blocks",), text)])
        return self


@dataclass(frozen=True)
class Surface:
    """Ground of one kind, for drawing; later surfaces cover earlier ones."""

    kind: str
    """'lawn', 'road' or 'track'."""
    geometry: BaseGeometry


@dataclass(frozen=True)
class Marking:
    """A painted road marking."""

    kind: MarkingKind
    colour: str
    geometry: BaseGeometry
    z_order: int
    """Markings with a higher value are painted later."""


@dataclass(frozen=True)
class ParkingBay:
    """A parking space for one vehicle."""

    name: str
    pose: Pose
    """Centre and heading of a parked vehicle [m, m, rad]."""
    length: float
    width: float


@dataclass(frozen=True)
class Map:
    """A compiled map, in the map frame, metres and radians."""

    name: str
    title: str
    ground: GroundSpec
    drivable: BaseGeometry
    """Union of all drivable areas."""
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
    """x_min, y_min, x_max, y_max of everything that was placed, or of the ground if the map is empty [m]."""
    modules: tuple[PlacedModule, ...]
    joins: dict[PortId, PortId]
    """Pairs of connected ports, in both directions."""
    enclosure: BaseGeometry | None
    """The ground inside closed walls that enclose the drivable area; None if there are none."""
    track: Track | None = None
    """The race track, if the map is one; its barriers are in `statics`."""

    def outside(self, x: float, y: float) -> str:
        """Says that a place [m] is outside the walls that enclose the roads; empty if it is not."""
        if self.enclosure is None or self.enclosure.covers(shapely.Point(x, y)):
            return ""
        x0, y0, x1, y1 = self.enclosure.bounds
        return (
            f"({x:g}, {y:g}) is outside the walls of map '{self.name}', "
            f"which enclose x from {x0:g} to {x1:g} m and y from {y0:g} to {y1:g} m"
        )


def load_map(name: str | Path) -> Map:
    """Load and compile the map with that name or path. Raises `SpecError` with all errors of the file."""
    map_, errors, path = read_map(name)
    if errors or map_ is None:
        raise SpecError(errors, str(path))
    return map_


def read_map(name: str | Path) -> tuple[Map | None, list[str], Path]:
    """The map with that name or path, without its faulty placements; all errors of its file; its path.

    The map is None if its file has errors besides those of placements. Raises `SpecError` if there is no such file.
    """
    path = find_map(name)
    source = specs.source(path)
    if _is_track(source):
        track, errors = _readable_track(source, path.stem)
        return track and track_map(track), errors, path
    spec, errors = specs.readable(source, MapSpec)
    if errors or spec is None:
        errors += _errors_of_readable_placements(source, path)
        return None, [f"map '{path.stem}': {error}" for error in errors], path
    map_, errors = _compiled(spec, path.stem, path.parent, source)
    return map_, errors, path


def find_map(name: str | Path) -> Path:
    """Path of the file of a map or track, given its name or path. Raises `SpecError`."""
    if str(name) in specs.names("track") and str(name) not in specs.names("map"):
        return specs.find("track", name)
    return specs.find("map", name, also="track")


def track_map(track: Track) -> Map:
    """The map of a race track. It reports no departures from the road: its barriers are the limits."""
    walls = barriers(track)
    statics = tuple(pieces(walls, track.barrier))
    drivable = road(track)
    x0, y0, x1, y1 = shapely.total_bounds(np.array([drivable, *(shape.plan for shape in statics)], dtype=object))
    bounds = (float(x0), float(y0), float(x1), float(y1))
    extent = 2.0 * max(map(abs, bounds)) + 10.0
    return Map(
        track.name,
        track.title or track.name,
        GroundSpec(length=extent, width=extent),
        drivable,
        drivable_edges=np.empty((0, 4)),
        statics=statics,
        boxes=(),
        surfaces=(Surface("track", drivable),),
        markings=(Marking("stop_line", "white", start_line(track), z_order=1),),
        props=(),
        bays=(),
        lane_graph=lane_graph([lane(track)]),
        bounds=bounds,
        modules=(),
        joins={},
        enclosure=drivable,
        track=track,
    )


def _is_track(source: specs.Source) -> bool:
    return isinstance(source.tree, dict) and "centre_line" in source.tree


def _readable_track(source: specs.Source, name: str) -> tuple[Track | None, list[str]]:
    spec, errors = specs.readable(source, TrackSpec)
    if errors or spec is None:
        return None, [f"track '{name}': {error}" for error in errors]
    return Track.of(spec, name), []


def compile_map(spec: MapSpec, name: str = "map") -> Map:
    """Compile a map that has no file. Raises `SpecError` with all errors."""
    map_, errors = _compiled(spec, name)
    if errors:
        raise SpecError(errors)
    return map_


def _compiled(
    spec: MapSpec, name: str, folder: Path | None = None, source: specs.Source | None = None
) -> tuple[Map, list[str]]:
    """The map without its faulty placements, and its errors. `folder`: where its module files are."""
    placed, errors = place(enumerate(spec.placements, 1), folder, source)
    joins, unjoined = join(placed, is_complete=len(placed) == len(spec.placements))
    statics, props, places = _statics(spec, source or specs.Source())
    obstructions = [one for one in placed if one.module.spec.type == "obstruction"]
    boxes = tuple(_box(one) for one in obstructions)
    bounds = _bounds(spec, placed, statics)
    labels = [*places, *(one.label for one in obstructions)]
    errors += [*unjoined, *_overlaps(placed, statics), *_wrong_names([*statics, *boxes], labels)]
    if max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > MAX_EXTENT:
        errors.append(_too_large(spec, placed, statics, places, bounds, source or specs.Source()))
    drivable = _united([*(one.drivable for one in placed), *(s.geometry() for s in spec.paved)])
    lawns = [one.footprint for one in placed if one.module.spec.type == "terrain"]
    lawn = shapely.difference(shapely.union_all(lawns, grid_size=GRID), drivable, grid_size=GRID)
    map_ = Map(
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
        bounds=bounds,
        modules=tuple(placed),
        joins=joins,
        enclosure=_enclosure(spec, drivable),
    )
    return map_, [f"map '{name}': {error}" for error in errors]


def _too_large(
    spec: MapSpec,
    placed: list[PlacedModule],
    statics: tuple[StaticShape, ...],
    places: list[str],
    bounds: tuple[float, float, float, float],
    source: specs.Source,
) -> str:
    """The error of a map that is too large, with the place of what is farthest from its other parts."""
    x0, y0, x1, y1 = bounds
    axis = 0 if x1 - x0 > y1 - y0 else 1
    labels = [*(one.label for one in placed), *places, *(source.at("paved", i) for i in range(len(spec.paved)))]
    low, high = shapely.bounds(_contents(spec, placed, statics))[:, axis::2].T
    middle = np.median(low + high) / 2.0
    label = labels[int(np.argmax(np.maximum(high - middle, middle - low)))]
    size = f"{x1 - x0:.4g} m x {y1 - y0:.4g} m"
    return f"{label}: the map is {size}; it must be at most {MAX_EXTENT:g} m x {MAX_EXTENT:g} m"


def _enclosure(spec: MapSpec, drivable: BaseGeometry) -> BaseGeometry | None:
    inside = shapely.union_all([wall.enclosed for wall in spec.walls])
    return None if inside.is_empty or not inside.covers(drivable) else inside


def _united(polygons: Sequence[BaseGeometry]) -> BaseGeometry:
    """The union, without gaps that come from rounding, for example between rotated modules."""
    wider = [polygon.buffer(GRID, join_style="mitre") for polygon in polygons if not polygon.is_empty]
    return shapely.set_precision(shapely.union_all(wider).buffer(-GRID, join_style="mitre"), GRID)


def _errors_of_readable_placements(source: specs.Source, path: Path) -> list[str]:
    """Errors in how the valid placements of an invalid file fit together."""
    tree = source.tree
    raw = tree.get("placements") if isinstance(tree, dict) else None
    numbered: list[tuple[int, Placement]] = []
    for number, item in enumerate(raw[:MAX_PLACEMENTS] if isinstance(raw, list) else [], 1):
        try:
            numbered.append((number, Placement.model_validate(item)))
        except ValidationError:
            continue
    placed, errors = place(numbered, path.parent, source)
    _, unjoined = join(placed, is_complete=False)
    return [*errors, *unjoined, *_overlaps(placed, ())]


def _overlaps(placed: list[PlacedModule], statics: tuple[StaticShape, ...]) -> list[str]:
    """Flat modules must not overlap each other; boxes must not overlap boxes or static shapes."""
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


def _wrong_names(solids: Sequence[StaticShape | BoxPlacement], labels: Sequence[str]) -> list[str]:
    """Solid objects are identified by name, so each name must be unique. `labels` say where they are."""
    places: dict[str, list[str]] = {}
    for solid, label in zip(solids, labels, strict=True):
        places.setdefault(solid.name, []).append(label)
    errors = [
        f"{places[name][0]}: the name '{name}' is reserved; choose another one" for name in RESERVED if name in places
    ]
    return errors + [
        f"{where[1]}: the name '{name}' is used by {len(where)} solid objects; names must be unique"
        for name, where in places.items()
        if len(where) > 1
    ]


def _box(one: PlacedModule) -> BoxPlacement:
    own = one.placement
    mass = own.mass or one.module.spec.mass
    assert mass is not None
    return BoxPlacement(one.name, one.size, mass, (own.x, own.y, own.z + one.size[2] / 2.0), own.pose[2])


def _statics(spec: MapSpec, source: specs.Source) -> tuple[tuple[StaticShape, ...], tuple[Prop, ...], list[str]]:
    """The fixed solids, the signs and lights, and where each of the solids is in the text."""
    props = tuple(Prop(prop.name or f"{prop.kind}_{i}", prop.kind, prop.pose) for i, prop in enumerate(spec.props, 1))
    solids = [("walls", i, shape) for i, wall in enumerate(spec.walls) for shape in wall_shapes(wall)]
    solids += [("blocks", i, block_shape(block, block.name or f"block_{i + 1}")) for i, block in enumerate(spec.blocks)]
    solids += [("props", i, shape) for i, prop in enumerate(props) for shape in prop_shapes(prop)]
    return tuple(shape for _, _, shape in solids), props, [source.at(key, i) for key, i, _ in solids]


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
    """At a pair of connected ports, lanes that leave one port share a node with lanes that enter the other."""
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
    """The angle wrapped to [-pi, pi] [rad]."""
    return math.remainder(angle, 2.0 * math.pi)


def _bounds(
    spec: MapSpec, placed: list[PlacedModule], statics: tuple[StaticShape, ...]
) -> tuple[float, float, float, float]:
    content = _contents(spec, placed, statics)
    if not len(content):
        content = np.array([rectangle((0.0, 0.0, 0.0), spec.ground.length, spec.ground.width)], dtype=object)
    x0, y0, x1, y1 = shapely.total_bounds(content)
    return float(x0), float(y0), float(x1), float(y1)


def _contents(spec: MapSpec, placed: list[PlacedModule], statics: tuple[StaticShape, ...]) -> NDArray[np.object_]:
    """The outlines of all that was placed."""
    outlines = [one.footprint for one in placed] + [shape.plan for shape in statics]
    return np.array([*outlines, *(shape.geometry() for shape in spec.paved)], dtype=object)
