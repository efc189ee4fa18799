"""`import autodrive` is light, and every public name is there."""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import autodrive

HEAVY = {"mujoco", "numba", "numpy", "pydantic", "shapely", "typer", "rich", "websockets", "moderngl", "yaml"}


@pytest.mark.parametrize("name", autodrive.__all__)
def test_every_public_name_can_be_used_and_is_the_one_of_its_home(name: str) -> None:
    home = importlib.import_module(f"autodrive.{autodrive._home_of[name]}")
    assert getattr(autodrive, name) is getattr(home, name)
    assert name in dir(autodrive)


def test_what_a_type_checker_sees_is_what_can_be_used() -> None:
    tree = ast.parse(Path(autodrive.__file__).read_text(encoding="utf-8"))
    (typing_block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {
        alias.name: statement.module
        for statement in typing_block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
        if alias.asname == alias.name  # the form that says: this is public
    }
    assert seen == {name: f"autodrive.{module}" for name, module in autodrive._home_of.items()}


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'autodrive' has no attribute 'wings'"):
        _ = autodrive.wings  # pyright: ignore[reportAttributeAccessIssue]


def test_import_loads_nothing_heavy() -> None:
    code = "import sys, autodrive; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert not HEAVY & set(done.stdout.split())


def test_a_command_can_be_made_without_physics() -> None:
    code = "import sys, autodrive; autodrive.Command(0.5); print(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert not {"mujoco", "numba"} & set(done.stdout.split())


def test_import_takes_less_than_0_15_s() -> None:
    # the least of five, so that a busy machine does not decide; measured inside, without the start of Python
    code = "import time; t = time.perf_counter(); import autodrive; print(time.perf_counter() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=60).stdout)
        for _ in range(5)
    ]
    assert min(times) < 0.15


def test_types_are_shipped() -> None:
    assert (Path(autodrive.__file__).parent / "py.typed").is_file()
