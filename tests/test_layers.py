"""Reads the imports of the package and holds the picture of ARCHITECTURE.md: arrows go down, never up."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import autodrive

PACKAGE = Path(autodrive.__file__).parent

LAYERS: list[set[str]] = [
    {"protocol", "model", "state", "transforms", "units", "errors", "descriptions", "cache", "jit", "pace"},
    {"actuators", "physics", "render", "sensors"},
    {"scenario", "vehicles", "maps"},
    {"world", "compile", "referee", "assets", "cameras", "scenery"},
    {"simulation", "camera_link", "camera_process", "child", "jpeg", "scene_camera", "scene_process"},
    {"app", "stage", "run_options", "run_summary", "bridge", "recording", "envs", "batch"}
    | {"browse", "browser", "doctor", "generate", "camera_watch", "portrait"},
    {"cli"},
]
"""Rooms from the ground up. `descriptions` reads files for all above; `cache` says where what can be made again is
kept; `jit` compiles; `pace` is arithmetic."""

NEED_PROTOCOL_ONLY = {"client", "devkit", "ros"}
"""They run where no simulator is installed."""

LEVEL = {room: level for level, rooms in enumerate(LAYERS) for room in rooms}
CORE = {room for room, level in LEVEL.items() if level < LEVEL["simulation"]}

FILES = sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[tuple[str, bool]]:
    """Every module that a file imports, with the name taken from it, and whether only the type checker sees it."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing_only = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node in typing_only
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relative to itself: say where from"
            for alias in node.names:
                yield f"{node.module}.{alias.name}", node in typing_only


def rooms_imported(path: Path, *, typing_too: bool) -> set[str]:
    """Rooms of this package that a file imports from; the public names of the package itself count as no room."""
    found: set[str] = set()
    for name, is_typing in imports(path):
        parts = name.split(".")
        if parts[0] == "autodrive" and len(parts) > 1 and (typing_too or not is_typing):
            found.add(parts[1])
    return found & {room_of(file) for file in FILES}


def packages_imported(path: Path) -> set[str]:
    return {name.split(".")[0] for name, is_typing in imports(path) if not is_typing}


def name_of(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def test_every_room_has_its_place_in_the_picture() -> None:
    assert {room_of(path) for path in FILES} <= set(LEVEL) | NEED_PROTOCOL_ONLY


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_imports_go_down_and_rooms_of_one_floor_of_parts_and_edges_do_not_know_each_other(path: Path) -> None:
    room = room_of(path)
    if room in NEED_PROTOCOL_ONLY:
        others = {"client", "devkit"} if room == "ros" else set()
        assert rooms_imported(path, typing_too=True) <= {room, "protocol", "errors", "units", "transforms"} | others
        return
    upward = {other for other in rooms_imported(path, typing_too=False) if LEVEL.get(other, 9) > LEVEL[room]}
    assert not upward, f"{name_of(path)} imports from above: {upward}"


@pytest.mark.parametrize("path", [path for path in FILES if room_of(path) in CORE], ids=name_of)
def test_below_the_simulation_nobody_knows_threads_or_the_wall_clock(path: Path) -> None:
    known = {"threading", "time", "datetime", "asyncio", "concurrent", "multiprocessing", "queue", "_thread"}
    assert not packages_imported(path) & known


@pytest.mark.parametrize("path", [path for path in FILES if room_of(path) in CORE], ids=name_of)
def test_below_the_simulation_nobody_opens_a_socket_or_runs_a_program(path: Path) -> None:
    known = {"socket", "ssl", "http", "urllib", "websockets", "subprocess", "signal", "select"}
    assert not packages_imported(path) & known


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_only_the_engine_and_the_mjcf_files_know_mujoco(path: Path) -> None:
    if name_of(path) != "physics/engine.py" and path.name != "mjcf.py":
        assert "mujoco" not in packages_imported(path)


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_only_the_door_to_the_compiler_and_what_must_be_inlined_know_numba(path: Path) -> None:
    if name_of(path) not in {"jit.py", "transforms.py", "physics/engine.py"}:
        assert "numba" not in packages_imported(path)


@pytest.mark.parametrize("room", ["bridge", "recording", "envs", "batch"])
def test_edges_do_not_know_each_other_and_touch_no_state(room: str) -> None:
    for path in (path for path in FILES if room_of(path) == room):
        known = rooms_imported(path, typing_too=True)
        others = {"bridge", "recording", "envs", "batch", "app", "cli", "browse", "doctor"} - {room}
        assert not known & (others | {"state", "model", "physics"}), name_of(path)


@pytest.mark.parametrize("part", ["actuators", "physics", "render", "sensors"])
def test_parts_are_given_what_they_need_and_never_the_world(part: str) -> None:
    for path in (path for path in FILES if room_of(path) == part):
        assert not rooms_imported(path, typing_too=True) & {"world", "compile", "referee", "simulation"}, name_of(path)


def test_there_is_no_place_called_utils() -> None:
    for path in FILES:
        assert not any(word in path.stem for word in ("util", "helper", "manager", "common", "misc")), name_of(path)


def test_the_picture_itself_can_fail(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("import time\nfrom autodrive.world import World\nfrom autodrive import cli\n")
    assert rooms_imported(bad, typing_too=False) == {"world", "cli"}
    assert packages_imported(bad) == {"time", "autodrive"}
