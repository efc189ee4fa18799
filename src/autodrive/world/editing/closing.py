"""The edits that close a road between two open ends of the map of a World, and that close all open ends."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from shapely.geometry.base import BaseGeometry

from autodrive.base.errors import CommandError
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import CloseLoop, EditMap, MapModule, MapPart
from autodrive.scenario import kinds
from autodrive.scenario.files import read_module
from autodrive.scenario.maps.closing import GAP, closing_chain
from autodrive.scenario.maps.module import ModuleSpec, Port
from autodrive.scenario.maps.placing import PORT_TOLERANCE, PlacedPort
from autodrive.scenario.maps.shapes import Pose, moved, rectangle
from autodrive.scenario.maps.spec import Placement
from autodrive.world.editing.map_edits import own_map, parts_of

if TYPE_CHECKING:
    from autodrive.world import World

MAX_PAIRS = 3
"""Pairs of ends that are tried, the nearest ones first: each can cost half a second."""
MAX_MISSES = 6
"""Pairs without a chain after which the remaining ends get no roads, if all ends are closed."""

End: TypeAlias = tuple[str, PlacedPort]
"""An open end: name of its module, and port."""


def closing_edit(world: World, edit: CloseLoop) -> EditMap:
    """The modules that connect two open ends, or that close all of them if the edit names no part.

    Raises `CommandError` if there are no such ends or no such modules.
    """
    own_map(world.specs)
    if not edit.part:
        return EditMap(dict(named_parts(world, _closing_all(world))))
    pairs = sorted(_pairs(world, edit), key=lambda pair: (_distance(*pair), pair[0][0], pair[1][0]))
    solids, modules = solids_of(world), known_modules(world)
    misses: list[tuple[End, End, tuple[float, float]]] = []
    for start, end in pairs[:MAX_PAIRS]:
        chain = closing_chain(start[1], end[1], modules, solids)
        if chain.placements:
            return EditMap(dict(named_parts(world, chain.placements)))
        if chain.miss:
            misses.append((start, end, chain.miss))
    raise CommandError(_why_not(pairs, misses))


def _closing_all(world: World) -> tuple[Placement, ...]:
    """Roads between open ends, the nearest ends first, then the end of a road where no chain of roads leads on."""
    ends, modules, solids = list(_ends(world)), known_modules(world), solids_of(world)
    if not ends:
        raise CommandError("the map has no open end")
    pairs = [(a, b) for i, a in enumerate(ends) for b in ends[i + 1 :] if ports_fit(a[1], b[1])]
    placements: list[Placement] = []
    closed: set[tuple[str, str]] = set()
    misses = 0
    for start, end in sorted(pairs, key=lambda pair: (_distance(*pair), pair[0][0], pair[1][0])):
        if misses == MAX_MISSES:
            break
        if closed & {_key(start), _key(end)}:
            continue
        chain = closing_chain(start[1], end[1], modules, solids).placements
        misses += not chain
        placements += chain
        solids += [footprint(placement, modules) for placement in chain]
        closed |= {_key(start), _key(end)} if chain else set()
    for end in ends:
        last = None if _key(end) in closed else _road_end(end[1], modules, solids)
        if last:
            placements.append(last)
            solids.append(footprint(last, modules))
    if not placements:
        raise CommandError("no roads fit at the open ends: make room there, or let the ends stay open")
    return tuple(placements)


def _road_end(port: PlacedPort, modules: Mapping[str, ModuleSpec], solids: Sequence[BaseGeometry]) -> Placement | None:
    """A road with one port, such as a dead end, which is joined to a port; None if none fits there."""
    for name, spec in sorted(modules.items()):
        ports = [each for each in spec.ports.values() if not each.is_blind]
        if spec.type != "road" or len(ports) != 1 or not ports_fit(ports[0], port):
            continue
        placement = placement_at(name, ports[0], port.pose)
        inner = footprint(placement, modules).buffer(-GAP)
        if not any(inner.intersects(solid) for solid in solids):
            return placement
    return None


def placement_at(module: str, port: Port, pose: Pose) -> Placement:
    """A module whose port meets another one, which has that pose in the map (outward)."""
    yaw = pose[2] + math.pi - math.radians(port.yaw_deg)
    x, y = moved(np.array([[-port.x, -port.y]]), (*pose[:2], yaw))[0].tolist()
    yaw_deg = round(math.degrees(math.remainder(yaw, 2.0 * math.pi)), 6)
    return Placement(module=module, x=round(x, 6), y=round(y, 6), yaw_deg=yaw_deg)


def footprint(placement: Placement, modules: Mapping[str, ModuleSpec]) -> BaseGeometry:
    """The rectangle around a module that is not in the map yet, in the map."""
    spec = modules[placement.module]
    return rectangle(placement.pose, spec.length, spec.width)


def solids_of(world: World) -> list[BaseGeometry]:
    """What new roads must not overlap, in the map."""
    roads: list[BaseGeometry] = [
        placed.footprint for placed in world.map.modules if placed.module.spec.type not in {"terrain", "obstruction"}
    ]
    return roads + [static.plan for static in world.map.statics]


def _key(end: End) -> tuple[str, str]:
    return end[0], end[1].name


def ports_fit(a: Port | PlacedPort, b: Port | PlacedPort) -> bool:
    """Whether ports can be joined: same width and number of lanes."""
    return abs(a.width - b.width) <= PORT_TOLERANCE and a.lanes == b.lanes


def _pairs(world: World, edit: CloseLoop) -> Iterator[tuple[End, End]]:
    starts = list(_ends(world, edit.part, edit.port))
    ends = list(_ends(world, edit.other, edit.other_port)) if edit.other else list(_ends(world))
    widths_fit = False
    for start in starts:
        for end in ends:
            if _key(start) != _key(end) and ports_fit(start[1], end[1]):
                widths_fit = True
                yield start, end
    if not widths_fit:
        raise CommandError("there is no other open end of that width in the map")


def _ends(world: World, part: str = "", port: str = "") -> Iterator[End]:
    """The open ends of a module, or of all modules; those that may stay open only if the module is named."""
    modules = world.map.modules
    names = [placed.name for placed in modules]
    if part and part not in names:
        raise CommandError(f"'{part}' is not a module of the map. {suggest(part, names)}")
    has_end = False
    for i, placed in enumerate(modules):
        for end in placed.ports if part in ("", placed.name) else ():
            is_joined = end.is_blind or (i, end.name) in world.map.joins
            if not is_joined and port in ("", end.name) and (part or not end.is_open):
                has_end = True
                yield placed.name, end
    if part and not has_end:
        raise CommandError(f"'{part}' has no open end" + (f" '{port}'" if port else ""))


def known_modules(world: World) -> dict[str, ModuleSpec]:
    """All modules that can be placed: those of the simulator and those of the map."""
    described = {name: read_module(name) for name in kinds.names("module")}
    folder = Path(world.specs.map.path).parent.absolute()
    own = {
        str(folder / name) if name.endswith(".yaml") else name: module
        for name, module in world.specs.map.modules.items()
    }
    return {name: module.spec_or_none for name, module in (described | own).items() if module.spec_or_none}


def named_parts(world: World, placements: Iterable[Placement]) -> Iterator[tuple[str, MapPart]]:
    """Placements as parts of the map, with names that are free."""
    used = {*parts_of(own_map(world.specs)), *world.boxes, *world.spec.vehicles}
    for placement in placements:
        stem = Path(placement.module).stem
        name = next(name for number in count(1) if (name := f"{stem}_{number}") not in used)
        used.add(name)
        yield name, MapModule(placement.module, placement.x, placement.y, math.radians(placement.yaw_deg))


def _distance(start: End, end: End) -> float:
    return math.hypot(start[1].pose[0] - end[1].pose[0], start[1].pose[1] - end[1].pose[1])


def _why_not(pairs: list[tuple[End, End]], misses: list[tuple[End, End, tuple[float, float]]]) -> str:
    (part, port), (other, other_port) = pairs[0]
    text = f"no chain of roads leads from port '{port.name}' of '{part}' to port '{other_port.name}' of '{other}'"
    if len(pairs) > 1:
        text += " or to another open end"
    near = min(misses, key=lambda miss: math.hypot(*miss[2]), default=None)
    if near is None or not PORT_TOLERANCE < math.hypot(*near[2]) < 0.5 * near[0][1].width:
        return f"{text}. Move '{part}' or '{other}', or the parts between '{part}' and '{other}'"
    (_, _), (name, _), (dx, dy) = near
    return f"{text}. Move '{name}' and the modules that are connected with '{name}' by ({dx:.4g}, {dy:.4g}) m"
