"""The public names of `autodrive`: lazy imports, types, and the error without the simulator."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import autodrive

HOMES = {
    alias.name: statement.module
    for statement in ast.parse(Path(autodrive.__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(statement, ast.ImportFrom)
    for alias in statement.names
    if alias.asname == alias.name  # `name as name` marks a public import
}
HEAVY = {"mujoco", "numba", "numpy", "pydantic", "shapely", "typer", "rich", "websockets", "moderngl", "yaml"}


@pytest.mark.parametrize("name", autodrive.__all__)
def test_every_public_name_is_the_object_of_its_module(name: str) -> None:
    home = importlib.import_module(f"autodrive.{HOMES[name]}")
    assert getattr(autodrive, name) is getattr(home, name)
    assert name in dir(autodrive)


def test_type_checkers_see_the_same_names() -> None:
    assert sorted(HOMES) == sorted(autodrive.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'autodrive' has no attribute 'wings'$"):
        _ = autodrive.wings  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(AttributeError, match=r"no attribute 'Wrold'. Did you mean 'World'\?"):
        _ = autodrive.Wrold  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.process
def test_import_loads_only_the_version_and_a_command_no_physics() -> None:
    # benchmarks/start.py measures the time of the import; here it is limited by what is imported
    code = (
        "import json, sys, autodrive\n"
        "first = sorted(sys.modules)\n"
        "autodrive.Command(0.5)\n"
        "print(json.dumps([first, sorted(sys.modules)]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    first, second = (set(names) for names in json.loads(done.stdout))
    ours = {name for name in first if name.startswith("autodrive")}
    assert ours == {"autodrive", "autodrive.base", "autodrive.base.version"}
    assert not HEAVY & first
    assert not {"mujoco", "numba"} & second


@pytest.mark.parametrize("missing", ["autodrive.world", "mujoco", "numba.core"])
def test_a_missing_simulator_is_reported_as_a_client_without_the_simulator(
    monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    with pytest.raises(ImportError, match=r"autodrive\.make needs the simulator.*autodrive-simulator.*pip install \."):
        make_without(monkeypatch, missing)


@pytest.mark.parametrize("missing", ["autodrive.wings", "autodrive.world.factory_parts", "some_package"])
def test_a_broken_import_of_the_simulator_is_reported_as_it_is(monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    with pytest.raises(ModuleNotFoundError, match=f"No module named '{missing}'"):
        make_without(monkeypatch, missing)


def make_without(monkeypatch: pytest.MonkeyPatch, missing: str, name: str = "make") -> None:
    """Use a public name, where its import fails because a module is missing."""

    def import_module(_: str) -> None:
        raise ModuleNotFoundError(f"No module named '{missing}'", name=missing)

    monkeypatch.delitem(vars(autodrive), name, raising=False)
    monkeypatch.setattr(importlib, "import_module", import_module)
    getattr(autodrive, name)


def test_the_dependencies_that_the_client_leaves_out_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[1]
    simulator, client = (dependencies(root / file) for file in ("pyproject.toml", "clients/python/pyproject.toml"))
    import_names = {
        "backports-zstd": "backports",
        "mujoco-core": "mujoco",
        "protobuf": "google",
        "pyyaml": "yaml",
        "resvg-py": "resvg_py",
    }
    for name in simulator - client:
        with pytest.raises(ImportError, match=r"autodrive\.make needs the simulator"):
            make_without(monkeypatch, import_names.get(name, name))
    for name in client:
        with pytest.raises(ModuleNotFoundError, match=f"No module named '{name}'"):
            make_without(monkeypatch, name)


def dependencies(file: Path) -> set[str]:
    project = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
    return {re.split(r"[\s<>=~;\[]", text, maxsplit=1)[0] for text in project["dependencies"]}


def test_the_default_scenario_is_the_same_everywhere() -> None:
    from autodrive.cli.run import run
    from autodrive.run import RunOptions
    from autodrive.scenario import DEFAULT

    of_make, of_command = (inspect.signature(called).parameters["scenario"].default for called in (autodrive.make, run))
    assert {of_make, RunOptions().scenario} == {DEFAULT}
    assert of_command.default is None
    assert f"{DEFAULT} without a person" in " ".join(of_command.help.split())
