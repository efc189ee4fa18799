"""The files of a scenario: read and checked, collected, and written to another folder."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, cast

import yaml
from pydantic import ValidationError

from autodrive.base import yaml_files
from autodrive.base.errors import SpecError
from autodrive.base.python_files import load
from autodrive.base.specs import Described, Key, Spec, is_yaml
from autodrive.base.suggest import suggest
from autodrive.base.yaml_files import Source
from autodrive.scenario import kinds
from autodrive.scenario.descriptions import Descriptions, Specs
from autodrive.scenario.kinds import Kind
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.spec import MAX_PLACEMENTS, DescribedMap, MapSpec, Placement
from autodrive.scenario.race_rules import RaceRules
from autodrive.scenario.scenario import RaceSpec, ScenarioSpec, is_track, with_files, with_paths_of
from autodrive.scenario.tracks.track import TrackSpec
from autodrive.scenario.vehicles.spec import VehicleSpec

T = TypeVar("T", bound=Spec)


def read_scenario(scenario: str | Path | ScenarioSpec) -> Descriptions:
    """A scenario (name, file or Spec) and all files that it names. Raises `SpecError` if it is not valid itself."""
    if isinstance(scenario, ScenarioSpec):
        return described(scenario)
    source = yaml_files.source(kinds.find("scenario", scenario))
    spec = yaml_files.checked_source(source, ScenarioSpec)
    return described(with_paths_of(spec, Path(source.path).parent), source)


def described(
    scenario: ScenarioSpec, source: Source | None = None, *, known: Descriptions | None = None
) -> Descriptions:
    """A scenario with all files that it names; `known`: those of another one, which are not read again."""
    files: dict[str, Any] = _files(known.specs) if known else {}

    def read(kind: Kind, name: str, spec: type[T]) -> Described[T]:
        return files.get(f"{kind}/{name}") or _read(kind, name, spec)

    if known and scenario.map == known.specs.scenario.map:
        map_, lines = known.specs.map, {key: line for key, line in known.lines.items() if key[0] == "map"}
    elif source and isinstance(source.tree.get("map"), dict):
        map_, lines = _own_map(scenario.map, source)
    else:
        map_, lines = read_map(scenario.map, known=known.specs.map.modules if known else {})
    lines |= {("scenario", *key): line for key, line in source.lines.items()} if source else {}
    types = dict.fromkeys(placement.type for placement in scenario.vehicles.values())
    types |= {scenario.traffic.type: None} if scenario.traffic.cars else {}
    race = scenario.race or (RaceSpec() if isinstance(map_.spec_or_none, TrackSpec) else None)
    specs = Specs(
        scenario,
        map_,
        {name: read("vehicle", name, VehicleSpec) for name in types},
        race and read("ruleset", race.rules, RaceRules),
        read("track", race.track, TrackSpec) if race and race.track else None,
        known.specs.own_sensors if known else {},
    )
    return Descriptions(specs, source.path if source else "", lines)


def with_own_sensors(specs: Specs) -> Specs:
    """The Specs with the classes of the user's sensors, which do not travel to other processes.

    Those that are there stay: after an edit of a world, its sensors are still those that were loaded with its scenario.
    """
    named = {path for vehicle in specs.scenario.vehicles.values() for path in vehicle.own_sensors.values()}
    loaded = {path: specs.own_sensors.get(path) or _own_sensor(path) for path in named}
    return replace(specs, own_sensors=loaded) if named else specs


def _own_sensor(reference: str) -> Callable[[], Any] | str:
    """The class of a sensor of the user, or why it cannot be loaded."""
    file, _, name = reference.rpartition(":")
    try:
        return load(Path(file), name)
    except OSError as error:
        return f"file '{file}' cannot be read: {error.strerror or error}"
    except Exception as error:
        return f"'{reference}' cannot be loaded: {type(error).__name__}: {error}"


def read_map(
    name: str | Path | MapSpec | TrackSpec, *, known: Mapping[str, Described[ModuleSpec]] = MappingProxyType({})
) -> tuple[DescribedMap, dict[Key, int]]:
    """A map or track with its modules, and the lines of its keys; `known`: modules that a MapSpec need not read."""
    if isinstance(name, MapSpec):
        return _with_modules(Described("map", name), name.placements, known), {}
    if isinstance(name, TrackSpec):
        return DescribedMap("map", name), {}
    try:
        path = _find_map(name)
        source = yaml_files.source(path)
    except SpecError as error:
        return DescribedMap(str(name), None, error, error.path), {}
    lines: dict[Key, int] = {("map", *key): line for key, line in source.lines.items()}
    if is_track(source.tree):
        track = _described(source, TrackSpec, f"track '{path.stem}': ")
        return DescribedMap(track.name, track.spec_or_none, track.error, track.path, track.text), lines
    map_ = _described(source, MapSpec, f"map '{path.stem}': ")
    placements = map_.spec_or_none.placements if map_.spec_or_none else _placements(source.tree)
    return _with_modules(map_, placements), lines


@functools.cache
def map_titles() -> dict[str, str]:
    """Maps of the simulator to build from: name -> title."""
    return kinds.titles("map", MapSpec)


def read_module(name: str | Path) -> Described[ModuleSpec]:
    """What the file of a module says."""
    try:
        path = kinds.find("module", name)
        return _module(path, path.stat().st_mtime_ns)
    except SpecError as error:
        return Described(str(name), None, error, error.path)


def module_of(name: str, text: str) -> Described[ModuleSpec]:
    """What the text of a module's file says. Raises `SpecError` if it is no YAML."""
    return _described(Source(text, name), ModuleSpec)


