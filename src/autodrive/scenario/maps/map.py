"""Maps: a MapSpec with placed modules, walls, blocks and signs, compiled to drivable area, solids and markings."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from autodrive.base import specs
from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.specs import PlaceInFile
from autodrive.base.units import DEGREE
from autodrive.scenario.maps.area import drivable_edges
from autodrive.scenario.maps.lanes import LaneGraph, Piece, lane_graph
from autodrive.scenario.maps.light_programs import MAX_LIGHTS, LightProgramSpec, program_problems
from autodrive.scenario.maps.module import MarkingKind, Module, compile_module, lane_end
from autodrive.scenario.maps.placing import (
    OF_DRAFT,
    PlacedModule,
    PlacingProblem,
    PortId,
    Solid,
    blocked_lanes,
    join,
    overlaps,
    place,
)
from autodrive.scenario.maps.props import Prop, prop_shapes
from autodrive.scenario.maps.shapes import Pose, rectangle
from autodrive.scenario.maps.solids import BoxPlacement, StaticShape, block_shape, wall_shapes
from autodrive.scenario.maps.spec import DescribedMap, GroundSpec, MapSpec
from autodrive.scenario.maps.stop_lines import StopLine, stop_lines
from autodrive.scenario.maps.track_map import barriers, lane, pieces, road, start_line
from autodrive.scenario.tracks.checks import NO_WALLS
from autodrive.scenario.tracks.points import faults
from autodrive.scenario.tracks.track import Track, TrackSpec

GRID = 1e-6
"""Grid for unions of polygons [m], so that modules that touch leave no sliver between them."""


MAX_EXTENT = 1000.0
"""Largest size of a map along x and y [m]."""
RESERVED = ("ground", "world")
"""Names that the engine uses itself."""


@dataclass(frozen=True)
class Marking:
    """A road marking, painted white."""

    kind: MarkingKind
    geometry: BaseGeometry


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
    lawn: BaseGeometry
    """Ground of the terrain modules that is not drivable."""
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
    light_programs: dict[str, LightProgramSpec] = field(default_factory=dict)
    """Programs of the traffic lights, by name."""
    stop_lines: tuple[StopLine, ...] = ()
    """Stop lines of traffic lights and stop signs."""
    give_way_lines: tuple[StopLine, ...] = ()
    """Lines of give-way signs, at which drivers wait."""
    track: Track | None = None
    """The race track, if the map is one; its barriers are in `statics`."""

    @property
    def traffic_lights(self) -> list[str]:
        """Names of the traffic lights, in the order of the devkit."""
        return list(self.light_poses)

    @property
    def light_poses(self) -> dict[str, Pose]:
        """Poses of the traffic lights by name, in the order of `traffic_lights`."""
        return {prop.name: prop.pose for prop in self.props if prop.kind == "traffic_light"}


def load_map(name: str | Path | MapSpec | TrackSpec) -> Map:
    """Load and compile the map with that name or path, or of a Spec. Raises `SpecError` with all errors."""
    from autodrive.scenario import files  # noqa: PLC0415  compiling needs no files

    described, lines = files.read_map(name)
    map_, problems = compile_map(described)
    texts = problem_texts(described, problems)
    if texts or map_ is None:
        raise SpecError(specs.joined(texts, lines), described.path)
    return map_


def map_warnings(name: str | Path | MapSpec | TrackSpec) -> list[str]:
    """What is not finished in a map that is being built, with lines."""
    from autodrive.scenario import files  # noqa: PLC0415  as above

    described, lines = files.read_map(name)
    _, problems = compile_map(described)
    return specs.joined([problem.text for problem in problems_of_draft(described, problems)], lines)


def load_module(name: str | Path) -> Module:
    """Load and compile the module with that name or path. Raises `SpecError`."""
    from autodrive.scenario import files  # noqa: PLC0415  as above

    return compile_module(files.read_module(name))


@functools.lru_cache(maxsize=8)
def compile_map(described: DescribedMap) -> tuple[Map | None, tuple[PlacingProblem, ...]]:
    """The map without its faulty placements, None if its file is not valid; and what else is wrong."""
    spec = described.spec_or_none
    if isinstance(spec, TrackSpec):
        track = Track.of(spec, described.name)
        return (track_map(track) if track.walls else None), _faults(spec)
    placed, problems = place(described)
    joins, unjoined = join(placed, is_complete=spec is not None and len(placed) == len(spec.placements))
    map_, more = _compiled(spec, described.name, placed, joins) if spec else (None, _overlaps(placed, ()))
    return map_, (*problems, *unjoined, *more)


def _faults(spec: TrackSpec) -> tuple[PlacingProblem, ...]:
    """What is wrong with a track by points, or with one by a centre line that cannot be a map."""
    if spec.width is None:
        no_walls = PlacingProblem("module", PlaceInFile("map", ("centre_line",)), f": {NO_WALLS}")
        return () if spec.walls else (no_walls,)
    return tuple(
        PlacingProblem(
            fault.kind, PlaceInFile("map", ("points", fault.point)), f": {fault.text}", at=(fault.x, fault.y)
        )
        for fault in faults(np.array(spec.points), spec.width)
    )


def problems_of_draft(described: DescribedMap, problems: Sequence[PlacingProblem]) -> list[PlacingProblem]:
    """What may be wrong because the map is being built."""
    return [problem for problem in problems if described.is_draft and problem.kind in OF_DRAFT]


def problem_texts(
    described: DescribedMap, problems: Sequence[PlacingProblem], *, has_name: bool = True
) -> list[specs.Problem]:
    """The messages of the errors of a file, and of what else is wrong; those begin with the name of the map."""
    of_file = described.error.errors if described.error else []
    kind = "track" if isinstance(described.spec_or_none, TrackSpec) else "map"
    prefix = f"{kind} '{described.name}': " if has_name else ""
    allowed = problems_of_draft(described, problems)
    return [
        *((text,) for text in of_file),
        *((prefix, *problem.text) for problem in problems if problem not in allowed),
    ]


def track_map(track: Track) -> Map:
    """The map of a race track. It reports no departures from the road: its barriers are the limits.

    Raises `SpecError` if the track has no walls.
    """
    if not track.walls:
        raise SpecError([f"track '{track.name}': {NO_WALLS}"])
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
        lawn=shapely.Polygon(),
        markings=(Marking("stop_line", start_line(track)),),
        props=(),
        bays=(),
        lane_graph=lane_graph([lane(track)]),
        bounds=bounds,
        modules=(),
        joins={},
        enclosure=drivable,
        track=track,
    )


def _compiled(
    spec: MapSpec, name: str, placed: list[PlacedModule], joins: dict[PortId, PortId]
) -> tuple[Map, list[PlacingProblem]]:
    statics, props, places = _statics(spec)
    obstructions = [part for part in placed if part.module.spec.type == "obstruction"]
    boxes = tuple(_box(obstruction) for obstruction in obstructions)
    bounds = _bounds(spec, placed, statics)
    labels = [*places, *(obstruction.label for obstruction in obstructions)]
    problems = [*_overlaps(placed, statics), *_wrong_names([*statics, *boxes], labels)]
    if spec.is_draft:  # a finished map may have such a barrier
        problems += blocked_lanes(placed, [(label, shape.plan) for label, shape in zip(places, statics, strict=True)])
    if max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > MAX_EXTENT:
        problems.append(_too_large(spec, placed, statics, places, bounds))
    drivable = _united([*(module.drivable for module in placed), *(s.geometry() for s in spec.paved)])
    lawns = [part.footprint for part in placed if part.module.spec.type == "terrain"]
    map_ = Map(
        name,
        spec.title,
        spec.ground,
        drivable,
        drivable_edges(drivable),
        statics,
        boxes,
        lawn=shapely.difference(shapely.union_all(lawns, grid_size=GRID), drivable, grid_size=GRID),
        markings=_markings(placed),
        props=props,
        bays=_bays(placed),
        lane_graph=_lane_graph(placed, joins),
        bounds=bounds,
        modules=tuple(placed),
        joins=joins,
        enclosure=_enclosure(spec, drivable),
        light_programs=spec.light_programs,
        stop_lines=tuple(stop_lines(placed, props, "traffic_light", "stop")),
        give_way_lines=tuple(stop_lines(placed, props, "give_way")),
    )
    problems += _wrong_programs(spec, map_.traffic_lights)
    return map_, problems


def _too_large(
    spec: MapSpec,
    placed: list[PlacedModule],
    statics: tuple[StaticShape, ...],
    places: list[PlaceInFile],
    bounds: tuple[float, float, float, float],
) -> PlacingProblem:
    """The problem of a map that is too large, with the place of what is farthest from its other parts."""
    x0, y0, x1, y1 = bounds
    axis = 0 if x1 - x0 > y1 - y0 else 1
    labels = [
        *(module.label for module in placed),
        *places,
        *(PlaceInFile("map", ("paved", i)) for i in range(len(spec.paved))),
    ]
    low, high = shapely.bounds(_contents(spec, placed, statics))[:, axis::2].T
    middle = np.median(low + high) / 2.0
    label = labels[int(np.argmax(np.maximum(high - middle, middle - low)))]
    size = f"{x1 - x0:.4g} m x {y1 - y0:.4g} m"
    return PlacingProblem(
        "extent", label, f": the map is {size}; it must be at most {MAX_EXTENT:g} m x {MAX_EXTENT:g} m"
    )


def _enclosure(spec: MapSpec, drivable: BaseGeometry) -> BaseGeometry | None:
    inside = shapely.union_all([wall.enclosed for wall in spec.walls])
    return None if inside.is_empty or not inside.covers(drivable) else inside


def _united(polygons: Sequence[BaseGeometry]) -> BaseGeometry:
    """The union, without gaps that come from rounding, for example between rotated modules."""
    wider = [polygon.buffer(GRID, join_style="mitre") for polygon in polygons if not polygon.is_empty]
    return shapely.set_precision(shapely.union_all(wider).buffer(-GRID, join_style="mitre"), GRID)


def _overlaps(placed: list[PlacedModule], statics: tuple[StaticShape, ...]) -> list[PlacingProblem]:
    """Flat modules must not overlap each other; boxes must not overlap boxes or static shapes."""
    flat = [part for part in placed if part.module.spec.type not in {"terrain", "obstruction"}]
    boxes = [part for part in placed if part.module.spec.type == "obstruction"]
    solid: list[Solid] = [(box.label, box.footprint, box.placement.z, box.placement.z + box.size[2]) for box in boxes]
    for shape in statics if boxes else ():
        low, high = shape.span
        solid.append((f"'{shape.name}'", shape.plan, low, high))
    return [
        *overlaps([(module.label, module.footprint, 0.0, 1.0) for module in flat], len(flat), "overlap"),
        *overlaps(solid, len(boxes)),
    ]


def _wrong_names(solids: Sequence[StaticShape | BoxPlacement], labels: Sequence[PlaceInFile]) -> list[PlacingProblem]:
    """Solid objects are identified by name, so each name must be unique. `labels` say where they are."""
    places: dict[str, list[PlaceInFile]] = {}
    for solid, label in zip(solids, labels, strict=True):
        places.setdefault(solid.name, []).append(label)
    problems = [
        PlacingProblem("name", places[name][0], f": the name '{name}' is reserved; choose another one")
        for name in RESERVED
        if name in places
    ]
    return problems + [
        PlacingProblem(
            "name", where[1], f": the name '{name}' is used by {len(where)} solid objects; names must be unique"
        )
        for name, where in places.items()
        if len(where) > 1
    ]


def _wrong_programs(spec: MapSpec, lights: list[str]) -> list[PlacingProblem]:
    problems = [
        PlacingProblem("name", PlaceInFile("map", ("light_programs", name)), f": {text}")
        for name, text in program_problems(spec.light_programs, lights)
    ]
    if len(lights) > MAX_LIGHTS:
        text = f": the map has {len(lights)} traffic lights; at most {MAX_LIGHTS} are possible"
        problems.append(PlacingProblem("field", PlaceInFile("map", ("props",)), text))
    return problems


def _box(obstruction: PlacedModule) -> BoxPlacement:
    own = obstruction.placement
    mass = own.mass or obstruction.module.spec.mass
    assert mass is not None
    return BoxPlacement(
        obstruction.name, obstruction.size, mass, (own.x, own.y, own.z + obstruction.size[2] / 2.0), own.pose[2]
    )


def _statics(spec: MapSpec) -> tuple[tuple[StaticShape, ...], tuple[Prop, ...], list[PlaceInFile]]:
    """The fixed solids, the signs and lights, and where each of the solids is in the file."""
    props = tuple(Prop(prop.name or f"{prop.kind}_{i}", prop.kind, prop.pose) for i, prop in enumerate(spec.props, 1))
    solids = [("walls", i, shape) for i, wall in enumerate(spec.walls) for shape in wall_shapes(wall)]
    solids += [("blocks", i, block_shape(block, block.name or f"block_{i + 1}")) for i, block in enumerate(spec.blocks)]
    solids += [("props", i, shape) for i, prop in enumerate(props) for shape in prop_shapes(prop)]
    return tuple(shape for _, _, shape in solids), props, [PlaceInFile("map", (key, i)) for key, i, _ in solids]


def _markings(placed: list[PlacedModule]) -> tuple[Marking, ...]:
    return tuple(
        Marking(kind, geometry)
        for part in placed
        for (kind, _), geometry in zip(part.module.markings, part.markings, strict=True)
    )


def _bays(placed: list[PlacedModule]) -> tuple[ParkingBay, ...]:
    bays = []
    for part in placed:
        x0, y0, yaw = part.placement.pose
        for bay in part.module.spec.bays:
            x = x0 + math.cos(yaw) * bay.x - math.sin(yaw) * bay.y
            y = y0 + math.sin(yaw) * bay.x + math.cos(yaw) * bay.y
            bays.append(
                ParkingBay(f"{part.name}.{bay.name}", (x, y, yaw + bay.yaw_deg * DEGREE), bay.length, bay.width)
            )
    return tuple(bays)


def _lane_graph(placed: list[PlacedModule], joins: dict[PortId, PortId]) -> LaneGraph:
    """The graph of the lanes: lanes that leave a port end where the lanes of the connected port start."""
    pieces: list[Piece] = []
    for i, part in enumerate(placed):
        for (port_in, port_out), points in zip(part.module.spec.lanes, part.lanes, strict=True):
            (entry, in_), (exit_, out) = lane_end(port_in), lane_end(port_out)
            met = joins.get((i, exit_))
            end = ("in", met, out) if met else ("out", (i, exit_), out)
            pieces.append(Piece(f"{part.name}:{port_in}>{port_out}", points, ("in", (i, entry), in_), end))
    return lane_graph(pieces)


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
    outlines = [module.footprint for module in placed] + [shape.plan for shape in statics]
    return np.array([*outlines, *(shape.geometry() for shape in spec.paved)], dtype=object)
