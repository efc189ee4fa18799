"""Commands that start processes leave none behind, however they end.

AUTODRIVE_HARDENING=long ends each command in each way.
"""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

import autodrive
from autodrive.recording import Recorder
from tests.support.hardening import LONG, cases
from tests.support.waiting import LIMIT, wait_until

pytestmark = pytest.mark.process

WRAPPER = "setsid sleep 1000 & sleep 1000 & timeout 1000 sh -c 'echo $0; sleep 1000; true' $1"
"""A devkit script in a wrapper, which never answers, and two processes in the background: three times `sleep`, in three
groups."""
DRIVER = """
import subprocess, time

class Driver:
    def reset(self, scene):
        pass

    def act(self, frame):
        subprocess.Popen(["setsid", "sleep", "1000"])
        time.sleep(1000)
"""
CAMPAIGN = """
title: Left behind
scenario: plane
driver: {driver}
seeds: 2
time_limit: {limit}
"""
COMMANDS = {
    "run": ("run plane --headless --cameras --record run.mcap", 2, ""),
    "race": ('race practice --headless --script "bash wrap.sh {port}" -o race', 3, "sleep"),
    "campaign": ("campaign scripts.yaml -o results --workers 2", 6, "sleep"),
    "campaign-python": ("campaign drivers.yaml -o results --workers 2", 2, "sleep"),
    "film": ("film drive.mcap --output film.mp4 --size 320x180 --quality small --speed 0.1", 1, ""),
    "compile": ("compile", 2, ""),
}
"""Command lines, and how many processes of which name are there before the end; without a name, of any."""
FILMING = ".film.part.mp4"
"""File that exists while a film is made; it is empty before the first image."""
ENDS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
SHORT = {
    ("run", signal.SIGINT),
    ("race", signal.SIGTERM),
    ("race", signal.SIGKILL),
    ("campaign", signal.SIGHUP),
    ("campaign-python", signal.SIGKILL),
    ("film", signal.SIGINT),
    ("film", signal.SIGKILL),
}
CASES = [
    pytest.param(command, end, id=f"{command}-{end.name}")
    for command in COMMANDS
    for end in ENDS
    if LONG or (command, end) in SHORT
]


def marked(mark: str, name: str = "") -> set[int]:
    """Processes with that word in their environment, whose name begins so."""
    found = set()
    for path in Path("/proc").iterdir():
        if path.name.isdecimal():
            try:
                has_name = (path / "comm").read_text().startswith(name)
                if has_name and mark.encode() in (path / "environ").read_bytes():
                    found.add(int(path.name))
            except OSError:  # it has ended, or belongs to somebody else
                continue
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in {"wrap.sh": WRAPPER, "driver.py": DRIVER}.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def write_campaigns(folder: Path, limit: int) -> None:
    for name, driver in {"scripts": "bash wrap.sh {port}", "drivers": "driver.py:Driver"}.items():
        (folder / f"{name}.yaml").write_text(CAMPAIGN.format(driver=driver, limit=limit))


def started(arguments: str, folder: Path, mark: str, **variables: str) -> subprocess.Popen[bytes]:
    line = [str(Path(sys.executable).with_name("autodrive")), *shlex.split(arguments)]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started the tests without it
    try:
        return subprocess.Popen(
            line,
            cwd=folder,
            env={**os.environ, "AUTODRIVE_TEST_MARK": mark, **variables},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    finally:
        signal.signal(signal.SIGINT, before)


def size(file: Path) -> int:
    return file.stat().st_size if file.exists() else 0


@pytest.mark.parametrize(("command", "end"), CASES)
def test_no_process_is_left_behind(command: str, end: signal.Signals, folder: Path) -> None:
    write_campaigns(folder, 300)
    if command == "film":
        world = autodrive.make("plane")
        with Recorder(folder / "drive.mcap", world):
            for _ in range(200):
                world.step({})
    arguments, count, name = COMMANDS[command]
    mark = uuid.uuid4().hex

    def is_ready() -> bool:
        return len(marked(mark, name)) >= count and (command != "film" or size(folder / FILMING) > 0)

    variables = {"NUMBA_CACHE_DIR": str(folder)} if command == "compile" else {}  # nothing is compiled there
    with started(arguments, folder, mark, **variables) as process:
        try:
            wait_until(lambda: is_ready() or process.poll() is not None)
            assert process.poll() is None, "the command ended by itself"
            process.send_signal(end)
            process.wait(LIMIT)
        finally:
            process.kill()
    wait_until(lambda: not marked(mark))
    assert not (folder / "film.mp4").exists()
    assert (folder / FILMING).exists() == (command == "film" and end == signal.SIGKILL)


@pytest.mark.parametrize("drivers", cases(["scripts"], ["scripts", "drivers"]))
def test_a_run_over_its_time_limit_leaves_no_process_behind(drivers: str, folder: Path) -> None:
    write_campaigns(folder, 2)
    mark = uuid.uuid4().hex
    with started(f"campaign {drivers}.yaml -o results --workers 2", folder, mark) as process:
        process.wait()
    assert "did not end within 2 s" in (folder / "results" / "summary.json").read_text()
    wait_until(lambda: not marked(mark))
