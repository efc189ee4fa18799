"""Reads the YAML files that describe vehicles, modules, maps and scenarios: YAML in, checked Spec out."""

from __future__ import annotations

import difflib
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from autodrive.errors import SpecError

Kind = Literal["vehicle", "module", "map", "scenario"]


class Spec(BaseModel):
    """Base of everything a person can configure: frozen, and a word that it does not know is a fault."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


T = TypeVar("T", bound=Spec)

_loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def names(kind: Kind) -> list[str]:
    """Names of the descriptions of that kind that come with the simulator, sorted."""
    return sorted(path.stem for path in _folder(kind).glob("*.yaml"))


def find(kind: Kind, name: str | Path) -> Path:
    """The file of a description, given its name or the path of a YAML file. Raises `SpecError`."""
    path = Path(name)
    if path.suffix in {".yaml", ".yml"}:
        if path.is_file():
            return path
        raise SpecError([f"there is no file '{path}'"])
    shipped = _folder(kind) / f"{name}.yaml"
    if shipped.is_file():
        return shipped
    raise SpecError([f"{kind} '{name}' is not known. {suggest(str(name), names(kind))}"])


def read(kind: Kind, name: str | Path, spec: type[T]) -> T:
    """The checked Spec of a shipped description (by name) or of a file (by path).

    Raises `SpecError` with all faults of the file at once.
    """
    path = find(kind, name)
    return parse(path.read_text(encoding="utf-8"), spec, where=str(path))


def parse(text: str, spec: type[T], where: str = "<text>") -> T:
    """The checked Spec of a YAML text. Raises `SpecError` with all faults; `where` is the path shown last."""
    try:
        node = yaml.compose(text, Loader=_loader)
        tree = yaml.load(text, Loader=_loader)
    except yaml.YAMLError as error:
        raise SpecError([f"not YAML: {error}"], where) from None
    if not isinstance(tree, dict):
        raise SpecError([f"a {spec.__name__} is a list of 'key: value' lines, not {type(tree).__name__}"], where)
    duplicates = _duplicate_keys(node)
    try:
        checked = spec.model_validate(tree)
    except ValidationError as error:
        raise SpecError(duplicates + [_sentence(fault, node, spec) for fault in error.errors()], where) from None
    if duplicates:
        raise SpecError(duplicates, where)
    return checked


def suggest(word: str, known: list[str]) -> str:
    """'Known: a, b. Did you mean 'a'?' for a word that is not among the known ones."""
    text = f"Known: {', '.join(known) or 'none'}."
    close = difflib.get_close_matches(word, known, n=1)
    return f"{text} Did you mean '{close[0]}'?" if close else text


def _folder(kind: Kind) -> Path:
    return Path(str(resources.files("autodrive"))) / "data" / f"{kind}s"


def _sentence(fault: Any, node: yaml.Node | None, spec: type[BaseModel]) -> str:
    """One fault found by pydantic, as 'place (line n): what is wrong, what would be right'."""
    location = fault["loc"]
    place = _place(location) or spec.__name__
    line = _line(node, location)
    text = fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        known = _fields(spec, location[:-1])
        text = f"'{location[-1]}' is not known here." + (f" {suggest(str(location[-1]), known)}" if known else "")
    elif fault["type"] == "missing":
        text = "is missing"
    elif isinstance(fault.get("input"), str | int | float):
        text = f"{text}, not {fault['input']!r}"
    return f"{place}{f' (line {line})' if line else ''}: {text}"


def _place(location: tuple[Any, ...]) -> str:
    """('placements', 3, 'x') as 'placement 4.x': people count from 1."""
    parts: list[str] = []
    for part in location:
        if isinstance(part, int) and parts:
            parts[-1] = f"{parts[-1].removesuffix('s')} {part + 1}"
        else:
            parts.append(str(part))
    return ".".join(parts)


def _fields(spec: type[BaseModel], location: tuple[Any, ...]) -> list[str]:
    """Field names of the Spec at that place, as far as the place leads through plain nested Specs and lists of them."""
    current: Any = spec
    for part in location:
        if isinstance(part, int):
            continue
        field = getattr(current, "model_fields", {}).get(part)
        if field is None:
            return []
        current = _inner_spec(field.annotation)
    return sorted(getattr(current, "model_fields", {}))


def _inner_spec(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _inner_spec(argument)
        if found is not None:
            return found
    return None


def _line(node: Any, location: tuple[Any, ...]) -> int | None:
    """Line (from 1) of the deepest part of that place that the text holds."""
    found: int | None = None
    for part in location:
        if isinstance(node, yaml.MappingNode):
            pairs = {key.value: (key, value) for key, value in node.value}
            if str(part) not in pairs:
                break
            key, node = pairs[str(part)]
            found = key.start_mark.line + 1
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            node = node.value[part]
            found = node.start_mark.line + 1
        else:
            break
    return found


def _duplicate_keys(node: yaml.Node | None) -> list[str]:
    """A fault for every key that stands twice in one mapping (YAML itself would silently keep the last)."""
    faults: list[str] = []
    if isinstance(node, yaml.MappingNode):
        seen: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if key.value in seen:
                faults.append(f"{key.value} (line {line}): stands twice, first in line {seen[key.value]}")
            seen.setdefault(key.value, line)
            faults += _duplicate_keys(value)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            faults += _duplicate_keys(value)
    return faults
