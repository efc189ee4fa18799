"""Import paths that the documentation names."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "examples").rglob("*.[mp][dy]"))]


def documented() -> list[str]:
    """Modules and names below `autodrive` that pages and examples name or import today."""
    found: set[str] = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for module, names in re.findall(r"from (autodrive[\w.]*) import (\([^)]*\)|[^\n(#\\]+)", text):
            found |= {
                f"{module}.{name.split(' as ')[0].strip()}" for name in names.strip("()").split(",") if name.strip()
            }
        found |= set(re.findall(r"`(autodrive(?:\.[a-z_0-9]+)+(?:\.[A-Z]\w*)?)`", text))
    others = (".launch", ".rviz", ".v2", ".CompassReading")  # the last one is made in docs/adding_a_sensor.md
    adapters = "autodrive.experiments.envs.adapters."  # each needs its library
    return sorted(
        name.removeprefix("autodrive.") for name in found if not name.endswith(others) and not name.startswith(adapters)
    )


@pytest.mark.parametrize("path", documented())
def test_a_documented_path_can_be_imported(path: str) -> None:
    assert imported(f"autodrive.{path}") is not None


def imported(path: str) -> object:
    """The module of that name, or else the name in its module."""
    try:
        return importlib.import_module(path)
    except ModuleNotFoundError as error:
        if not f"{path}.".startswith(f"{error.name}.") and "is not a package" not in str(error):
            raise
    module, _, name = path.rpartition(".")
    return getattr(imported(module), name)
