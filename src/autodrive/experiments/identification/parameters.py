"""The parameters of a vehicle's file that are fitted: their paths, bounds and values, and the file with new values."""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from autodrive.base.errors import SpecError
from autodrive.base.specs import checked
from autodrive.base.yaml_files import parse, source
from autodrive.experiments.identification.drive import IdentificationError
from autodrive.scenario.kinds import find, read
from autodrive.scenario.vehicles.spec import VehicleSpec

FACTORS = (2.0, 1.8, 1.6, 1.4, 1.2, 1.1, 1.05)
"""Default bounds are the value divided and multiplied by the first factor with which the vehicle is valid."""
WIDE = 10.0
"""A parameter whose bounds have at least this ratio is searched by its logarithm."""


@dataclass(frozen=True)
class Free:
    """A parameter that is fitted, within bounds."""

    path: str
    """Path in the vehicle's file, such as 'wheels.damping_rate' or 'body.inertia.2'."""
    low: float
    high: float
    value: float | None
    """Value in the file; None if the file leaves it out."""

    @property
    def is_logarithmic(self) -> bool:
        """Whether it is searched by its logarithm."""
        return self.low > 0.0 and self.high / self.low >= WIDE

    @property
    def start(self) -> float:
        """Where the search starts."""
        return self.at(0.5) if self.value is None else min(max(self.value, self.low), self.high)

    def at(self, share: float) -> float:
        """The value at a share of the range between the bounds, 0 to 1."""
        if self.is_logarithmic:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """The share of the range at a value."""
        if self.is_logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


