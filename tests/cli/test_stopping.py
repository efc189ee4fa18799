"""A signal ends a run, a race and a replay at once: what they owe is written, and nothing is torn down after that."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import autodrive
from autodrive.recording import Recorder
from tests.support.command_line import AUTODRIVE, Started
from tests.support.waiting import LIMIT, is_alive, wait_until

PROGRAM = """
import atexit, sys
from autodrive.cli import main
atexit.register(print, "torn down")
sys.argv = ["autodrive", *sys.argv[1:]]
main()
"""
SCRIPT = "import os, time; open('{folder}/pid', 'w').write(str(os.getpid())); time.sleep(1000)  # {port}"


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
    words = [word.replace("{script}", SCRIPT).replace("{folder}", str(tmp_path)) for word in arguments]
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


RUN = ["run", "plane", "--headless", "--summary", "summary.json", "--duration"]


def shell(arguments: list[str], reader: str, folder: Path) -> subprocess.Popen[bytes]:
    """A shell with a pipe, as a group of its own like that of a terminal."""
    line = f"exec 2>&1; {shlex.join([*AUTODRIVE, *arguments])} | {reader}"
    return subprocess.Popen(["sh", "-c", line], cwd=folder, stdout=subprocess.PIPE, start_new_session=True)


@pytest.mark.process
def test_the_summary_is_written_if_the_reader_of_the_output_has_ended(tmp_path: Path) -> None:
    with shell([*RUN, "2"], "head -1", tmp_path) as process:
        process.communicate()
    assert json.loads((tmp_path / "summary.json").read_text())["ended_by"] == "duration"


@pytest.mark.process
def test_the_summary_is_written_if_ctrl_c_ends_the_reader_of_the_output_too(tmp_path: Path) -> None:
    with shell([*RUN, "1000"], "tee log.txt", tmp_path) as process:
        assert process.stdout is not None
        while b"press Ctrl-C" not in process.stdout.readline():
            pass
        os.killpg(process.pid, signal.SIGINT)
    wait_until((tmp_path / "summary.json").exists)
    assert json.loads((tmp_path / "summary.json").read_text())["ended_by"] == "SIGINT"


DROPPED = """
import ctypes, os, signal
from autodrive.cli.stopping import StopSignals, interruptible

stopped = []
with interruptible():
    ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.SIGINT))()
    with StopSignals(stopped.append) as signals:
        signals.catch()
        print(stopped, flush=True)
        os._exit(0)
"""
"""A signal during a function that C code calls, which drops the exception."""


@pytest.mark.process
def test_a_signal_whose_exception_was_dropped_ends_a_command_later() -> None:
    done = subprocess.run([sys.executable, "-c", DROPPED], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "['SIGINT']", done.stderr


ELSEWHERE = """
import signal, threading, time

def receive():
    time.sleep(0.2)
    signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
    time.sleep(1000)

receiver = threading.Thread(target=receive, daemon=True)
"""
"""A signal for another thread than the main one, which handles it."""
WAITING = {
    "replay": """
import autodrive
from autodrive.connect.server.served import PageOptions
from autodrive.recording import Recorder
from autodrive.recording.replay import ReplayOptions, replay

world = autodrive.make("plane")
with Recorder("run.mcap", world):
    world.step()
stop = threading.Event()
signal.signal(signal.SIGTERM, lambda *_: stop.set())
replay("run.mcap", ReplayOptions(page=PageOptions(port=0)), stop=stop, on_start=lambda _: receiver.start())
""",
    "devkit server": """
from autodrive.connect.devkit.server import Server

signal.signal(signal.SIGTERM, signal.default_int_handler)
with Server(lambda _: {}, port=0) as server:
    receiver.start()
    try:
        server.wait()
    except KeyboardInterrupt:
        pass
""",
}


@pytest.mark.process
@pytest.mark.parametrize("program", WAITING)
def test_a_signal_that_another_thread_receives_ends_a_wait(tmp_path: Path, program: str) -> None:
    line = [sys.executable, "-c", ELSEWHERE + WAITING[program]]
    assert subprocess.run(line, cwd=tmp_path, check=False, timeout=LIMIT).returncode == 0
