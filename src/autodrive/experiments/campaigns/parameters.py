"""Paths of parameters: what they change in a scenario, and which of them a compiled world can take."""

from __future__ import annotations

import functools
import hashlib
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from autodrive.base import specs, yaml_files
from autodrive.base.errors import SpecError
from autodrive.base.suggest import suggest
from autodrive.experiments.campaigns.sampling import Range, Value
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.files import find_map
from autodrive.scenario.maps.spec import MapSpec
from autodrive.scenario.vehicles.spec import VehicleSpec

LATENCY = "latency"
"""Path of the time from a Frame until its commands are obeyed [s]."""
MAX_LATENCY = 10.0
"""[s]."""
DRIVER = re.compile(r"driver\.([A-Za-z_]\w*)")
"""Path of an argument of the driver's class."""
WARM = re.compile(r"vehicles\.(\w+)\.(x|y|yaw_deg|mass_factor|grip_factor|noise_factor)|boxes\.(\w+)\.(x|y|yaw_deg)")
"""Paths that a compiled world can take: it need not be compiled again."""
MAP = "map."
"""Start of the path of a field of the map's file, such as 'map.ground.grip'."""
OF_VEHICLE = re.compile(r"vehicles\.(\w+)\.spec\.(.+)")
"""Path of a field of a vehicle's file, such as 'vehicles.V1.spec.wheels.radius'."""


def errors(scenario: ScenarioSpec, path: str, values: Range) -> list[str]:
    """What is wrong with a parameter."""
    if path == LATENCY:
        fits = all(isinstance(one, int | float) and 0.0 <= one <= MAX_LATENCY for one in values.values)
        return [] if fits else [f"must be from 0 to {MAX_LATENCY:g} s"]
    if DRIVER.fullmatch(path):
        return []
    if path == "seed":
        return ["set the seeds of the runs with the key 'seeds'"]
    found: list[str] = []
    for value in values.values:
        try:
            applied(scenario, {path: value})
        except SpecError as error:
            found += [text for text in error.errors if text not in found]
    return found


def is_compiled(path: str) -> bool:
    """Whether another value needs another compiled world."""
    return not (path == LATENCY or DRIVER.fullmatch(path) or WARM.fullmatch(path))


def structural(scenario: ScenarioSpec, values: Mapping[str, Value]) -> ScenarioSpec:
    """The scenario with the values that need another compiled world. Raises `SpecError`.

    Factors that are parameters are 1: the world takes them afterwards.
    """
    neutral = {path: 1.0 for path in values if path.endswith("_factor") and WARM.fullmatch(path)}
    return applied(scenario, neutral | {path: value for path, value in values.items() if is_compiled(path)})


def applied(scenario: ScenarioSpec, values: Mapping[str, Value]) -> ScenarioSpec:
    """The scenario with these values by path. Raises `SpecError` with all errors."""
    tree = scenario.model_dump(exclude_unset=True)
    tree.setdefault("vehicles", {name: one.model_dump(exclude_unset=True) for name, one in scenario.vehicles.items()})
    files: dict[str, dict[str, Value]] = {}
    for path, value in values.items():
        if path == LATENCY or DRIVER.fullmatch(path):
            continue
        if path.startswith(MAP):
            files.setdefault("map", {})[path.removeprefix(MAP)] = value
        elif found := OF_VEHICLE.fullmatch(path):
            files.setdefault(found[1], {})[found[2]] = value
        else:
            _set(tree, path, value)
    spec = specs.checked(tree, ScenarioSpec)
    for name, changes in files.items():
        if name == "map":
            spec = spec.model_copy(update={"map": _changed_file("map", str(find_map(spec.map)), changes)})
            continue
        if name not in spec.vehicles:
            raise SpecError([f"there is no vehicle '{name}'. {suggest(name, list(spec.vehicles))}"])
        placed = spec.vehicles[name]
        file = str(yaml_files.find("vehicle", placed.type))
        changed = placed.model_copy(update={"type": _changed_file("vehicle", file, changes)})
        spec = spec.model_copy(update={"vehicles": {**spec.vehicles, name: changed}})
    return spec


def _set(tree: dict[str, Any], path: str, value: Value) -> None:
    """Set a value in a tree. Raises `SpecError` for a vehicle or a box that is not there."""
    *parts, last = path.split(".")
    if parts and parts[0] in ("vehicles", "boxes"):
        known = list(tree.get(parts[0], {}))
        if len(parts) < 2 or parts[1] not in known:
            name = parts[1] if len(parts) > 1 else last
            raise SpecError([f"there is no '{name}' in the {parts[0]} of the scenario. {suggest(name, known)}"])
    node: Any = tree
    for part in parts:
        inner = node.get(part) if isinstance(node, dict) else None
        if inner is None:
            inner = {}
        if not isinstance(inner, dict):
            raise SpecError([f"'{part}' has no fields; parameters of files: 'map.FIELD', 'vehicles.NAME.spec.FIELD'"])
        node[part] = inner
        node = inner
    node[last] = value


def _changed_file(kind: str, path: str, changes: Mapping[str, Value]) -> str:
    """Path of a copy of a file with other values. Raises `SpecError`."""
    source = yaml_files.source(Path(path))
    tree = yaml.safe_load(yaml.safe_dump(source.tree))
    for name, value in changes.items():
        _set(tree, name, value)
    specs.checked(tree, MapSpec if kind == "map" else VehicleSpec)
    if kind == "map":
        for placement in tree.get("placements") or ():
            if Path(str(placement.get("module"))).suffix in {".yaml", ".yml"}:
                placement["module"] = str((Path(path).parent / placement["module"]).absolute())
    text = yaml.safe_dump(tree, sort_keys=False)
    file = Path(_folder().name) / f"{Path(path).stem}_{hashlib.sha256(text.encode()).hexdigest()[:16]}.yaml"
    if not file.exists():
        file.write_text(text, encoding="utf-8")
    return str(file)


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Folder of this process for changed files; it is removed with the process."""
    return tempfile.TemporaryDirectory(prefix="autodrive-campaign-")
