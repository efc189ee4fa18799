"""The edit that inserts a module where two others are joined: the road is opened there, and closed again."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, TypeAlias

import msgspec
import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from autodrive.base.errors import CommandError
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import EditMap, InsertModule, MapModule, MapPart, MapProp
from autodrive.scenario.maps.closing import GAP, closing_chain
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.module import ModuleSpec, Port
from autodrive.scenario.maps.placing import PlacedModule, PlacedPort, PortId
from autodrive.scenario.maps.shapes import Pose, moved
from autodrive.scenario.maps.spec import Placement
from autodrive.world.editing.closing import footprint, known_modules, named_parts, placement_at, ports_fit
from autodrive.world.editing.map_edits import own_map, parts_of

if TYPE_CHECKING:
    from autodrive.world import World

MAX_CHAINS = 6
"""Chains that are searched to close the road again: each search can cost half a second."""
MAX_REMOVED = 4
"""Roads behind the new module that may be replaced by others."""
SIGN_DISTANCE = 0.3
"""A sign or traffic light so near to a road that is moved is moved with it [m]."""

Motion: TypeAlias = tuple[float, float, float]
"""A point p becomes the point p, turned about the origin by the third value [rad], plus the first two [m]."""


@dataclass(frozen=True)
class _Joint:
    """Two joined ports of modules of the map."""

    before: PortId
    after: PortId


@dataclass(frozen=True)
class _Insertion:
    """How a module is inserted."""

    new: tuple[Placement, ...]
    """The module and the roads that close the road again."""
    motion: Motion = (0.0, 0.0, 0.0)
    moved: frozenset[int] = frozenset()
    """Indices of the modules of the map that are moved."""
    removed: frozenset[int] = frozenset()


def inserting_edit(world: World, edit: InsertModule) -> EditMap:
    """The parts of the map after a module was inserted. Raises `CommandError` if it cannot be inserted there."""
    own_map(world.specs)
    modules = known_modules(world)
    if edit.module not in modules:
        raise CommandError(f"module '{edit.module}' is not known. {suggest(edit.module, sorted(modules))}")
    joint = _joint(world.map, edit)
    insertion = next(_insertions(world.map, joint, edit, modules), None)
    if insertion is None:
        raise CommandError(
            f"{modules[edit.module].title} cannot be inserted there: the road is closed, and no pieces close it again "
            "once it is opened there. Delete a piece of the road first, or insert it in another place"
        )
    parts: dict[str, MapPart | None] = {}
    there = parts_of(own_map(world.specs))
    for i in insertion.removed:
        parts[world.map.modules[i].name] = None
    for i in insertion.moved:
        name = world.map.modules[i].name
        parts[name] = _moved_part(there[name], insertion.motion)
    for name in _signs(world.map, there, insertion.moved):
        parts[name] = _moved_part(there[name], insertion.motion)
    return EditMap(parts | dict(named_parts(world, insertion.new)))


def _joint(map_: Map, edit: InsertModule) -> _Joint:
    names = [placed.name for placed in map_.modules]
    if edit.part not in names:
        raise CommandError(f"'{edit.part}' is not a module of the map. {suggest(edit.part, names)}")
    before = names.index(edit.part), edit.port
    if before not in map_.joins:
        raise CommandError(f"port '{edit.port}' of '{edit.part}' is not joined with another one")
    return _Joint(before, map_.joins[before])


def _insertions(
    map_: Map, joint: _Joint, edit: InsertModule, modules: Mapping[str, ModuleSpec]
) -> Iterator[_Insertion]:
    """Ways to insert a module at a joint, the one that changes least first."""
    before, after = (_port(map_, port) for port in (joint.before, joint.after))
    spec = modules[edit.module]
    if edit.entry and edit.entry not in spec.ports:
        raise CommandError(f"{spec.title} has no port '{edit.entry}'. {suggest(edit.entry, sorted(spec.ports))}")
    entries = [port for port in _fitting(spec, before) if edit.entry in ("", _name_of(spec, port))]
    ways = [(entry, leave) for entry in entries for leave in _fitting(spec, after) if leave is not entry]
    if not ways:
        raise CommandError(f"{spec.title} has no two ends as wide as this road: it cannot be inserted")
    ways.sort(key=lambda way: math.cos(math.radians(way[0].yaw_deg - way[1].yaw_deg)))  # straight on first
    placed = [(placement_at(edit.module, entry, before.pose), leave) for entry, leave in ways]
    for placement, leave in placed:
        yield from _shifted(map_, joint, placement, leave, modules)
    for placement, leave in placed:
        yield from _replacing(map_, joint, placement, leave, modules)


def _fitting(spec: ModuleSpec, port: PlacedPort) -> list[Port]:
    return [each for each in spec.ports.values() if not each.is_blind and ports_fit(each, port)]


def _name_of(spec: ModuleSpec, port: Port) -> str:
    return next(name for name, each in spec.ports.items() if each is port)


def _port(map_: Map, port: PortId) -> PlacedPort:
    return next(each for each in map_.modules[port[0]].ports if each.name == port[1])


# -- the road behind the module is moved -------------------------------------------------------------------------


def _shifted(
    map_: Map, joint: _Joint, placement: Placement, leave: Port, modules: Mapping[str, ModuleSpec]
) -> Iterator[_Insertion]:
    """The road behind the joint is moved; a closed road is opened at a second joint, where other roads close it."""
    after = _port(map_, joint.after)
    x, y = moved(np.array([[leave.x, leave.y]]), placement.pose)[0].tolist()
    motion = _motion(after.pose, (x, y, placement.pose[2] + math.radians(leave.yaw_deg) + math.pi))
    behind = _connected(map_, joint.after[0], {joint})
    if joint.before[0] not in behind:
        if _is_free(map_, behind, frozenset(), motion, [footprint(placement, modules)]):
            yield _Insertion((placement,), motion, behind)
        return
    for second, part in islice(_second_joints(map_, joint, motion), MAX_CHAINS):
        if not _is_free(map_, part, frozenset(), motion, [footprint(placement, modules)]):
            continue
        solids = [*_solids(map_, part, frozenset(), motion), footprint(placement, modules)]
        start = _port(map_, second.before)
        start = replace(start, pose=_pose_after(start.pose, motion))
        chain = closing_chain(start, _port(map_, second.after), modules, solids).placements
        if chain:
            yield _Insertion((placement, *chain), motion, part)


def _second_joints(map_: Map, joint: _Joint, motion: Motion) -> list[tuple[_Joint, frozenset[int]]]:
    """Joints that, with the first one, divide the closed road, and the modules between them; the best ones first.

    The best ones are those at which the road leads back against the motion, then those that divide it evenly.
    """
    all_ = _connected(map_, joint.after[0], set())
    way = math.atan2(*_step(map_, all_, motion)[::-1])
    candidates = []
    for before, after in map_.joins.items():
        second = _Joint(before, after)
        if before[0] not in all_ or {before, after} == {joint.before, joint.after}:
            continue
        part = _connected(map_, joint.after[0], {joint, second})
        if before[0] in part and after[0] not in part and joint.before[0] not in part:
            against = math.cos(_port(map_, before).pose[2] - way)
            candidates.append(((round(against, 3), abs(2 * len(part) - len(all_))), second, part))
    candidates.sort(key=lambda candidate: candidate[0])
    return [(second, part) for _, second, part in candidates]


def _step(map_: Map, part: frozenset[int], motion: Motion) -> tuple[float, float]:
    """How far the middle of some modules is moved [m]."""
    middle = np.mean([map_.modules[i].placement.pose[:2] for i in part], axis=0)
    dx, dy = moved(middle[None], motion)[0] - middle
    return float(dx), float(dy)


def _connected(map_: Map, start: int, opened: set[_Joint]) -> frozenset[int]:
    """Modules that are connected with one, not through the joints that are opened."""
    cut = {port for joint in opened for port in (joint.before, joint.after)}
    neighbours: dict[int, list[int]] = {}
    for (i, name), (j, _) in map_.joins.items():
        if (i, name) not in cut:
            neighbours.setdefault(i, []).append(j)
    reached, waiting = {start}, [start]
    while waiting:
        new = {*neighbours.get(waiting.pop(), ())} - reached
        reached |= new
        waiting += new
    return frozenset(reached)


# -- roads behind the module are replaced ------------------------------------------------------------------------


def _replacing(
    map_: Map, joint: _Joint, placement: Placement, leave: Port, modules: Mapping[str, ModuleSpec]
) -> Iterator[_Insertion]:
    """Some roads behind the joint are replaced by others, so that the rest of the map stays where it is."""
    removed: frozenset[int] = frozenset()
    x, y = moved(np.array([[leave.x, leave.y]]), placement.pose)[0].tolist()
    start = replace(_port(map_, joint.after), pose=(x, y, placement.pose[2] + math.radians(leave.yaw_deg)))
    port = joint.after
    for _ in range(MAX_REMOVED):
        module = map_.modules[port[0]]
        others = [each.name for each in module.ports if not each.is_blind and each.name != port[1]]
        if module.module.spec.type != "road" or len(others) != 1 or (port[0], others[0]) not in map_.joins:
            return
        removed |= {port[0]}
        port = map_.joins[port[0], others[0]]
        if port[0] in removed or port[0] == joint.before[0]:
            return
        own = footprint(placement, modules)
        if not _is_free(map_, frozenset(), removed, (0.0, 0.0, 0.0), [own]):
            continue
        end = _port(map_, port)
        if math.hypot(end.pose[0] - start.pose[0], end.pose[1] - start.pose[1]) < GAP:
            is_facing = math.cos(end.pose[2] - start.pose[2]) < -1.0 + 1e-6
            if is_facing:
                yield _Insertion((placement,), removed=removed)
            continue
        solids = [*_solids(map_, frozenset(), removed, (0.0, 0.0, 0.0)), own]
        chain = closing_chain(start, end, modules, solids).placements
        if chain:
            yield _Insertion((placement, *chain), removed=removed)


# -- motions -----------------------------------------------------------------------------------------------------


def _motion(start: Pose, end: Pose) -> Motion:
    """The motion that brings a pose to another one."""
    turn = end[2] - start[2]
    x, y = moved(np.array([start[:2]]), (0.0, 0.0, turn))[0].tolist()
    return end[0] - x, end[1] - y, turn


def _pose_after(pose: Pose, motion: Motion) -> Pose:
    x, y = moved(np.array([pose[:2]]), motion)[0].tolist()
    return x, y, pose[2] + motion[2]


def _moved_part(part: MapPart, motion: Motion) -> MapPart:
    assert isinstance(part, MapModule | MapProp)
    x, y, yaw = _pose_after((part.x, part.y, part.yaw), motion)
    return msgspec.structs.replace(part, x=x, y=y, yaw=math.remainder(yaw, 2.0 * math.pi))


def _is_road(placed: PlacedModule) -> bool:
    return placed.module.spec.type not in {"terrain", "obstruction"}


def _solids(map_: Map, part: frozenset[int], removed: frozenset[int], motion: Motion) -> list[BaseGeometry]:
    """What new roads must not overlap, if some modules are moved and some are removed."""
    roads: list[BaseGeometry] = [
        shapely.transform(placed.footprint, lambda at: moved(at, motion)) if i in part else placed.footprint
        for i, placed in enumerate(map_.modules)
        if _is_road(placed) and i not in removed
    ]
    return roads + [static.plan for static in map_.statics]


def _is_free(
    map_: Map, part: frozenset[int], removed: frozenset[int], motion: Motion, new: Sequence[BaseGeometry]
) -> bool:
    """Whether the modules that are moved and the new ones overlap no other road, and no wall or block."""
    modules = map_.modules
    rest = [each.footprint for i, each in enumerate(modules) if _is_road(each) and i not in part and i not in removed]
    brought = [shapely.transform(modules[i].footprint, lambda at: moved(at, motion)) for i in part]
    tree = shapely.STRtree(rest)
    inner = [shape.buffer(-GAP) for shape in (*brought, *new)]
    if rest and len(tree.query(inner, predicate="intersects")[0]):
        return False
    # posts of signs are not checked: those at the roads that are moved are moved with them
    walls = [static.plan for static in map_.statics if static.material in {"wall", "block"}]
    if any(own.buffer(-GAP).intersects(other) for own in new for other in brought):
        return False
    return not any(own.intersects(wall) for own in inner for wall in walls)


def _signs(map_: Map, parts: Mapping[str, MapPart], part: frozenset[int]) -> Iterator[str]:
    """Names of the signs and traffic lights at the roads that are moved."""
    roads = [(i in part, placed.footprint) for i, placed in enumerate(map_.modules) if _is_road(placed)]
    if not part:
        return
    for name, prop in parts.items():
        if isinstance(prop, MapProp):
            at = shapely.Point(prop.x, prop.y)
            distance, is_moved = min((road.distance(at), is_moved) for is_moved, road in roads)
            if is_moved and distance < SIGN_DISTANCE:
                yield name
