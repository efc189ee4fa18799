"""Specs: checked, frozen values that describe vehicles, modules, maps and scenarios; and the texts of their errors."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, NamedTuple, TypeAlias, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from autodrive.base.errors import SpecError
from autodrive.base.suggest import suggest

MAX_ERRORS = 100
"""Errors of the values of a file that are reported; more are only counted."""

Coordinate: TypeAlias = Annotated[float, Field(ge=-1e4, le=1e4)]
"""A position in a map [m]."""
Offset: TypeAlias = Annotated[float, Field(ge=-100.0, le=100.0)]
"""A position in a vehicle [m]."""
Length: TypeAlias = Annotated[float, Field(ge=1e-3, le=100.0)]
"""Length of an edge of a body [m]."""
Mass: TypeAlias = Annotated[float, Field(ge=1e-3, le=1e4)]
"""[kg]."""
Degrees: TypeAlias = Annotated[float, Field(ge=-3600.0, le=3600.0)]
"""An angle [degree]."""
Name: TypeAlias = Annotated[str, Field(pattern=r"^[\w .-]*$", max_length=100)]
"""A name that the engine and the scene files accept."""


def _seconds(value: Any) -> Any:
    """A time of day 'HH:MM' or 'HH:MM:SS' in seconds; a number, or its text, is seconds already, but not an hour."""
    if not isinstance(value, str) or re.fullmatch(r"\d+(\.\d*)?", value):
        if isinstance(value, str | int | float) and 0.0 < float(value) <= 24.0:
            raise ValueError(f"{value} would be {value} seconds after midnight: write HH:MM, such as 18:30")
        return value
    if not (match := re.fullmatch(r"(\d{1,2}):([0-5]\d)(?::([0-5]\d))?", value)) or not int(match[1]) < 24:
        raise ValueError(f"must be seconds since midnight or HH:MM, such as 18:30, not '{value[:20]}'")
    return 3600.0 * int(match[1]) + 60.0 * int(match[2]) + int(match[3] or 0)


TimeOfDay: TypeAlias = Annotated[float, BeforeValidator(_seconds), Field(ge=0.0, lt=86400.0)]
"""Since midnight [s], or a text such as '18:30'."""


def is_yaml(name: str | Path) -> bool:
    """Whether this is the name of a YAML file."""
    return Path(name).suffix.lower() in {".yaml", ".yml"}


class Spec(BaseModel):
    """Base class of all configuration: frozen; unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, /, **values: Any) -> None:
        """Raises `SpecError` with all errors."""
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise SpecError(messages(error.errors(), type(self))) from None

    __init__.__pydantic_base_init__ = True  # pyright: ignore  # as in RootModel: fields that are Specs do not call it


Rule: TypeAlias = tuple[tuple[str | int, ...], str]
"""A broken rule: its place in the Spec, and what is wrong."""


class RuleError(ValueError):
    """A Spec breaks rules for several keys; a validator raises it."""

    def __init__(self, errors: list[Rule]) -> None:
        super().__init__("; ".join(text for _, text in errors))
        self.errors = errors


Key: TypeAlias = tuple[str, ...]
"""A location in a text, such as ("placements", "3", "x"); in a table for several files, the first part is the file."""


class PlaceInFile(NamedTuple):
    """A value in the text of a problem; `joined` adds its line."""

    file: Literal["scenario", "map"]
    location: tuple[str | int, ...]
    name: str = ""
    """How the text calls it; left out: by its location."""


Problem: TypeAlias = tuple[PlaceInFile | str, ...]
"""What is wrong when Specs are compiled: the parts of a message."""


