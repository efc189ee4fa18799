"""The map of a World as clients edit it: parts, ports, problems with repairs, and the modules that can be placed."""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Literal, get_args

from msgspec.structs import replace

from autodrive.base.specs import Described, PlaceInFile, joined
from autodrive.base.units import DEGREE
from autodrive.protocol import native
from autodrive.protocol.messages import MapModule, MapPart
from autodrive.protocol.native import MapPort, MapScene, ModuleScene
from autodrive.scenario import kinds
from autodrive.scenario.files import map_titles, read_map, read_module
from autodrive.scenario.maps.draw import to_svg
from autodrive.scenario.maps.icons import icon
from autodrive.scenario.maps.map import Map, compile_map
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.placing import PlacingProblem
from autodrive.scenario.maps.props import PropKind
from autodrive.scenario.maps.spec import MapSpec, Placement
from autodrive.world.editing.map_advice import map_advice
from autodrive.world.editing.map_edits import name_of_entry, own_map, parts_of

if TYPE_CHECKING:
    from autodrive.world import World


def map_scene(world: World, add: Callable[[str, bytes], str]) -> MapScene | None:
    """The map of a World; None for a race track. `add` takes name and content of a file and returns its address."""
    if not isinstance(world.specs.map.spec_or_none, MapSpec):
        return None
    spec = own_map(world.specs)
    parts = {name: part for name, part in parts_of(spec).items() if name not in world.spec.removed_boxes}
    problems = world.compiled.map_problems
    wrong = {key for problem in problems for key in _ports_of(problem) if problem.other_port}
    own = {placement.module: world.specs.map.modules.get(placement.module) for placement in spec.placements}
    modules = {name: read_module(name) for name in kinds.names("module")}
    modules |= {name: described or read_module(name) for name, described in own.items()}
    props = list(_kinds())
    return MapScene(
        parts=parts,
        ports=_ports(world.map, wrong),
        problems=[_problem(problem, world.map, spec, parts) for problem in problems],
        modules={
            name: _module(name, described, add) for name, described in sorted(modules.items()) if described.spec_or_none
        },
        props=[*props],
        templates=map_titles(),
        advice=map_advice(world),
        faces={kind: _face(kind, add) for kind in props},
    )


def _kinds() -> Iterator[PropKind]:
    for kind in get_args(PropKind):
        yield from get_args(kind) or (kind,)


def _face(kind: PropKind, add: Callable[[str, bytes], str]) -> str:
    """Address of the face of a sign or traffic light."""
    view = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="-.55 -.55 1.1 1.1" width="110" height="110">'
    svg = f'{view}<g transform="scale(1 -1)">{icon(kind)}</g></svg>'.encode()
    return add(f"face-{hashlib.sha256(svg).hexdigest()[:16]}.svg", svg)


def _ports_of(problem: PlacingProblem) -> list[tuple[int, str]]:
    """Index of the placement and name of each port that a problem concerns."""
    pairs = ((problem.part, problem.port), (problem.other, problem.other_port))
    return [(int(part.location[1]), port.name) for part, port in pairs if port and isinstance(part, PlaceInFile)]


def _ports(map_: Map, wrong: set[tuple[int, str]]) -> dict[str, dict[str, MapPort]]:
    def state(i: int, name: str, *, is_open: bool) -> Literal["joined", "open", "free", "wrong"]:
        if (i, name) in map_.joins:
            return "joined"
        if (map_.modules[i].label.location[1], name) in wrong:
            return "wrong"
        return "open" if is_open else "free"

    return {
        placed.name: {
            port.name: MapPort(*port.pose, port.width, state(i, port.name, is_open=port.is_open))
            for port in placed.ports
            if not port.is_blind
        }
        for i, placed in enumerate(map_.modules)
        if placed.ports
    }


def _problem(problem: PlacingProblem, map_: Map, spec: MapSpec, parts: dict[str, MapPart]) -> native.MapProblem:
    places = [part.location for part in (problem.part, problem.other) if isinstance(part, PlaceInFile)]
    names = [name_of_entry(getattr(spec, str(key))[index], int(index) + 1) for key, index in places]
    x = y = 0.0
    if problem.port:
        x, y, _ = problem.port.pose
    elif problem.at:
        x, y = problem.at
    elif len(places) == 2:
        by_index = {placed.label.location: placed.footprint for placed in map_.modules}
        common = by_index[places[0]].intersection(by_index[places[1]]).centroid
        x, y = common.x, common.y
    text = joined([problem.text], {})[0]
    repaired = _repaired(problem, parts.get(names[-1])) if names else None
    return native.MapProblem(problem.kind, text, x, y, names, {names[-1]: repaired} if repaired else {})


def _repaired(problem: PlacingProblem, part: MapPart | None) -> MapModule | None:
    """The last module of a problem, so that the problem is solved; None if it is not known how."""
    if not isinstance(part, MapModule) or problem.port is None:
        return None
    if problem.kind == "unconnected":
        return replace(part, open=(*(part.open or ()), problem.port.name)) if part.open is not True else None
    if problem.kind == "apart":
        return replace(part, x=part.x + problem.dx, y=part.y + problem.dy)
    if problem.kind == "turned" and problem.other_port:
        x, y, _ = problem.other_port.pose
        c, s = math.cos(problem.turn), math.sin(problem.turn)
        dx, dy = part.x - x, part.y - y
        return replace(part, x=x + c * dx - s * dy, y=y + s * dx + c * dy, yaw=part.yaw + problem.turn)
    return None


def _module(name: str, described: Described[ModuleSpec], add: Callable[[str, bytes], str]) -> ModuleScene:
    spec = described.spec
    svg = _drawing(name, described)
    ports = {
        port_name: MapPort(port.x, port.y, port.yaw_deg * DEGREE, port.width)
        for port_name, port in spec.ports.items()
        if not port.is_blind
    }
    address = add(f"module-{hashlib.sha256(svg).hexdigest()[:16]}.svg", svg)
    return ModuleScene(spec.title, spec.type, spec.length, spec.width, address, ports)


@functools.lru_cache(maxsize=256)
def _drawing(name: str, described: Described[ModuleSpec]) -> bytes:
    alone = Placement(module=name, x=0.0, y=0.0, open=bool(described.spec.ports))
    map_, _ = compile_map(read_map(MapSpec(title=name, placements=(alone,)), known={name: described})[0])
    assert map_ is not None
    return to_svg(map_, pixels_per_metre=100.0).encode()
