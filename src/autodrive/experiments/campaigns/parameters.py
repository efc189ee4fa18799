"""Paths of parameters: what they change in a scenario, and which of them a compiled world can take."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import yaml

from autodrive.base import specs
from autodrive.base.errors import SpecError
from autodrive.base.specs import Described, Spec
from autodrive.base.suggest import suggest
from autodrive.base.yaml_files import Source
from autodrive.experiments.campaigns.sampling import ParameterRange, Value
from autodrive.scenario import FACTOR_FIELDS, NEUTRAL, ScenarioSpec
from autodrive.scenario.descriptions import Descriptions, Specs
from autodrive.scenario.files import described
from autodrive.scenario.maps.spec import MapSpec
from autodrive.scenario.vehicles.spec import VehicleSpec

T = TypeVar("T", bound=Spec)

LATENCY = "latency"
"""Path of the time from a Frame until its commands are obeyed [s]."""
MAX_LATENCY = 10.0
"""[s]."""
DRIVER = re.compile(r"driver\.([A-Za-z_]\w*)")
"""Path of an argument of the driver's class."""
FACTORS = {field: name for name, field in FACTOR_FIELDS.items()}
"""Names of the factors of a vehicle by their fields in the scenario."""
WARM = re.compile(rf"vehicles\.(\w+)\.(x|y|yaw_deg|{'|'.join(FACTORS)})|boxes\.(\w+)\.(x|y|yaw_deg)")
"""Paths that a compiled world can take: it need not be compiled again."""
MAP = "map."
"""Start of the path of a field of the map, such as 'map.ground.grip'."""
OF_VEHICLE = re.compile(r"vehicles\.(\w+)\.spec\.(.+)")
"""Path of a field of a vehicle's file, such as 'vehicles.V1.spec.wheels.radius'."""


def errors(descriptions: Descriptions, path: str, values: ParameterRange) -> list[str]:
    """What is wrong with a parameter."""
    if path == LATENCY:
        fits = all(isinstance(value, int | float) and 0.0 <= value <= MAX_LATENCY for value in values.values)
        return [] if fits else [f"must be from 0 to {MAX_LATENCY:g} s"]
    if DRIVER.fullmatch(path):
        return []
    if path == "seed":
        return ["set the seeds of the runs with the key 'seeds'"]
    problems: list[str] = []
    for value in values.values:
        try:
            applied(descriptions, {path: value})
        except SpecError as error:
            problems += [text for text in error.errors if text not in problems]
    return problems


def is_compiled(path: str) -> bool:
    """Whether another value needs another compiled world."""
    return not (path == LATENCY or DRIVER.fullmatch(path) or WARM.fullmatch(path))


def structural(descriptions: Descriptions, values: Mapping[str, Value]) -> Descriptions:
    """The scenario with the values that need another compiled world. Raises `SpecError`.

    Factors that are parameters are neutral: the world takes them afterwards.
    """
    fields = {path: path.rpartition(".")[2] for path in values if WARM.fullmatch(path)}
    neutral = {path: NEUTRAL[FACTORS[field]] for path, field in fields.items() if field in FACTORS}
    return applied(descriptions, neutral | {path: value for path, value in values.items() if is_compiled(path)})


def applied(descriptions: Descriptions, values: Mapping[str, Value]) -> Descriptions:
    """The scenario with these values by path. Raises `SpecError` with all errors."""
    scenario = descriptions.specs.scenario
    tree = scenario.model_dump(exclude_unset=True)
    tree.setdefault(
        "vehicles", {name: placement.model_dump(exclude_unset=True) for name, placement in scenario.vehicles.items()}
    )
    files: dict[str, dict[str, Value]] = {}
    for path, value in values.items():
        if path == LATENCY or DRIVER.fullmatch(path):
            continue
        if path.startswith(MAP) and isinstance(scenario.map, str):
            files.setdefault("map", {})[path.removeprefix(MAP)] = value
        elif match := OF_VEHICLE.fullmatch(path):
            files.setdefault(match[1], {})[match[2]] = value
        else:
            _set(tree, path, value)
    result = described(specs.checked(tree, ScenarioSpec), known=descriptions)
    for name, changes in files.items():
        changed = _with_map if name == "map" else functools.partial(_with_vehicle, name)
        result = replace(result, specs=changed(result.specs, changes))
    return result


def _with_map(specs: Specs, changes: Mapping[str, Value]) -> Specs:
    """The files of a scenario, with other values in the file of the map."""
    spec, text = _changed(specs.map, type(specs.map.spec), changes)
    numbered = tuple(enumerate(spec.placements, 1)) if isinstance(spec, MapSpec) else ()
    return replace(specs, map=replace(specs.map, spec_or_none=spec, error=None, text=text, placements=numbered))


def _with_vehicle(name: str, specs: Specs, changes: Mapping[str, Value]) -> Specs:
    """The files of a scenario, with other values in the file of one vehicle, which gets a type of its own."""
    vehicles = specs.scenario.vehicles
    if name not in vehicles:
        raise SpecError([f"there is no vehicle '{name}'. {suggest(name, list(vehicles))}"])
    file, type_ = specs.vehicles[vehicles[name].type], f"{vehicles[name].type} of {name}"
    spec, text = _changed(file, VehicleSpec, changes)
    placed = vehicles | {name: vehicles[name].model_copy(update={"type": type_})}
    return replace(
        specs,
        scenario=specs.scenario.model_copy(update={"vehicles": placed}),
        vehicles={**specs.vehicles, type_: replace(file, spec_or_none=spec, error=None, text=text)},
    )


def _changed(file: Described[Any], spec: type[T], changes: Mapping[str, Value]) -> tuple[T, str]:
    """Spec and text of a file with other values. Raises `SpecError`."""
    tree = Source(file.text).tree if file.text else file.spec.model_dump()
    for name, value in changes.items():
        _set(tree, name, value)
    return specs.checked(tree, spec), yaml.safe_dump(tree, sort_keys=False, allow_unicode=True)


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
