"""Imports go down the groups, never up; table and picture in ARCHITECTURE.md are what the code imports."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.support import layers
from tests.support.layers import (
    GROUPS,
    LEVEL,
    PACKAGE,
    ROOMS,
    distributions_imported,
    group_of,
    modules_imported,
    name_of,
)

FILES = layers.files()
REAL_TIME = {
    "base/child_process.py",
    "base/compile_ahead.py",
    "base/installation.py",
    "base/keeper.py",
    "base/tcp.py",
    "base/turns.py",
    "graphics/cameras/jpeg.py",
    "graphics/cameras/process_cameras.py",
    "graphics/cameras/render_process.py",
    "graphics/cameras/render_worker.py",
    "graphics/cameras/scene_views.py",
    "world/batch/batch_world.py",
    "world/one_thread.py",
}
"""They compile beside this process, wait for another one, end others, render and encode images asynchronously, set
options of connections, step worlds in several threads, refuse a second thread, or read the address of a package."""

IN_THE_TICK = [
    path
    for path in FILES
    if LEVEL[group_of(path)] <= LEVEL["world"]
    and name_of(path) not in REAL_TIME
    and not name_of(path).startswith("world/simulation/")
]
ALONE = [path for path in FILES if name_of(path).startswith(("connect/client/", "connect/devkit/", "connect/ros/"))]
"""They run where no simulator is installed."""
TESTS = Path(__file__).parent
PUBLIC_PROTOCOLS = {"_repr_html_", "_repr_png_", "_replace", "_asdict", "_fields", "_exit"}
"""Of Jupyter, named tuples and `os`."""


def test_the_first_level_has_the_groups_and_the_faces() -> None:
    assert {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()} == {*GROUPS}
    assert {path.stem for path in PACKAGE.glob("*.py")} == {"__init__", *layers.FACES}


def test_imports_go_down() -> None:
    for path in FILES:
        upward = {other for other in layers.groups_imported(path) if LEVEL[other] > LEVEL[group_of(path)]}
        assert not upward, f"{name_of(path)} imports from above: {upward}"


def test_there_are_few_arrows_between_groups() -> None:
    assert len(layers.arrows()) <= 50


def test_the_whole_repository_has_few_rooms_and_few_arrows_and_none_goes_up() -> None:
    upward = {(room, other) for room, other in layers.room_arrows() if ROOMS.index(other) > ROOMS.index(room)}
    assert upward == set()
    assert len(layers.room_arrows()) <= 80
    assert len(ROOMS) <= 18


def test_rooms_are_found_in_files_of_each_kind(tmp_path: Path) -> None:
    texts = {
        "a.py": '"""ros/ in a comment"""\nimport autodrive\nfrom autodrive.ros import Bridge\nSOURCE = "clients/cpp"\n',
        "b.ts": "// Generated from src/autodrive/protocol by scripts/\nimport A from '../src/autodrive/graphics/a'\n",
        "c.cpp": "#include <autodrive/client.hpp>\n// src/autodrive/world\n",
        "d": "#!/bin/sh\n# benchmarks/\ncd web && .venv/bin/python -m autodrive.run.x && exec .venv/bin/autodrive\n",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    assert {name: layers.rooms_named(tmp_path / name) for name in texts} == {
        "a.py": {"autodrive", "connect", "clients"},
        "b.ts": {"protocol", "graphics"},
        "c.cpp": {"clients"},
        "d": {"web", "run", "cli"},
    }


def test_there_is_no_circle_of_files() -> None:
    assert layers.cycle_in(layers.import_graph()) == []


def test_no_group_has_more_than_a_fifth_of_the_lines() -> None:
    lines = {group: layers.lines_of(group) for group in GROUPS}
    assert {group: count for group, count in lines.items() if count > sum(lines.values()) / 5} == {}


def test_what_runs_without_a_simulator_imports_none() -> None:
    allowed = ("base.", "protocol.", "connect.client.", "connect.devkit.", "connect.ros.")
    for path in ALONE:
        others = {name for name in modules_imported(path) if not f"{name}.".startswith(allowed)}
        assert not others, f"{name_of(path)} imports {others}"


def test_in_a_tick_nothing_uses_threads_or_the_wall_clock() -> None:
    known = {"threading", "time", "datetime", "asyncio", "concurrent", "multiprocessing", "queue", "_thread"}
    for path in IN_THE_TICK:
        assert not distributions_imported(path) & known, name_of(path)


def test_in_a_tick_nothing_opens_a_socket_or_starts_a_program() -> None:
    known = {"socket", "ssl", "http", "urllib", "websockets", "subprocess", "signal", "select"}
    for path in IN_THE_TICK:
        assert not distributions_imported(path) & known, name_of(path)


def test_only_the_engine_and_the_mjcf_modules_import_mujoco() -> None:
    for path in FILES:
        if name_of(path) != "physics/engine.py" and path.name != "mjcf.py":
            assert "mujoco" not in distributions_imported(path), name_of(path)


def test_only_few_modules_import_numba() -> None:
    for path in FILES:
        if name_of(path) not in {"base/jit.py", "base/elementary.py", "base/pinned.py", "physics/engine.py"}:
            assert "numba" not in distributions_imported(path), name_of(path)


@pytest.mark.parametrize("edge", ["connect/server/", "connect/bridge/", "recording/"])
def test_edges_read_frames_and_not_the_state(edge: str) -> None:
    for path in (path for path in FILES if name_of(path).startswith(edge)):
        inner = {
            name
            for name in modules_imported(path)
            if name.startswith("physics.") and not name.startswith(("physics.actuators.", "physics.sensors."))
        }
        assert not inner, f"{name_of(path)} imports {inner}"


def test_there_is_no_module_called_utils() -> None:
    for path in FILES:
        assert not any(word in path.stem for word in ("util", "helper", "manager", "common", "misc")), name_of(path)


def test_table_and_picture_in_the_architecture_are_those_of_the_code() -> None:
    text = layers.ARCHITECTURE.read_text(encoding="utf-8")
    assert layers.BEGIN + layers.table() + layers.END in text, "run: python -m tests.support.layers"
    assert layers.picture() == layers.PICTURE.read_text(encoding="utf-8"), "run: python -m tests.support.layers"


def test_a_violation_is_found(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("import time\nfrom autodrive.world import World\nfrom autodrive import cli\n")
    assert layers.groups_imported(bad) == {"world", "cli"}
    assert distributions_imported(bad) == {"time", "autodrive"}
    assert sorted(layers.cycle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}})[:-1]) == ["a", "b", "c"]


def test_no_test_uses_a_private_name_of_another_module() -> None:
    found = {
        f"{path.relative_to(TESTS)}: {name}"
        for path in TESTS.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in private_names(node)
    }
    assert found == set()


def private_names(node: ast.AST) -> list[str]:
    """Names with a leading underscore that a node takes from an object other than `self`, or from a module."""
    match node:
        case ast.Attribute(value=ast.Name(id="self" | "cls")):
            names = []
        case ast.Attribute(attr=name):
            names = [name]
        case ast.ImportFrom(module=module, names=imported):
            names = [*(module or "").split("."), *(alias.name for alias in imported)]
        case ast.Import(names=imported):
            names = [part for alias in imported for part in alias.name.split(".")]
        case ast.Call(func=ast.Attribute(attr="setattr" | "delattr" | "object"), args=[target, *words]):
            texts = [one.value for one in (target, *words[:1]) if isinstance(one, ast.Constant)]
            names = [part for text in texts if isinstance(text, str) for part in text.split(".")]
        case _:
            names = []
    return [name for name in names if re.match(r"_(?!_)", name) and name not in PUBLIC_PROTOCOLS]
