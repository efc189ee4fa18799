"""Imports go down the layers, never up, and the table in ARCHITECTURE.md is what the code imports."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support import layers
from tests.support.layers import ALONE, EDGES, LEVEL, distributions_imported, member_of, members_imported, name_of

FILES = layers.files()
REAL_TIME = {
    "cameras/camera_worker.py",
    "cameras/jpeg.py",
    "cameras/process.py",
    "cameras/scene_process.py",
    "cameras/scene_worker.py",
    "cameras/worker.py",
    "physics/one_thread.py",
    "protocol/tcp_options.py",
}
"""They render and encode images asynchronously, set options of connections, or refuse a second thread."""
IN_THE_TICK = [
    path for path in FILES if LEVEL.get(member_of(path), 9) < LEVEL["simulation"] and name_of(path) not in REAL_TIME
]


def test_every_module_has_its_layer() -> None:
    assert {member_of(path) for path in FILES} <= set(LEVEL) | ALONE


def test_imports_go_down() -> None:
    for path in FILES:
        member = member_of(path)
        if member not in ALONE:
            known = members_imported(path, typing_too=True)
            upward = {other for other in known if LEVEL.get(other, LEVEL["server"] + 1) > LEVEL[member]}
            assert not upward, f"{name_of(path)} imports from above: {upward}"


def test_what_runs_without_a_simulator_imports_none() -> None:
    for path in FILES:
        member = member_of(path)
        if member in ALONE:
            others = {"client", "devkit"} if member == "ros" else set()
            known = members_imported(path, typing_too=True)
            assert known <= {member} | layers.ALLOWED_ALONE | others, name_of(path)


def test_there_is_no_import_cycle() -> None:
    assert layers.cycle_in(layers.import_graph()) == []


def test_the_root_stays_small() -> None:
    assert len(list(layers.PACKAGE.glob("*.py"))) <= 20


def test_no_package_holds_more_than_a_tenth_of_the_lines() -> None:
    lines = {member: layers.lines_of(member) for member in {member_of(path) for path in FILES}}
    total = sum(lines.values())
    assert {member: count for member, count in lines.items() if count > total / 10} == {}


def test_below_the_simulation_nothing_uses_threads_or_the_wall_clock() -> None:
    known = {"threading", "time", "datetime", "asyncio", "concurrent", "multiprocessing", "queue", "_thread"}
    for path in IN_THE_TICK:
        assert not distributions_imported(path) & known, name_of(path)


def test_below_the_simulation_nothing_opens_a_socket_or_starts_a_program() -> None:
    known = {"socket", "ssl", "http", "urllib", "websockets", "subprocess", "signal", "select"}
    for path in IN_THE_TICK:
        assert not distributions_imported(path) & known, name_of(path)


def test_only_the_engine_and_the_mjcf_modules_import_mujoco() -> None:
    for path in FILES:
        if name_of(path) != "physics/engine.py" and path.name != "mjcf.py":
            assert "mujoco" not in distributions_imported(path), name_of(path)


def test_only_few_modules_import_numba() -> None:
    for path in FILES:
        if name_of(path) not in {"jit.py", "elementary.py", "physics/engine.py"}:
            assert "numba" not in distributions_imported(path), name_of(path)


@pytest.mark.parametrize("edge", sorted(EDGES))
def test_edges_do_not_import_each_other_or_the_state(edge: str) -> None:
    for path in (path for path in FILES if member_of(path) == edge):
        known = members_imported(
            path, typing_too=edge != "server"
        )  # the server starts and stops the bridge it is given
        assert not known & (EDGES - {edge} | {"run", "cli", "state", "model", "physics"}), name_of(path)


def test_parts_do_not_import_the_world() -> None:
    for path in FILES:
        if member_of(path) in {"actuators", "physics", "render", "sensors"}:
            known = members_imported(path, typing_too=True)
            assert not known & {"world", "compile", "referee", "simulation"}, name_of(path)


def test_there_is_no_module_called_utils() -> None:
    for path in FILES:
        assert not any(word in path.stem for word in ("util", "helper", "manager", "common", "misc")), name_of(path)


def test_the_table_in_the_architecture_is_that_of_the_code() -> None:
    text = layers.ARCHITECTURE.read_text(encoding="utf-8")
    assert layers.BEGIN + layers.table() + layers.END in text, "run: python -m tests.support.layers"


def test_a_violation_is_found(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("import time\nfrom autodrive.world import World\nfrom autodrive import cli\n")
    assert members_imported(bad, typing_too=False) == {"world", "cli"}
    assert distributions_imported(bad) == {"time", "autodrive"}
    assert sorted(layers.cycle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}})[:-1]) == ["a", "b", "c"]
