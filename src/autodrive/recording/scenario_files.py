"""The files that a scenario names: collected into a recording, and written to a folder to run the scenario again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from autodrive.base import specs
from autodrive.base.errors import SpecError
from autodrive.recording.errors import RecordingError
from autodrive.recording.records import ScenarioRecord
from autodrive.scenario import RaceSpec, ScenarioSpec
from autodrive.scenario.maps.map import find_map


def files_of(spec: ScenarioSpec) -> dict[str, str]:
    """Texts of the map, its modules, the vehicles and the race, by kind and name as the scenario and the map name them.

    Raises `SpecError` if a file cannot be read.
    """
    map_path = find_map(spec.map)
    found = {f"map/{spec.map}": _text(map_path)}
    for vehicle in spec.vehicles.values():
        found[f"vehicle/{vehicle.type}"] = _text(specs.find("vehicle", vehicle.type))
    tree = yaml.safe_load(found[f"map/{spec.map}"])
    race = spec.race or (RaceSpec() if isinstance(tree, dict) and "centre_line" in tree else None)
    if race is not None:
        found[f"ruleset/{race.rules}"] = _text(specs.find("ruleset", race.rules))
        if race.track:
            found[f"track/{race.track}"] = _text(find_map(race.track))
    for module in _modules(tree):
        is_file = Path(module).suffix in {".yaml", ".yml"}
        found[f"module/{module}"] = _text(map_path.parent / module if is_file else specs.find("module", module))
    return found


def scenario_from(record: ScenarioRecord, folder: Path) -> ScenarioSpec:
    """The scenario of a recording, with its files written to a folder. Raises `RecordingError`.

    Without the sensors of the user: a recording neither contains nor runs their code.
    """
    try:
        spec = specs.checked(dict(record.spec), ScenarioSpec)
        paths = {name: _written(name, text, folder, record.files) for name, text in record.files.items()}
        vehicles = {
            name: one.model_copy(update={"type": paths[f"vehicle/{one.type}"], "own_sensors": {}})
            for name, one in spec.vehicles.items()
        }
        race = spec.race or (RaceSpec() if "ruleset/practice" in paths else None)
        if race is not None:
            files = {"rules": paths[f"ruleset/{race.rules}"], "track": race.track and paths[f"track/{race.track}"]}
            race = race.model_copy(update=files)
        return spec.model_copy(update={"map": paths[f"map/{spec.map}"], "vehicles": vehicles, "race": race})
    except KeyError as error:
        raise RecordingError(f"the recording does not contain the file {error} of its scenario") from None
    except SpecError as error:
        raise RecordingError(f"the scenario of the recording is not valid here: {error}") from None
    except (OSError, yaml.YAMLError, AttributeError, TypeError) as error:
        raise RecordingError(f"the files of the recording's scenario cannot be written: {error}") from None


def _written(name: str, text: str, folder: Path, files: dict[str, str]) -> str:
    """Write a file; its path. A map names the modules in the same folder."""
    kind, _, key = name.partition("/")
    if kind not in {"map", "module", "vehicle", "track", "ruleset"}:
        raise RecordingError(f"the recording contains a file '{name}' of an unknown kind")
    path = folder / kind / f"{_number(name, files)}" / f"{Path(key).stem}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    if kind == "map":
        tree = yaml.safe_load(text)
        for placement in (tree.get("placements") or ()) if isinstance(tree, dict) else ():
            module = placement["module"]
            own = f"module/{module}"
            placement["module"] = str(folder / "module" / f"{_number(own, files)}" / f"{Path(str(module)).stem}.yaml")
        text = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True)
    path.write_text(text, encoding="utf-8")
    return str(path)


def _number(name: str, files: dict[str, str]) -> int:
    """Files of one name, in different folders, need folders of their own here, too."""
    if name not in files:
        raise KeyError(name)
    return sorted(files).index(name)


def _modules(tree: Any) -> list[str]:
    placements = tree.get("placements") if isinstance(tree, dict) else None
    return sorted({str(one["module"]) for one in placements or () if isinstance(one, dict) and "module" in one})


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError([f"cannot be read: {error}"], str(path)) from None
