"""Caches that are damaged, cannot be read or written, or are filled by two processes at once: the start works."""

from __future__ import annotations

import contextlib
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
import pytest
from numba.core import config
from numba.core.registry import cpu_target

from autodrive.base import jit
from autodrive.base.cache import user_name
from autodrive.base.turns import Turns
from autodrive.cli.doctor import run_checks
from tests.support.hardening import cases
from tests.support.waiting import LIMIT


def doubled(x: float) -> float:
    return 2.0 * x


def is_compiled() -> bool:
    """Whether a start with this cache compiles the function; its answer is right in any case."""
    compiled: list[str] = []
    with jit.compiling(compiled.append):
        assert jit.jit(doubled)(1.5) == 3.0
    return compiled == ["doubled"]


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is logged."""
    monkeypatch.setattr(jit, "reported", [])
    return caplog.messages


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: list[str]) -> Path:
    """The cache file of the function, after a first start."""
    monkeypatch.setattr(jit, "CACHE", tmp_path / "cache")
    assert is_compiled()
    assert not is_compiled()
    (file,) = (tmp_path / "cache").iterdir()
    return file


def damages(whole: bytes) -> Iterator[bytes]:
    """Contents that a crash, a full disk or a bad disk leaves."""
    yield b""
    yield b"garbage"
    yield bytes(len(whole))
    for part in cases([0.01, 0.5, 0.99], [k / 100 for k in range(100)]):
        place = int(part * len(whole))
        yield whole[:place]  # truncated
        yield whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]  # a single bit


def test_a_damaged_file_is_one_line_and_is_built_again(
    file: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    for damage in damages(file.read_bytes()):
        file.write_bytes(damage)
        check_repair(caplog, monkeypatch)


def check_repair(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    """The damage of a file is one line, and the function is compiled once."""
    caplog.clear()
    monkeypatch.setattr(jit, "reported", [])
    assert is_compiled()
    (line,) = caplog.messages
    assert "damaged" in line
    assert not is_compiled()


def test_a_compilation_is_announced_once_unless_its_functions_are_shown(
    file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def output() -> str:
        with jit.announced():
            jit.jit(doubled)(1.5)
        return capsys.readouterr().err

    monkeypatch.setattr(jit, "announcements", [])
    assert output() == ""  # from the cache
    file.unlink()
    with jit.compiling(lambda _: None):
        assert output() == ""
    file.unlink()
    assert output() == f"autodrive: compiling the physics for this machine, once: this takes {jit.DURATION}\n"
    file.unlink()
    assert output() == ""


def test_a_file_that_cannot_be_read_is_one_line(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A folder in its place, which not even root can read as a file."""
    file.unlink()
    file.mkdir()
    assert is_compiled()
    (line,) = caplog.messages
    assert "cannot be read" in line


# -- compiled code of a wheel ---------------------------------------------------------------------------------------


def tripled(x: float) -> float:
    return 3.0 * x


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lines: list[str]) -> Path:
    """The file of the function in a wheel that was compiled for this processor; the cache of the user is empty."""
    monkeypatch.setattr(jit, "CACHE", tmp_path / "compiled")
    assert is_compiled()
    (file,) = (tmp_path / "compiled").iterdir()
    monkeypatch.setattr(jit, "SHIPPED", tmp_path / "compiled")
    target: Any = cpu_target.target_context
    monkeypatch.setattr(jit, "BASELINE", target.codegen().magic_tuple()[1:])
    monkeypatch.setattr(jit, "runs_baseline", lambda: True)
    monkeypatch.setattr(jit, "CACHE", tmp_path / "cache")
    return file


def test_the_code_of_a_wheel_is_used_and_nothing_is_written(shipped: Path) -> None:
    assert not is_compiled()
    assert not jit.CACHE.exists()


def test_the_code_of_this_machine_comes_before_that_of_a_wheel(shipped: Path, caplog: pytest.LogCaptureFixture) -> None:
    jit.CACHE.mkdir()
    shutil.copy(shipped, jit.CACHE)
    shipped.write_bytes(b"garbage")
    assert not is_compiled()
    assert not caplog.messages


def test_the_code_of_a_wheel_for_another_processor_is_not_used(shipped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit, "runs_baseline", lambda: False)
    assert is_compiled()


@pytest.mark.parametrize("missing", ["avx2", "bmi2", "cx16"])
def test_a_processor_without_a_feature_of_the_baseline_cannot_run_its_code(
    missing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs_baseline = jit.runs_baseline.__wrapped__
    features = dict.fromkeys(jit.BASELINE_NEEDS, True)
    monkeypatch.setattr(jit.llvm, "get_host_cpu_features", lambda: features)
    assert runs_baseline()
    features[missing] = False
    assert not runs_baseline()
    del features[missing]
    assert not runs_baseline()


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        (numba, "__version__", "0.99.0"),
        (llvmlite, "__version__", "0.99.0"),
        (np, "__version__", "2.99.0"),
        (sys.implementation, "cache_tag", "cpython-399"),
        (config, "OPT", 1),
        (config, "SLP_VECTORIZE", 1),
    ],
)
def test_the_code_of_a_wheel_for_other_versions_is_not_used(
    shipped: Path, monkeypatch: pytest.MonkeyPatch, owner: object, name: str, value: object
) -> None:
    with monkeypatch.context() as other:
        other.setattr(owner, name, value)
        jit.versions.cache_clear()
        assert is_compiled()
    jit.versions.cache_clear()


