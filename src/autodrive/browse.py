"""The descriptions that come with the simulator, or a person's own, told, drawn and checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import yaml

from autodrive.descriptions import Kind, Spec, find, names, read, suggest
from autodrive.errors import SpecError
from autodrive.maps.map import Map, MapSpec, load_map
from autodrive.maps.module import ModuleSpec, load_module
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.vehicles.spec import VehicleSpec

KINDS: tuple[Kind, ...] = ("map", "module", "vehicle", "scenario")
"""In the order in which a name is looked for."""

_SPECS: dict[Kind, type[Spec]] = {
    "map": MapSpec,
    "module": ModuleSpec,
    "vehicle": VehicleSpec,
    "scenario": ScenarioSpec,
}


def titles(kind: Kind) -> dict[str, str]:
    """Name -> title of all of that kind."""
    return {name: getattr(read(kind, name, _SPECS[kind]), "title", "") for name in names(kind)}


def kind_of_name(name: str) -> Kind:
    """The first kind that knows the name; the kind of the file if it is one. Raises `SpecError`."""
    if Path(name).suffix in {".yaml", ".yml"}:
        return kind_of_file(Path(name))
    for kind in KINDS:
        if name in names(kind):
            return kind
    known = sorted({known for kind in KINDS for known in names(kind)})
    raise SpecError([f"'{name}' is not known. {suggest(name, known)}"])


def kind_of_file(path: Path) -> Kind:
    """The kind whose words the file uses. Raises `SpecError` if two fit equally well, or none."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError([f"cannot be read: {getattr(error, 'strerror', None) or error}"], str(path)) from None
    try:
        tree = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SpecError([f"not YAML: {' '.join(str(error).split())}"], str(path)) from None
    words = set(tree) if isinstance(tree, dict) else set()
    scores: dict[Kind, int] = {kind: len(words & set(spec.model_fields)) for kind, spec in _SPECS.items()}
    best: list[Kind] = [kind for kind, score in scores.items() if score == max(scores.values()) > 0]
    if len(best) != 1:
        kinds = ", ".join(get_args(Kind))
        raise SpecError([f"it cannot be told what the file describes. Say it with --kind: {kinds}"], str(path))
    return best[0]


def check(path: Path, kind: Kind | None = None) -> tuple[Kind, str]:
    """Kind and title of a file without fault, with all that it names. Raises `SpecError` with all faults."""
    kind = kind or kind_of_file(path)
    spec = read(kind, find(kind, path), _SPECS[kind])
    if kind == "map":
        load_map(path)
    elif kind == "module":
        load_module(path)
    elif kind == "scenario":
        from autodrive.compile import compile_scenario

        compile_scenario(load_scenario(path))
    return kind, getattr(spec, "title", "")


def draw(kind: Kind, name: str, path: Path) -> None:
    """The map or module from above, with its lanes, as PNG or SVG by the suffix of `path`. Raises `SpecError`.

    Of a scenario: its map, with an arrow where each vehicle starts.
    """
    from autodrive.maps.draw import to_png, to_svg

    starts: list[tuple[float, float, float]] = []
    if kind == "scenario":
        scenario = load_scenario(name)
        starts = [(vehicle.x, vehicle.y, vehicle.yaw) for vehicle in scenario.vehicles.values()]
        map_ = load_map(scenario.map)
    else:
        map_ = _map(kind, name)
    if path.suffix.lower() == ".svg":
        path.write_text(to_svg(map_, overlays=["lanes"], starts=starts), encoding="utf-8")
    else:
        to_png(map_, path, overlays=["lanes"], starts=starts)


def write_occupancy(kind: Kind, name: str, folder: Path) -> Path:
    """The occupancy grid of a map, a module or a scenario's map, in that folder: its YAML file. Raises `SpecError`."""
    from autodrive.maps import raster

    map_ = _map(kind, name)
    folder.mkdir(parents=True, exist_ok=True)
    return raster.write_occupancy(map_, folder)


def write_labels(kind: Kind, name: str, path: Path) -> None:
    """What is where on a map, a module or a scenario's map, as a PNG of labels. Raises `SpecError`."""
    from autodrive.maps import raster

    raster.write_labels(_map(kind, name), path)


def _map(kind: Kind, name: str) -> Map:
    from autodrive.maps.draw import module_alone

    if kind == "scenario":
        return load_map(load_scenario(name).map)
    return load_map(name) if kind == "map" else replace(module_alone(name), name=Path(name).stem)


def fields(kind: Kind, name: str) -> Iterator[tuple[str, str]]:
    """Every field of a description, 'wheels.radius', and its value, as text."""
    yield from _flat("", read(kind, name, _SPECS[kind]).model_dump())


def _flat(prefix: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flat(f"{prefix}.{key}" if prefix else str(key), inner)
    elif isinstance(value, list | tuple) and any(isinstance(inner, dict | list | tuple) for inner in value):
        for number, inner in enumerate(value):
            yield from _flat(f"{prefix}.{number}", inner)
    else:
        yield prefix, ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