class VehicleFile:
    """A vehicle's file, and copies of it with other values."""

    def __init__(self, vehicle: str) -> None:
        """`vehicle`: name or path. Raises `SpecError`."""
        self.name = vehicle
        self.path: Path = find("vehicle", vehicle)
        self.spec = read("vehicle", vehicle, VehicleSpec)
        source(self.path)  # raises what is wrong with the text
        self._text = self.path.read_text(encoding="utf-8")

    @cached_property
    def values(self) -> dict[str, float | None]:
        """Each real number of the file by its path; None: an optional one that the file leaves out."""
        leaves = dict(_leaves("", self.spec.model_dump(mode="json")))
        return {path: value for path, value in leaves.items() if value is None or isinstance(value, float)}

    def prepared(self, values: Mapping[str, Any]) -> VehicleFile:
        """A copy of the file with other values, which a fit then changes. Raises `SpecError`."""
        other = copy.copy(self)
        other.spec = self.with_values(values)
        other._text = self.text(values)
        other.__dict__.pop("values", None)
        return other

    def with_values(self, values: Mapping[str, Any]) -> VehicleSpec:
        """The Spec with other values. Raises `SpecError`."""
        tree = self.spec.model_dump(mode="json")
        for path, value in values.items():
            _set(tree, path.split("."), value)
        return checked(tree, VehicleSpec)

    def text(self, values: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
        """The file with other values, each with its comments, below these lines of comment."""
        spec = self.with_values(values)
        head = "".join(f"# {line}\n" for line in comments)
        try:
            text = head + _edited(self._text, values)
            if parse(text, VehicleSpec) == spec:
                return text
        except SpecError:
            pass
        tree = spec.model_dump(mode="json", exclude_none=True)
        return head + yaml.safe_dump(tree, sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)

    def free(self, wanted: Sequence[str] | Mapping[str, tuple[float, float] | None]) -> list[Free]:
        """The parameters of 'path' or 'path=low:high', or of paths with bounds.

        Raises `IdentificationError` with all faults.
        """
        faults: list[str] = []
        parameters: dict[str, Free] = {}
        pairs = wanted.items() if isinstance(wanted, Mapping) else [_split(text, faults) for text in wanted]
        for path, bounds in pairs:
            if path in parameters:
                faults.append(f"'{path}' is named twice")
            elif path not in self.values:
                faults.append(self._unknown(path))
            elif isinstance(parameter := self._bounded(path, bounds), str):
                faults.append(parameter)
            else:
                parameters[path] = parameter
        if not pairs:
            faults.append("name at least one parameter, such as 'wheels.damping_rate'")
        if faults:
            raise IdentificationError("; ".join(faults))
        return [*parameters.values()]

    def _unknown(self, path: str) -> str:
        if path in dict(_leaves("", self.spec.model_dump(mode="json"))):
            return f"'{path}' is not a real number; only real numbers can be fitted"
        last = path.rpartition(".")[2]
        known = [*self.values]
        ends = [known_path for known_path in known if known_path.rpartition(".")[2].startswith(last)]
        close = [end for end in ends if end.endswith(f".{last}")] or difflib.get_close_matches(path, ends, cutoff=0.5)
        close = close[:3] or difflib.get_close_matches(path, known, n=3, cutoff=0.5)
        hint = f" Did you mean {' or '.join(map(repr, close))}?" if close else ""
        return f"'{path}' is not a parameter of vehicle '{self.name}'.{hint} (all: autodrive show {self.name})"

    def _bounded(self, path: str, bounds: tuple[float, float] | None) -> Free | str:
        """The parameter, or what is wrong."""
        value = self.values[path]
        if bounds is None:
            if not value:
                is_out = "left out of the file" if value is None else "0"
                return f"'{path}' is {is_out}: give its bounds, as {path}=low:high"
            for factor in FACTORS:
                low, high = sorted((value / factor, value * factor))
                if not self._fault(path, low) and not self._fault(path, high):
                    return Free(path, low, high, value)
            return f"'{path}' has no valid values around {value:g}: give its bounds, as {path}=low:high"
        low, high = bounds
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            return f"the bounds of '{path}' must be two numbers, the lower one first, not {low:g}:{high:g}"
        if wrong := self._fault(path, low) or self._fault(path, high):
            return f"the bounds of '{path}' are not valid: {wrong}"
        return Free(path, low, high, value)

    def _fault(self, path: str, value: float) -> str:
        try:
            self.with_values({path: value})
        except SpecError as error:
            return error.errors[0]
        return ""


def _split(text: str, faults: list[str]) -> tuple[str, tuple[float, float] | None]:
    path, equals, bounds = (part.strip() for part in text.partition("="))
    if not equals:
        return path, None
    low, _, high = bounds.partition(":")
    try:
        return path, (float(low), float(high))
    except ValueError:
        faults.append(f"the bounds of '{path}' must be such as {path}=0.1:0.5, not '{bounds}'")
        return path, None


def _leaves(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Path and value of all that is no dictionary and no list."""
    if not isinstance(value, dict | list | tuple):
        yield prefix, value
        return
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        yield from _leaves(f"{prefix}.{key}" if prefix else str(key), inner)


def _set(tree: Any, path: Sequence[str], value: Any) -> None:
    """Set a value in a tree of dictionaries and lists."""
    for part in path[:-1]:
        tree = tree[int(part) if isinstance(tree, list) else part]
    tree[int(path[-1]) if isinstance(tree, list) else path[-1]] = value


def _edited(text: str, values: Mapping[str, Any]) -> str:
    """The text with other values, and with keys that it lacks; all else remains."""
    changes: list[tuple[int, int, str]] = []
    root = yaml.compose(text)
    for path, value in values.items():
        node: Any = root
        parts = path.split(".")
        while parts and (inner := _child(node, parts[0])) is not None:
            node = inner
            parts.pop(0)
        if not parts:
            changes.append((node.start_mark.index, node.end_mark.index, repr(value)))
        elif len(parts) == 1 and isinstance(node, yaml.MappingNode) and node.value:
            start = node.value[0][0].start_mark
            after = ", " if node.flow_style else f"\n{' ' * start.column}"
            changes.append((start.index, start.index, f"{parts[0]}: {value!r}{after}"))
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def _child(node: Any, key: str) -> Any:
    if isinstance(node, yaml.MappingNode):
        return next((value for name, value in node.value if name.value == key), None)
    if isinstance(node, yaml.SequenceNode) and key.isdecimal() and int(key) < len(node.value):
        return node.value[int(key)]
    return None
