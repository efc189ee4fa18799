"""Code that another process compiles is loaded here; if that process fails, the code is compiled here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.base import compile_ahead as module
from autodrive.base import jit
from autodrive.base.compile_ahead import compile_ahead
from autodrive.scenario.tracks import image

pytestmark = pytest.mark.process


def halved(x: float) -> float:
    return 0.5 * x


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))  # for the other process
    monkeypatch.setattr(jit, "CACHE", tmp_path / jit.CACHE.name)
    monkeypatch.setattr(module, "cpu_count", lambda: 2)


def test_what_another_process_compiled_is_loaded_and_its_names_are_shown() -> None:
    original: Any = image.unfilter
    function: Any = jit.jit(original.py_func)
    arguments: Any = np.ones((2, 4), np.uint8), 1
    names: list[str] = []
    with jit.compiling(names.append):
        compile_ahead(function, *arguments)
        jit.resolved(function, *arguments)
    assert sum(function.stats.cache_hits.values()) == 1
    assert sum(function.stats.cache_misses.values()) == 0
    assert "unfilter" in names


def test_what_the_other_process_could_not_compile_is_compiled_here() -> None:
    function: Any = jit.jit(halved)  # the other process does not find this module
    compile_ahead(function, 3.0)
    assert jit.resolved(function, 3.0)(3.0) == 1.5
    assert sum(function.stats.cache_misses.values()) == 1


def test_nothing_is_started_for_code_that_is_in_the_cache() -> None:
    function: Any = jit.jit(halved)
    jit.resolved(function, 3.0)
    compile_ahead(jit.jit(halved), 3.0)
    assert not jit.awaited


def test_nothing_is_compiled_twice_where_the_cache_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(jit, "CACHE", tmp_path / "file" / "cache")
    original: Any = image.unfilter
    compile_ahead(jit.jit(original.py_func), np.ones((2, 4), np.uint8), 1)
    assert not jit.awaited
