"""Caches that are damaged, cannot be read or written, or are filled by two processes at once: the start works."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from autodrive.base import jit
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
    assert output() == "autodrive: compiling the physics for this machine, once: this takes 20 to 70 s\n"
    file.unlink()
    assert output() == ""


def test_a_file_that_cannot_be_read_is_one_line(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    """A folder in its place, which not even root can read as a file."""
    file.unlink()
    file.mkdir()
    assert is_compiled()
    (line,) = caplog.messages
    assert "cannot be read" in line


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
def test_without_a_writable_folder_the_start_works_with_one_line() -> None:
    output, lines = ended(start(NUMBA_CACHE_DIR="", XDG_CACHE_HOME="", HOME="/proc/1/home"))
    assert output == "(-0.25, 0.25) ['slab']"
    (line,) = lines
    assert "cannot be written" in line


@pytest.mark.process
def test_two_first_starts_at_once_share_one_cache(tmp_path: Path) -> None:
    both = [start(NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    for process in both:
        output, lines = ended(process)
        assert output.startswith("(-0.25, 0.25)")
        assert not lines
    assert ended(start(NUMBA_CACHE_DIR=str(tmp_path))) == ("(-0.25, 0.25) []", [])
    assert {path.suffix for path in tmp_path.rglob("*") if path.is_file()} == {".code"}
