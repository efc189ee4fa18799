"""A start that takes long says what goes on at least every 5 s: the scripts, and the compilation."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.machinery import SourceFileLoader
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from rich.console import Console

from autodrive.cli.narrated import narrated
from autodrive.cli.status import StatusDisplay
from autodrive.run.runner import COMPILED_FUNCTIONS
from tests.support.waiting import wait_until

SCRIPT = Path(__file__).parents[2] / "scripts" / "progress"
LONG = 70
"""A slow step [s]."""


class Clock:
    """Shows a time that the test sets, and notes when something is written."""

    def __init__(self) -> None:
        self.time = 0.0
        self.lines: list[tuple[float, str]] = []

    def __call__(self) -> float:
        return self.time

    def write(self, text: str) -> None:
        self.lines.append((self.time, text))

    def run(self, tick: Callable[[], object]) -> float:
        """Let `LONG` pass; the longest time without a line [s]."""
        while self.time < LONG:
            self.time += 0.5
            tick()
        times = [0.0, *(time for time, _ in self.lines), LONG]
        return max(b - a for a, b in pairwise(times))


@pytest.fixture(scope="module")
def progress() -> Any:
    module = ModuleType("progress")
    SourceFileLoader("progress", str(SCRIPT)).exec_module(module)
    return module


@pytest.mark.parametrize(
    ("is_terminal", "first", "last"),
    [
        (False, "autodrive: building: 3 s, 3 MB in build\n", "built\n"),
        (True, "\r\033[Kautodrive: building: 1 s, 1 MB in build", "\r\033[Kbuilt\n"),
    ],
)
def test_a_script_says_every_5_s_what_a_silent_command_does(
    progress: Any, *, is_terminal: bool, first: str, last: str
) -> None:
    clock = Clock()
    shown = progress.Progress(
        "building", clock.write, is_terminal=is_terminal, clock=clock, size=lambda: clock.time * 1e6, where=" in build"
    )
    assert clock.run(shown.tick) <= 5.0
    assert clock.lines[0][1] == first
    shown.passed_on("built\n")
    assert "".join(text for _, text in clock.lines).endswith(last)


def test_a_script_says_nothing_while_the_command_does(progress: Any) -> None:
    clock = Clock()
    shown = progress.Progress("building", clock.write, clock=clock)

    def tick() -> None:
        if clock.time % 3 == 0:
            shown.passed_on("line\n")
        shown.tick()

    assert clock.run(tick) <= 5.0
    assert {text for _, text in clock.lines} == {"line\n"}


def test_a_script_passes_on_output_and_exit_code_and_waits_for_nothing_else() -> None:
    done = subprocess.run(
        [sys.executable, SCRIPT, "trying", "", "sh", "-c", "sleep 20 & echo out; echo error >&2; exit 3"],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (3, "", "out\nerror\n")


def test_imports_are_narrated(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.cli.narrated.SILENCE", 0.01)
    said: list[str] = []

    def has_said_twice() -> bool:
        said.append(capsys.readouterr().err)
        return "".join(said).count("starting, 0 s\n") >= 2

    with narrated("starting"):
        wait_until(has_said_twice)


@pytest.mark.parametrize(
    ("link", "address"),
    [
        ("http://127.0.0.1:8730/", ""),
        ("http://127.0.0.1:8731/", "127.0.0.1:8731"),
        ("http://[::1]:8730/", "[::1]:8730"),
        ("http://[fe80::1]:8731/", "[fe80::1]:8731"),
        ("http://192.0.2.7:8730/?token=0123456789abcdef", "http://192.0.2.7:8730/?token=0123456789abcdef"),
    ],
)
def test_a_run_prints_the_address_that_clients_need(link: str, address: str) -> None:
    console = Console(file=io.StringIO(), width=200)
    StatusDisplay("loading the world", "running", opens_browser=False, console=console).serving(link)
    assert isinstance(console.file, io.StringIO)
    assert link in console.file.getvalue()
    found = re.search(r"clients need this address:  autodrive\.Client\('(.*)'\)", console.file.getvalue())
    assert (found[1] if found else "") == address


def test_without_a_terminal_the_compilation_prints_counts_every_5_s() -> None:
    clock = Clock()
    console = Console(file=io.StringIO(), width=200)
    console.print = lambda text, **_: clock.write(text)  # type: ignore[method-assign]
    display = StatusDisplay("loading the world", "running", console=console, clock=clock)

    def tick() -> None:
        if clock.time > 9 and clock.time % 2 == 0:
            display.compiled("advance")
        display.narrate()

    assert clock.run(tick) <= 5.0
    texts = [text for _, text in clock.lines]
    assert texts[:2] == ["loading the world, 3 s", "loading the world, 6 s"]
    assert texts[3].startswith("compiling the physics for this machine")
    assert texts[4] == f"compiling 2 of about {COMPILED_FUNCTIONS} functions, 13 s"
