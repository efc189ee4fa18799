"""Reads, draws and checks spec files for the commands `list`, `show` and `check`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from autodrive.base import yaml_files
from autodrive.base.cache import write_file
from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec, is_yaml, joined
from autodrive.base.suggest import suggest
from autodrive.scenario import ScenarioSpec, VehiclePlacement, load_scenario, with_paths_of
from autodrive.scenario.files import described
from autodrive.scenario.kinds import Kind, check_exists, find, names, read
from autodrive.scenario.maps.map import Map, MapSpec, load_map, map_warnings
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.tracks.checks import track_errors, track_warnings
from autodrive.scenario.tracks.track import Track, TrackSpec
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.racing import RaceRules

KINDS: tuple[Kind, ...] = ("map", "track", "module", "vehicle", "scenario", "ruleset")
"""Search order for a name that is drawn."""
CHECKED: tuple[Kind, ...] = ("scenario", "map", "track", "vehicle", "module", "ruleset")
"""Search order for a name that is checked: first what `autodrive run` runs."""

SPECS: dict[Kind, type[Spec]] = {
    "map": MapSpec,
    "track": TrackSpec,
    "module": ModuleSpec,
    "vehicle": VehicleSpec,
    "scenario": ScenarioSpec,
    "ruleset": RaceRules,
}


def kind_of_name(name: str, order: tuple[Kind, ...] = KINDS) -> Kind:
    """The first kind with that name, or the kind of a YAML file. Raises `SpecError`."""
    if is_yaml(name):
        check_exists(Path(name), *order)
        return kind_of_file(Path(name))
    for kind in order:
        if name in names(kind):
            return kind
    known = sorted({known for kind in KINDS for known in names(kind)})
    raise SpecError([f"'{name}' is not known. {suggest(name, known)}"])


def kind_of_file(path: Path) -> Kind:
    """The kind whose fields the keys of the file match best. Raises `SpecError` if there is no single best kind."""
    tree = yaml_files.source(path).tree
    keys = set(tree) if isinstance(tree, dict) else set()
    scores: dict[Kind, int] = {kind: len(keys & set(spec.model_fields)) for kind, spec in SPECS.items()}
    best: list[Kind] = [kind for kind, score in scores.items() if score == max(scores.values()) > 0]
    if len(best) != 1:
        kinds = ", ".join(SPECS)
        raise SpecError([f"the content does not show what the file describes. Name it with --kind: {kinds}"], str(path))
    return best[0]


def check(name: str, kind: Kind | None = None) -> tuple[Kind, str, list[str]]:
    """Check a named or other file and all files that it refers to; returns kind, title and warnings.

    Raises `SpecError` with all errors, also of the valid parts of a file with errors.
    """
    kind = kind or kind_of_name(name, CHECKED)
    path = find(kind, name)
    source = yaml_files.source(path)
    spec, errors = yaml_files.readable(source, SPECS[kind])
    warnings: list[str] = []
    try:
        if kind == "map":
            errors = []
            load_map(path)
            warnings = map_warnings(path)
        elif isinstance(spec, TrackSpec) and spec.points:
            if not errors:
                load_map(path)
                warnings = map_warnings(path)
        elif kind == "track" and not errors:
            track = Track.load(path)
            places = {"walls": source.at("walls"), "centre line": source.at("centre_line")}
            errors += [
                f"{places['walls' if error.startswith('walls') else 'centre line']}: {error}"
                for error in track_errors(track)
            ]
            warnings = track_warnings(track)
        elif kind == "vehicle" and not errors:
            from autodrive.world.factory import compile_scenario

            compiled = compile_scenario(ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type=str(path))}))
            warnings = joined(compiled.warnings, {})
        elif isinstance(spec, ScenarioSpec):
            from autodrive.world.factory import compile_scenario

            descriptions = described(with_paths_of(spec, path.parent), source)
            warnings = joined(compile_scenario(descriptions).warnings, descriptions.lines)
    except SpecError as error:
        errors += error.errors
    if errors:
        raise SpecError(errors, str(path))
    return kind, getattr(spec, "title", ""), warnings


def draw(kind: Kind, name: str, path: Path) -> None:
    """Draw a map or module from above with its lanes, as PNG or SVG by the suffix of `path`. Raises `SpecError`.

    For a scenario: its map, with an arrow at the start pose of each vehicle.
    """
    from autodrive.scenario.maps.draw import to_png, to_svg
    from autodrive.world.compile import on_grid

    starts: list[tuple[float, float, float]] = []
    if kind == "scenario":
        scenario = load_scenario(name)
        map_ = load_map(scenario.map)
        scenario = on_grid(scenario, map_)
        starts = [(vehicle.x, vehicle.y, vehicle.yaw) for vehicle in scenario.vehicles.values()]
    else:
        map_ = map_of(kind, name)
    if path.suffix.lower() == ".svg":
        write_file(path, to_svg(map_, overlays=["lanes"], starts=starts))
    else:
        to_png(map_, path, overlays=["lanes"], starts=starts)


def map_of(kind: Kind, name: str) -> Map:
    """A map, the map of a scenario, or one that has only a module. Raises `SpecError`."""
    from autodrive.scenario.maps.draw import module_alone

    if kind == "scenario":
        return load_map(load_scenario(name).map)
    return load_map(name) if kind in ("map", "track") else replace(module_alone(name), name=Path(name).stem)


def size_and_ports(module: str) -> Iterator[str]:
    """Lines with the footprint of a module and the pose of each port in it."""
    spec = read("module", module, ModuleSpec)
    yield f"footprint: {spec.length:g} m along x, {spec.width:g} m along y; the origin is its centre"
    for name, port in spec.ports.items():
        yield f"port '{name}': x {port.x:g} m, y {port.y:g} m, {port.yaw_deg:g} degrees, road {port.width:g} m wide"


def fields(kind: Kind, name: str) -> Iterator[tuple[str, str]]:
    """Field path, for example 'wheels.radius', and value of every field of a spec, as text."""
    yield from _flat("", read(kind, name, SPECS[kind]).model_dump())


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(f"{prefix}.{key}" if prefix else str(key), inner)
    elif isinstance(value, list | tuple) and any(isinstance(inner, dict | list | tuple) for inner in value):
        for number, inner in enumerate(value):
            yield from _flat(f"{prefix}.{number}", inner)
    else:
        yield prefix, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