def files_of(specs: Specs) -> dict[str, str]:
    """Texts of map, modules, vehicles and race, by kind and name as the scenario and the map name them."""
    return {name: file.text for name, file in _files(specs).items()}


def check_names(scenario: ScenarioSpec, known: Specs) -> None:
    """Raises `SpecError` if a scenario from elsewhere names a file that is neither of the simulator nor in `known`.

    So a text that a client sends reads no file and runs no code.
    """
    files = {name for key in _files(known) for name in (key, _absolute(key))}
    sensors = {path for vehicle in known.scenario.vehicles.values() for path in vehicle.own_sensors.values()}
    errors: list[str] = []

    def check(kind: str, name: str) -> str:
        names = kinds.names(cast("Kind", kind)) + (kinds.names("track") if kind == "map" else [])
        if name not in names and not {f"{kind}/{name}", _absolute(f"{kind}/{name}")} & files:
            errors.append(f"{kind} '{name}' does not belong to the simulator. {suggest(name, names)}")
        return name

    with_files(scenario, check)
    for name, vehicle in scenario.vehicles.items():
        if {*vehicle.own_sensors.values()} - sensors:
            text = "sensors are Python files; start the simulator with this scenario file"
            errors.append(f"vehicles.{name}.own_sensors: {text}")
    if errors:
        raise SpecError(errors)


def _absolute(key: str) -> str:
    """Kind and name of a file, with its absolute path."""
    kind, _, name = key.partition("/")
    return f"{kind}/{Path(name).absolute()}" if is_yaml(name) else key


def write_to(folder: Path, scenario: ScenarioSpec, files: Mapping[str, str]) -> ScenarioSpec:
    """Write the files of a scenario, as `files_of` returns them; the scenario with their paths.

    Raises `KeyError` for a file that is not there, `ValueError` for one of an unknown kind, and `SpecError` for a map
    that is no YAML within the limits.
    """

    def path_of(kind: str, name: str) -> str:
        """Files of one name, in different folders, have folders of their own here, too."""
        if (key := f"{kind}/{name}") not in files:
            raise KeyError(key)
        return str(folder / kind / str(sorted(files).index(key)) / f"{Path(name).stem}.yaml")

    for key, text in files.items():
        kind, _, name = key.partition("/")
        if kind not in {"map", "module", "vehicle", "track", "ruleset"}:
            raise ValueError(f"a file '{key}' of an unknown kind")
        path = Path(path_of(kind, name))
        path.parent.mkdir(parents=True, exist_ok=True)
        tree = Source(text, name).tree if kind == "map" else None
        for placement in (tree.get("placements") or ()) if isinstance(tree, dict) else ():
            placement["module"] = path_of("module", str(placement["module"]))
        path.write_text(yaml.safe_dump(tree, sort_keys=False, allow_unicode=True) if tree else text, encoding="utf-8")
    if scenario.race is None and "ruleset/practice" in files:
        scenario = scenario.model_copy(update={"race": RaceSpec()})
    return with_files(scenario, path_of)


