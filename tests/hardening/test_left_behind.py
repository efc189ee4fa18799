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
from tests.support.hardening import LONG
from tests.support.waiting import LIMIT, wait_until

pytestmark = pytest.mark.process

WRAPPER = "sleep 1000 & echo $1; sleep 1000"
"""A devkit script in a wrapper, with a process in the background; it never answers."""
CAMPAIGN = """
title: Wrapped
scenario: plane
driver: sh wrap.sh {{port}}
seeds: 2
time_limit: {limit}
"""
COMMANDS = {
    "run": ("run plane --headless --cameras --record run.mcap", 2),
    "race": ('race practice --headless --script "sh wrap.sh {port}" -o race', 4),
    "campaign": ("campaign campaign.yaml -o campaign --workers 2", 9),
    "film": ("film drive.mcap --output film.mp4", 1),
}
"""Command lines, and how many processes are there before the end."""
ENDS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
CASES = [
    pytest.param(command, end, id=f"{command}-{end.name}")
    for i, command in enumerate(COMMANDS)
    for j, end in enumerate(ENDS)
    if LONG or i == j or (command, end) in {("race", signal.SIGKILL), ("campaign", signal.SIGKILL)}
]


def marked(mark: str) -> set[int]:
    """Processes with that word in their environment."""
    found = set()
    for path in Path("/proc").iterdir():
        if path.name.isdecimal():
            try:
                if mark.encode() in (path / "environ").read_bytes():
                    found.add(int(path.name))
            except OSError:  # it has ended, or belongs to somebody else
                continue
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "wrap.sh").write_text(WRAPPER)
    return tmp_path


def started(arguments: str, folder: Path, mark: str) -> subprocess.Popen[bytes]:
    line = [str(Path(sys.executable).with_name("autodrive")), *shlex.split(arguments)]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started the tests without it
    try:
        return subprocess.Popen(
            line,
            cwd=folder,
            env={**os.environ, "AUTODRIVE_TEST_MARK": mark},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize(("command", "end"), CASES)
def test_no_process_is_left_behind(command: str, end: signal.Signals, folder: Path) -> None:
    if command == "campaign":
        (folder / "campaign.yaml").write_text(CAMPAIGN.format(limit=300))
    if command == "film":
        world = autodrive.make("plane")
        with Recorder(folder / "drive.mcap", world):
            for _ in range(1000):
                world.step({})
    arguments, count = COMMANDS[command]
    mark = uuid.uuid4().hex
    with started(arguments, folder, mark) as process:
        wait_until(lambda: len(marked(mark)) >= count or process.poll() is not None)
        assert process.poll() is None, "the command ended by itself"
        process.send_signal(end)
        try:
            process.wait(LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    wait_until(lambda: not marked(mark))


def test_a_run_over_its_time_limit_leaves_no_process_behind(folder: Path) -> None:
    (folder / "campaign.yaml").write_text(CAMPAIGN.format(limit=2))
    mark = uuid.uuid4().hex
    with started("campaign campaign.yaml -o campaign --workers 2", folder, mark) as process:
        process.wait()
    assert "did not end within 2 s" in (folder / "campaign" / "summary.json").read_text()
    wait_until(lambda: not marked(mark))
