"""Applies an edit to the map of a scenario: its modules, walls, blocks, signs and traffic lights."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec

from autodrive.base import yaml_files
from autodrive.base.errors import CommandError
from autodrive.base.specs import checked, is_yaml, short
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import (
    EditMap,
    EditTrack,
    GenerateTrack,
    MapBlock,
    MapModule,
    MapPart,
    MapProp,
    MapWall,
    UseMap,
)
from autodrive.scenario import kinds
from autodrive.scenario.descriptions import Descriptions, Specs
from autodrive.scenario.files import described, module_of, read_map
from autodrive.scenario.maps.props import PropSpec
from autodrive.scenario.maps.solids import BlockSpec, WallSpec
from autodrive.scenario.maps.spec import DescribedMap, MapSpec, Placement
from autodrive.scenario.scenario import VehiclePlacement, is_track, with_modules_at
from autodrive.scenario.tracks.track import TrackSpec
from autodrive.world.editing.track_edits import edited_track, name_of_track_edit

if TYPE_CHECKING:
    from autodrive.world import World

Entry: TypeAlias = Placement | WallSpec | BlockSpec | PropSpec
MapEdit: TypeAlias = EditMap | UseMap | EditTrack | GenerateTrack
KEYS: Mapping[type[MapPart], str] = {MapModule: "placements", MapWall: "walls", MapBlock: "blocks", MapProp: "props"}
"""The list of a MapSpec that contains parts of that type."""
NOUNS = {MapModule: "a module", MapWall: "a wall", MapBlock: "a block", MapProp: "a sign or traffic light"}


def edited_map(specs: Specs, edit: MapEdit) -> Specs:
    """The Specs after an edit of the map. Raises `AutodriveError`."""
    if isinstance(edit, EditTrack | GenerateTrack):
        return _with_track(specs, edited_track(specs, edit))
    if isinstance(edit, UseMap) and not edit.text:
        known = kinds.names("map")
        if edit.name not in known:
            raise CommandError(f"map '{short(edit.name)}' is not known. {suggest(edit.name, known)}")
        return _with_map(specs, edit.name, read_map(edit.name)[0])
    modules = specs.map.modules
    if specs.map.path:
        folder = Path(specs.map.path).parent.absolute()
        modules = {str(folder / name) if is_yaml(name) else name: module for name, module in modules.items()}
    if isinstance(edit, UseMap):
        source = yaml_files.Source(edit.text, "the text of the map")
        if is_track(source.tree):
            return _with_track(specs, yaml_files.checked_source(source, TrackSpec))
        spec = yaml_files.checked_source(source, MapSpec)
        modules = {**modules} | {name: module_of(name, text) for name, text in edit.modules.items()}
        _check_modules((placement.module for placement in spec.placements), modules)
        spec = checked({key: getattr(spec, key) for key in spec.model_fields_set} | {"is_draft": True}, MapSpec)
        return _with_map(specs, spec, read_map(spec, known=modules)[0])
    spec = own_map(specs)
    now = parts_of(spec)
    for name, part in edit.seen.items():
        if now.get(name) != part:
            raise CommandError(
                f"'{name}' was changed by another client in the meantime: check '{name}', then repeat the edit"
            )
    _check_modules((part.module for part in edit.parts.values() if isinstance(part, MapModule)), modules)
    spec = _changed(spec, edit.parts)
    return _with_map(specs, spec, read_map(spec, known=modules)[0])


def _check_modules(names: Iterable[str], of_map: Collection[str]) -> None:
    """Raises `CommandError` for a module that is neither of the simulator nor in the map: no other file is read."""
    known = sorted({*kinds.names("module"), *of_map})
    for name in names:
        if name not in known:
            raise CommandError(f"module '{short(name)}' is not known. {suggest(name, known)}")


def own_map(specs: Specs) -> MapSpec:
    """The MapSpec, with absolute paths of its modules. Raises `CommandError` for a race track."""
    spec = specs.map.spec_or_none
    if not isinstance(spec, MapSpec):
        raise CommandError(f"map '{specs.map.name}' is a race track: it has no parts that can be edited")
    return with_modules_at(spec, Path(specs.map.path).parent) if specs.map.path else spec


def saved_map(world: World, title: str = "") -> MapSpec | TrackSpec:
    """The map or track of a World for a file: a draft without problems is one no more."""
    spec = world.specs.map.spec if isinstance(world.specs.map.spec_or_none, TrackSpec) else own_map(world.specs)
    tree = {key: getattr(spec, key) for key in spec.model_fields_set} | ({"title": title} if title else {})
    if not world.compiled.map_problems:
        tree.pop("is_draft", None)
    return checked(tree, type(spec))


def parts_of(spec: MapSpec) -> dict[str, MapPart]:
    """The parts of a map, by name; of several parts with one name only the first."""
    parts: dict[str, MapPart] = {}
    for key in KEYS.values():
        for number, entry in enumerate(getattr(spec, key), 1):
            parts.setdefault(name_of_entry(entry, number), _part(entry))
    return parts


def name_of_entry(entry: Entry, number: int) -> str:
    """The name of a part; `number` in its list, from 1."""
    match entry:
        case Placement(module=module):
            return entry.name or f"{Path(module).stem}_{number}"
        case BlockSpec():
            return entry.name or f"block_{number}"
        case PropSpec(kind=kind):
            return entry.name or f"{kind}_{number}"
    return entry.name


def name_of_edit(edit: MapEdit, before: Specs) -> str:
    """The edit in a few words, for the button that undoes it."""
    if isinstance(edit, GenerateTrack):
        return f"use the random track {edit.seed}"
    if isinstance(edit, EditTrack):
        return name_of_track_edit(edit, before)
    if isinstance(edit, UseMap):
        return f"use the map {edit.name}" if edit.name else "open a map"
    there = parts_of(own_map(before))
    verb = "change"
    if not there.keys() & edit.parts.keys():
        verb = "add"
    elif not any(edit.parts.values()):
        verb = "remove"
    elif all(part and _is_moved(there.get(name), part) for name, part in edit.parts.items()):
        verb = "move"
    names = [*edit.parts]
    return f"{verb} {names[0]}" if len(names) == 1 else f"{verb} {len(names)} parts of the map"


def _is_moved(before: MapPart | None, part: MapPart) -> bool:
    """Whether only the pose differs."""
    if isinstance(before, MapWall) or isinstance(part, MapWall) or before is None:
        return False
    return msgspec.structs.replace(before, x=part.x, y=part.y, yaw=part.yaw) == part


def _with_track(specs: Specs, track: TrackSpec) -> Specs:
    """The Specs with that track as the map, on which the vehicles start behind its start line."""
    starts = {
        name: VehiclePlacement.model_validate(
            {key: getattr(placement, key) for key in placement.model_fields_set - {"x", "y", "yaw_deg"}}
        )
        for name, placement in specs.scenario.vehicles.items()
    }
    scenario = specs.scenario.model_copy(
        update={"map": track.model_copy(update={"is_draft": True}), "removed_boxes": (), "vehicles": starts}
    )
    return described(scenario, known=Descriptions(specs)).specs


def _with_map(specs: Specs, map_: str | MapSpec, described: DescribedMap) -> Specs:
    boxes = parts_of(described.spec_or_none) if isinstance(described.spec_or_none, MapSpec) else {}
    removed = tuple(name for name in specs.scenario.removed_boxes if name in boxes)
    scenario = specs.scenario.model_copy(update={"map": map_, "removed_boxes": removed})
    return replace(specs, scenario=scenario, map=described)


def _changed(spec: MapSpec, parts: Mapping[str, MapPart | None]) -> MapSpec:
    """Parts that are not named keep their place in the file and their names."""
    left = dict(parts)
    lists: dict[str, list[Any]] = {}
    for kind, key in KEYS.items():
        entries = lists.setdefault(key, [])
        present: tuple[Entry, ...] = getattr(spec, key)
        for number, entry in enumerate(present, 1):
            name = name_of_entry(entry, number)
            if name not in left:
                is_shifted = number > len(entries) + 1  # another one was removed before it
                entries.append(entry.model_copy(update={"name": name}) if is_shifted else entry)
                continue
            part = left.pop(name)
            if isinstance(part, kind):
                entries.append(_entry(name, part))
            elif part is not None:
                raise CommandError(f"'{name}' is {NOUNS[kind]}; it cannot become {NOUNS[type(part)]}")
    for name, part in left.items():
        if part is None:
            raise CommandError(f"'{name}' is not in the map. {suggest(name, list(parts_of(spec)))}")
        lists[KEYS[type(part)]].append(_entry(name, part))
    kept = {key: getattr(spec, key) for key in spec.model_fields_set} | {"is_draft": True}
    if spec.light_programs:
        gone = {name for name, part in parts.items() if part is None}
        kept["light_programs"] = {name: program.without(gone) for name, program in spec.light_programs.items()}
    return checked(kept | {key: entries for key, entries in lists.items() if entries or key in kept}, MapSpec)


def _part(entry: Entry) -> MapPart:
    match entry:
        case Placement():
            own = entry.open, entry.length, entry.width, entry.height, entry.z, entry.mass
            return MapModule(entry.module, entry.x, entry.y, _yaw(entry), *own)
        case WallSpec():
            return MapWall(entry.points, entry.height, entry.thickness, entry.is_closed)
        case BlockSpec():
            return MapBlock(entry.x, entry.y, entry.length, entry.width, entry.height, _yaw(entry))
    return MapProp(entry.kind, entry.x, entry.y, _yaw(entry))


def _yaw(entry: Placement | BlockSpec | PropSpec) -> float:
    return math.radians(math.remainder(entry.yaw_deg, 360.0))


def _entry(name: str, part: MapPart) -> dict[str, Any]:
    """The values of a part as in a map's file, to 1 um and 1e-6 degrees, without those that are the default."""
    values = {key: value for key, value in _given(part).items() if value is not None}
    if not all(map(math.isfinite, _numbers(values))):
        raise CommandError(f"'{name}' cannot be placed: its values must be finite numbers")
    if "yaw" in values:
        values["yaw_deg"] = _rounded(math.degrees(math.remainder(values.pop("yaw"), 2.0 * math.pi)))
    for key in {"x", "y", "points"} & values.keys():
        values[key] = _rounded(values[key])
    return {"name": name, **values}


def _given(part: MapPart) -> dict[str, Any]:
    fields = {field.name: field.default for field in msgspec.structs.fields(part)}
    return {key: value for key, default in fields.items() if (value := getattr(part, key)) != default}


def _numbers(value: Any) -> list[float]:
    if isinstance(value, dict | list | tuple):
        return [
            number for inner in (value.values() if isinstance(value, dict) else value) for number in _numbers(inner)
        ]
    return [value] if isinstance(value, float) else []


def _rounded(value: Any) -> Any:
    return round(float(value), 6) + 0.0 if isinstance(value, Real) else tuple(map(_rounded, value))