def scaled(path: Path, factor: float) -> float:
    """The answer of a compiled function of a module with that text, whose bytecode does not contain the factor."""
    path.write_text(f"FACTOR = {factor}\ndef scaled(x):\n    return FACTOR * x\n")
    jit.source_digest.cache_clear()
    jit.file_digest.cache_clear()
    return jit.jit(runpy.run_path(str(path))["scaled"])(1.0)


def test_the_code_of_a_wheel_for_another_source_is_not_used(
    shipped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as built:
        built.setattr(jit, "CACHE", jit.SHIPPED)
        assert scaled(tmp_path / "module.py", 2.0) == 2.0
    compiled: list[str] = []
    with jit.compiling(compiled.append):
        assert scaled(tmp_path / "module.py", 2.0) == 2.0
        assert not compiled
        assert scaled(tmp_path / "module.py", 3.0) == 3.0
        assert compiled == ["scaled"]


def test_code_for_other_options_is_not_used(shipped: Path) -> None:
    compiled: list[str] = []
    with jit.compiling(compiled.append):
        jit.jit_uncounted(doubled)(1.5)
    assert compiled == ["doubled"]


def test_a_damaged_file_of_a_wheel_is_one_line_and_is_replaced_by_code_of_this_machine(
    shipped: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    for damage in damages(shipped.read_bytes()):
        shipped.write_bytes(damage)
        check_repair(caplog, monkeypatch)
        shutil.rmtree(jit.CACHE)


def test_doctor_says_which_compiled_code_the_next_start_uses(shipped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def text() -> str:
        return next(check.text for check in run_checks() if check.subject == "compiled code")

    versions = jit.SHIPPED / jit.VERSIONS
    versions.write_text(jit.versions())
    assert text().endswith("cache (empty: the code of the wheel is used)")
    versions.write_text("numba 0.99")
    assert "the first start compiles, because the code of the wheel is for other versions: numba 0.99" in text()
    monkeypatch.setattr(jit, "SHIPPED", jit.SHIPPED / "missing")
    assert text().endswith("(empty: the first start compiles)")
    assert is_compiled()
    assert text().endswith("(ready)")


def test_a_whole_file_with_the_name_of_another_one_is_not_used(shipped: Path, caplog: pytest.LogCaptureFixture) -> None:
    other: Any = jit.jit(tripled)
    assert other(1.5) == 4.5
    (file,) = jit.CACHE.iterdir()
    shutil.move(file, shipped)
    assert is_compiled()
    (line,) = caplog.messages
    assert "damaged" in line


START = """
import sys
from autodrive.base.jit import compiling
from autodrive.physics.ray import slab
compiled = []
with compiling(compiled.append):
    print(slab(0.5, 0.0, 2.0), compiled)
if not compiled and "scipy.linalg" in sys.modules:
    print("scipy was loaded, which takes as long as everything else")
"""


def start(**environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", START],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> tuple[str, list[str]]:
    """What the program printed, and the lines that were logged."""
    output, errors = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, errors
    return output.strip(), errors.splitlines()


@pytest.mark.process
def test_without_a_writable_folder_the_start_works_with_one_line(tmp_path: Path) -> None:
    (tmp_path / f"autodrive-{user_name()}").write_text("a file where the folder should be")
    output, lines = ended(start(NUMBA_CACHE_DIR="", XDG_CACHE_HOME="", HOME="/proc/1/home", TMPDIR=str(tmp_path)))
    assert output == "(-0.25, 0.25) ['slab']"
    (line,) = lines
    assert "cannot be written" in line


COMPILES = """
import sys
from autodrive.base import jit
from autodrive.scenario.tracks import image
import numpy as np
print("ready", flush=True)
sys.stdin.readline()
names = []
with jit.compiling(names.append):
    image.unfilter(np.ones((2, 4), np.uint8), 1)
print(*names)
"""


@pytest.mark.process
def test_processes_that_need_the_same_code_at_once_compile_it_once(tmp_path: Path) -> None:
    options = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    with contextlib.ExitStack() as stack:
        processes = [
            stack.enter_context(subprocess.Popen([sys.executable, "-c", COMPILES], env=variables, **options))
            for _ in range(cases(3, 8))
        ]
        for process in processes:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
        for process in processes:
            assert process.stdin is not None
            process.stdin.write("\n")
            process.stdin.flush()
        compiled = [process.communicate()[0].split() for process in processes]
    names = [name for each in compiled for name in each]
    assert "unfilter" in names
    assert len(names) == len(set(names)), compiled
    assert not [*tmp_path.rglob("*.lock")]


def test_a_process_that_ends_in_its_turn_holds_nobody_up(tmp_path: Path) -> None:
    path = tmp_path / "code"
    line = "import os, sys; from pathlib import Path; from autodrive.base.turns import Turns"
    subprocess.run([sys.executable, "-c", f"{line}; Turns().take(Path(sys.argv[1])); os._exit(1)", path], check=False)
    turns = Turns()
    assert not turns.take(path)
    turns.end(path)
    assert not turns.take(path)
    turns.end(path)
