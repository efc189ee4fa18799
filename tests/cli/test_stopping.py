"""A signal ends a run, a race and a replay at once: what they owe is written, and nothing is torn down after that."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest

import autodrive
from autodrive.recording import Recorder
from tests.support.command_line import Started
from tests.support.waiting import is_alive, wait_until

PROGRAM = """
import atexit, sys
from autodrive.cli import main
atexit.register(print, "torn down")
sys.argv = ["autodrive", *sys.argv[1:]]
main()
"""
SCRIPT = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(1000)  # {port}"


@pytest.mark.process
@pytest.mark.parametrize(
    ("number", "arguments", "owed"),
    [
        (signal.SIGTERM, ("run", "plane", "--no-browser", "--port", "0"), "ended by SIGTERM"),
        (
            signal.SIGHUP,
            ("race", "practice", "--headless", "-o", "{folder}/race", "--script", 'python -c "{script}"'),
            "results: ",
        ),
        (signal.SIGHUP, ("replay", "{folder}/run.mcap", "--no-browser", "--port", "0"), "replaying 'run.mcap'"),
    ],
    ids=["run", "race", "replay"],
)
def test_a_signal_ends_a_command_without_tearing_its_modules_down(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals, arguments: tuple[str, ...], owed: str
) -> None:
    """Which would need half a second of a processor, and seconds on a busy machine."""
    monkeypatch.chdir(tmp_path)
    world = autodrive.make("plane")
    with Recorder(tmp_path / "run.mcap", world, name="run"):
        world.step()
    words = [word.replace("{folder}", str(tmp_path)).replace("{script}", SCRIPT) for word in arguments]
    command = Started(tmp_path, *words, program=[sys.executable, "-c", PROGRAM])
    command.wait_for("press Ctrl-C to stop")
    if arguments[0] == "race":
        wait_until(Path("pid").exists)
    assert command.end(number) == 0
    assert owed in command.messages.read_text()
    assert "torn down" not in command.messages.read_text()
    if arguments[0] == "race":
        assert Path("race", "lines.png").exists()
        wait_until(lambda: not is_alive(int(Path("pid").read_text())))