class SpecProblems(Exception):  # noqa: N818  a list of problems, which becomes a `SpecError`
    """Specs cannot be compiled; `joined` makes the messages."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__()
        self.problems = problems


T = TypeVar("T", bound=Spec)


@dataclass(frozen=True, eq=False)
class Described(Generic[T]):
    """What a file says. It is equal only to itself, so that caches can use it as a key."""

    name: str
    """Name of the file, without folder and suffix."""
    spec_or_none: T | None
    error: SpecError | None = None
    """Why there is no Spec."""
    path: str = ""
    text: str = ""

    @property
    def spec(self) -> T:
        """The Spec. Raises `SpecError` if there is none."""
        if self.error is not None:
            raise self.error
        assert self.spec_or_none is not None
        return self.spec_or_none


_PYTHON_TYPE = re.compile(r"(bool|int|float|str|none|tuple\[.*|list\[.*|dict\[.*|\[key\])$")
"""Parts of locations with which pydantic names the types of a union."""


def checked(tree: dict[str, Any] | str, spec: type[T]) -> T:
    """The checked Spec of values by key, or of another text that it accepts. Raises `SpecError` with all errors."""
    try:
        return spec.model_validate(tree)
    except ValidationError as error:
        raise SpecError(messages(error.errors(), spec)) from None


def place_text(*location: str | int) -> str:
    """The text of a location: ('placements', 3, 'x') as 'placement 4.x', counted from 1."""
    parts: list[str] = []
    for part in location:
        if isinstance(part, int) and parts:
            parts[-1] = f"{re.sub('(?<=x)es$|s$', '', parts[-1])} {part + 1}"
        else:
            parts.append(short(str(part)))
    return ".".join(parts)


def short(text: str) -> str:
    """The first 100 characters of a text."""
    return text if len(text) <= 100 else f"{text[:100]}..."


def messages(errors: Sequence[Any], spec: type[BaseModel], at: Callable[..., str] = place_text) -> list[str]:
    """The errors of pydantic, and each of the broken rules, in our words. `at`: the text of a location."""
    texts: list[str] = []
    for error in errors:
        rules = error.get("ctx", {}).get("error")
        if isinstance(rules, RuleError):
            texts += [f"{at(*_location(error), *place)}: {text}" for place, text in rules.errors]
        else:
            texts.append(_message(error, spec, at))
    return texts


def with_line(name: str, location: Sequence[str | int], lines: Mapping[Key, int]) -> str:
    """What is at a location, with its line, or with that of what it is in."""
    key = tuple(map(str, location))
    line = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
    return f"{name} (line {line})" if line else name


def joined(problems: Iterable[Problem], lines: Mapping[Key, int]) -> list[str]:
    """The messages of problems, with the lines of their places."""

    def text(part: PlaceInFile | str) -> str:
        if isinstance(part, str):
            return part
        return with_line(part.name or place_text(*part.location), (part.file, *part.location), lines)

    return ["".join(map(text, problem)) for problem in problems]


_TEXTS = {
    **dict.fromkeys(("bool_type", "bool_parsing"), "must be true or false"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "must be a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "must be a number"),
    **dict.fromkeys(("list_type", "tuple_type"), "must be a list"),
    **dict.fromkeys(
        ("dict_type", "model_type", "model_attributes_type", "mapping_type"), "must be 'key: value' entries"
    ),
    **dict.fromkeys(("value_error", "assertion_error"), "{error}"),
    "missing": "is required",
    "string_type": "must be a text",
    "string_pattern_mismatch": "must have letters, digits, spaces, '_', '.' and '-' only",
    "string_too_long": "must have at most {max_length} characters",
    "int_parsing_size": "must be a smaller number",
    "finite_number": "must be a finite number",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "union_tag_invalid": "{discriminator} must be one of {expected_tags}",
    "union_tag_not_found": "{discriminator} is required",
    "too_short": "must have at least {min_length} entries",
    "too_long": "must have at most {max_length} entries",
    "invalid_key": "a key must be a text",
}
"""Type of an error of pydantic -> our text, with values of its context."""
_ENTRIES = {"model_type", "model_attributes_type"}
"""Errors where a Spec is expected."""
_NUMBERS = {"int_type", "int_parsing", "float_type", "float_parsing"}


def _advice(kind: str, value: Any) -> str:
    """What would be right instead of a value, for frequent mistakes; `kind`: the type of the error of pydantic."""
    if kind in _NUMBERS and isinstance(value, str):
        if match := re.fullmatch(r"([-+]?\d*),(\d+)", value):
            return f"; write {match[1] or 0}.{match[2]}, with a decimal point"
        if match := re.fullmatch(r"[-+]?[\d.]+ *([^\d\s.]+)", value):
            return f"; write a number without '{match[1]}', in the unit that the documentation of the key states"
    if kind in {"string_type", "invalid_key"} and isinstance(value, bool | int | float):
        reason = " (YAML reads yes, no, on and off as true and false)" if isinstance(value, bool) else ""
        return f"; put it in quotes{reason}"
    return ""


def _location(error: Any) -> tuple[str | int, ...]:
    return tuple(part for part in error["loc"] if not _PYTHON_TYPE.match(str(part)))


def _message(error: Any, spec: type[BaseModel], at: Callable[..., str]) -> str:
    """An error of pydantic as 'key (line n): what is wrong, what would be right'."""
    location = _location(error)
    place = at(*location) if location else spec.__name__.removesuffix("Spec").lower()
    if error["type"] == "extra_forbidden":
        known = _fields(spec, location[:-1])
        key = str(location[-1])
        text = f"'{short(key)}' is not a known key." + (f" {suggest(key, known)}" if known else "")
        before, colon, after = key.partition(":")
        if colon and before in known:
            text = f"write '{before}: {short(after)}', with a space after the colon"
        elif key.isdecimal():
            text += f" If '{short(key)}' belongs to a decimal number, write a point: 0.5"
    else:
        text = _TEXTS.get(error["type"], "is not valid").format(**error.get("ctx", {}))
        value = error.get("input")
        if error["type"] not in {"missing", "value_error", "assertion_error"} and not isinstance(value, dict | list):
            text += f", not {'empty' if value is None else short(_repr(value))}" + _advice(error["type"], value)
        if error["type"] in _ENTRIES and (known := _fields(spec, location)):
            text += f". Known: {', '.join(known)}."
    return f"{place}: {text}"


def _repr(value: Any) -> str:
    try:
        return repr(value)
    except ValueError:  # Python refuses to print so many digits
        return "a number with so many digits"


def _fields(spec: type[BaseModel], location: tuple[Any, ...]) -> list[str]:
    """Field names of the Spec at that location; none if it is not the location of a Spec."""
    specs = [spec]
    for part in location:
        fields = [candidate.model_fields[part].annotation for candidate in specs if part in candidate.model_fields]
        if fields:
            specs = _inner_specs(fields[0])
        elif isinstance(part, str) and len(specs) > 1:  # the tag of a union, such as 'line' of a shape
            specs = [candidate for candidate in specs if candidate.__name__.lower() == part]
    return sorted(specs[0].model_fields) if specs else []


def _inner_specs(annotation: Any) -> list[type[BaseModel]]:
    """The Specs in an annotation, such as those of a list, of a dictionary or of a union."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [inner for argument in getattr(annotation, "__args__", ()) for inner in _inner_specs(argument)]
