"""The edit that closes a road between two open ends of the map of a World."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from autodrive.base.errors import CommandError
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import CloseLoop, EditMap, MapModule, MapPart
from autodrive.scenario import kinds
from autodrive.scenario.files import read_module
from autodrive.scenario.maps.closing import closing_chain
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.placing import PORT_TOLERANCE, PlacedPort
from autodrive.scenario.maps.spec import Placement
from autodrive.world.editing.map_edits import own_map, parts_of

if TYPE_CHECKING:
    from autodrive.world import World

MAX_PAIRS = 3
"""Pairs of ends that are tried, the nearest ones first: each can cost half a second."""

End: TypeAlias = tuple[str, PlacedPort]
"""An open end: name of its module, and port."""


def closing_edit(world: World, edit: CloseLoop) -> EditMap:
    """The modules that connect two open ends. Raises `CommandError` if there are no such ends or no such modules."""
    own_map(world.specs)
    pairs = sorted(_pairs(world, edit), key=lambda pair: (_distance(*pair), pair[0][0], pair[1][0]))
    solids = [
        placed.footprint for placed in world.map.modules if placed.module.spec.type not in {"terrain", "obstruction"}
    ]
    solids += [static.plan for static in world.map.statics]
    modules = _modules(world)
    misses: list[tuple[End, End, tuple[float, float]]] = []
    for start, end in pairs[:MAX_PAIRS]:
        chain = closing_chain(start[1], end[1], modules, solids)
        if chain.placements:
            return EditMap(dict(_named(world, chain.placements)))
        if chain.miss:
            misses.append((start, end, chain.miss))
    raise CommandError(_why_not(pairs, misses))


def _pairs(world: World, edit: CloseLoop) -> Iterator[tuple[End, End]]:
    starts = list(_ends(world, edit.part, edit.port))
    ends = list(_ends(world, edit.other, edit.other_port)) if edit.other else list(_ends(world))
    widths_fit = False
    for start in starts:
        for end in ends:
            if (start[0], start[1].name) == (end[0], end[1].name):
                continue
            (_, a), (_, b) = start, end
            if abs(a.width - b.width) <= PORT_TOLERANCE and a.lanes == b.lanes:
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


def _modules(world: World) -> dict[str, ModuleSpec]:
    """All modules that can be placed: those of the simulator and those of the map."""
    described = {name: read_module(name) for name in kinds.names("module")}
    folder = Path(world.specs.map.path).parent.absolute()
    own = {
        str(folder / name) if name.endswith(".yaml") else name: module
        for name, module in world.specs.map.modules.items()
    }
    return {name: module.spec_or_none for name, module in (described | own).items() if module.spec_or_none}


def _named(world: World, placements: tuple[Placement, ...]) -> Iterator[tuple[str, MapPart]]:
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