def map_text(spec: MapSpec | TrackSpec) -> str:
    """The map or track as YAML, with the keys that were given."""
    return _text(spec.model_dump(mode="json", exclude_unset=True))


def scenario_text(spec: ScenarioSpec) -> str:
    """The scenario as YAML. Paths of files become absolute, so that the text may be saved in any folder."""
    spec = with_files(spec, lambda _, name: str(Path(name).absolute()) if is_yaml(name) else name)
    vehicles = {
        name: {"type": placement.type, "x": placement.x, "y": placement.y}
        | placement.model_dump(mode="json", exclude_defaults=True)
        for name, placement in spec.vehicles.items()
        if name not in spec.traffic.names
    }
    tree = {"title": spec.title, "map": None, "vehicles": {}} | spec.model_dump(mode="json", exclude_defaults=True)
    tree |= {"map": spec.model_dump(mode="json", include={"map"})["map"], "vehicles": vehicles}
    return _text(tree)


def _text(tree: dict[str, Any]) -> str:
    return yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)


def _read(kind: Kind, name: str, spec: type[T]) -> Described[T]:
    try:
        return _described(yaml_files.source(kinds.find(kind, name)), spec)
    except SpecError as error:
        return Described(name, None, error, error.path)


@functools.lru_cache(maxsize=256)
def _module(path: Path, _modified: int) -> Described[ModuleSpec]:
    return _described(yaml_files.source(path), ModuleSpec)


def _described(source: Source, spec: type[T], prefix: str = "") -> Described[T]:
    """What a file says; errors begin with the prefix."""
    content, errors = yaml_files.readable(source, spec)
    error = SpecError([f"{prefix}{text}" for text in errors], source.path) if errors else None
    return Described(Path(source.path).stem, None if errors else content, error, source.path, source.text)


def _find_map(name: str | Path) -> Path:
    """Path of the file of a map or track, given its name or path. Raises `SpecError`."""
    if str(name) in kinds.names("track") and str(name) not in kinds.names("map"):
        return kinds.find("track", name)
    return kinds.find("map", name, also="track")


def _placements(tree: Any) -> Iterator[Placement | None]:
    """The placements of the file of a map that is not valid; None for those that are not valid themselves."""
    raw = tree.get("placements") if isinstance(tree, dict) else None
    for raw_placement in raw[:MAX_PLACEMENTS] if isinstance(raw, list) else []:
        try:
            yield Placement.model_validate(raw_placement)
        except ValidationError:
            yield None


def _own_map(map_: str | MapSpec | TrackSpec, source: Source) -> tuple[DescribedMap, dict[Key, int]]:
    """The map in the file of a scenario; `map_` is no Spec if it is not valid."""
    lines = {key: line for key, line in source.lines.items() if key[0] == "map"}
    if isinstance(map_, TrackSpec):
        return DescribedMap("map", map_, path=source.path), lines
    spec = map_ if isinstance(map_, MapSpec) else None
    described = Described("map", spec, path=source.path)
    return _with_modules(described, spec.placements if spec else _placements(source.tree["map"])), lines


def _with_modules(
    described: Described[MapSpec],
    placements: Iterable[Placement | None],
    known: Mapping[str, Described[ModuleSpec]] = MappingProxyType({}),
) -> DescribedMap:
    """A map with the modules that it names. Relative paths of modules start at its folder."""
    numbered = tuple((number, placement) for number, placement in enumerate(placements, 1) if placement)
    folder = Path(described.path).parent if described.path else None
    modules = {
        name: known.get(name) or read_module(folder / name if folder and is_yaml(name) else name)
        for name in dict.fromkeys(placement.module for _, placement in numbered)
    }
    return DescribedMap(
        described.name, described.spec_or_none, described.error, described.path, described.text, numbered, modules
    )


def _files(specs: Specs) -> dict[str, Described[Any]]:
    race = specs.scenario.race or RaceSpec()
    files: dict[str, Described[Any]] = {}
    if isinstance(specs.scenario.map, str):
        files[f"map/{specs.scenario.map}"] = specs.map
    files |= {f"vehicle/{name}": vehicle for name, vehicle in specs.vehicles.items()}
    files |= {f"ruleset/{race.rules}": specs.rules} if specs.rules else {}
    files |= {f"track/{race.track}": specs.track} if specs.track else {}
    return files | {f"module/{name}": specs.map.modules[name] for name in sorted(specs.map.modules)}
