"""The kinds of YAML files: the files of each that are included in the package, and files of the user."""

from __future__ import annotations

import os
import reprlib
from pathlib import Path
from typing import Literal, TypeAlias, TypeVar, get_args

from autodrive.base.errors import SpecError
from autodrive.base.readable import refused
from autodrive.base.specs import Spec, is_yaml, short
from autodrive.base.suggest import suggest
from autodrive.base.yaml_files import MAX_CHARACTERS, checked_source, source

Kind: TypeAlias = Literal["vehicle", "module", "map", "track", "ruleset", "scenario"]
T = TypeVar("T", bound=Spec)


def names(kind: Kind) -> list[str]:
    """Sorted names of the files of that kind that are included in the package."""
    return sorted(path.stem for path in _folder(kind).glob("*.yaml"))


def find(kind: Kind, name: str | Path, *, also: Kind | None = None) -> Path:
    """Path of an included file, given its name, or of a YAML file, given its path. Raises `SpecError`.

    `also`: another kind, whose names the error lists too.
    """
    if not isinstance(name, str | Path):
        wanted = f"a name, such as '{names(kind)[0]}', or the path of a YAML file"
        raise SpecError([f"a {kind} must be {wanted}, not {reprlib.repr(name)}"])
    if len(str(name)) > MAX_CHARACTERS:  # the text of a file instead of its path
        raise SpecError([f"{kind} '{short(str(name))}' is not known. {suggest('', names(kind))}"])
    path = Path(name)
    if is_yaml(path):
        if problem := refused(path):
            raise SpecError([problem])
        check_exists(path, *filter(None, (kind, also)))
        return path
    included = _folder(kind) / f"{name}.yaml"
    if os.path.isfile(included):
        return included
    known = suggest(str(name), names(kind) + (names(also) if also else [])) + _other_kind(kind, str(name))
    if os.path.isfile(f"{name}.yaml"):
        known += f" If you mean the file, write '{name}.yaml'."
    raise SpecError([f"{kind} '{short(str(name))}' is not known. {known}"])


def check_exists(path: Path, *kinds: Kind) -> None:
    """Raises `SpecError` if a file is not there; `kinds`: the error says which of them has its name."""
    if os.path.isfile(path):  # False also for a name that no file can have
        return
    text = f"file '{short(str(path))}' {'is not a file' if os.path.exists(path) else 'does not exist'}"
    if kind := next((kind for kind in kinds if path.stem in names(kind)), None):
        text += f". If you mean the {kind} of this package, write '{path.stem}'"
    raise SpecError([text])


def read(kind: Kind, name: str | Path, spec: type[T]) -> T:
    """The checked Spec of an included file (by name) or of another file (by path).

    Raises `SpecError` with all errors of the file.
    """
    return checked_source(source(find(kind, name)), spec)


def titles(kind: Kind, spec: type[Spec]) -> dict[str, str]:
    """Titles by name of all files of that kind that are included in the package."""
    return {name: getattr(read(kind, name, spec), "title", "") for name in names(kind)}


def _other_kind(kind: Kind, name: str) -> str:
    """Says what a name that is not one of a kind stands for; empty if for nothing."""
    other = next((other for other in get_args(Kind) if name in names(other)), None)
    if other is None:
        return ""
    use = ""
    if kind == "scenario" and other in {"map", "track"}:
        use = f"; a scenario there has the line 'map: {name}', in Python ScenarioSpec(map='{name}')"
    elif kind == "scenario" and other == "vehicle":
        use = f"; a scenario with it has the line 'vehicles: {{V1: {{type: {name}}}}}'"
    return f" '{name}' is a {other}{use}."


def _folder(kind: Kind) -> Path:
    return Path(__file__).parent / "data" / f"{kind}s"
