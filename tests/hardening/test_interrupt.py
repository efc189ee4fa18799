"""Signals, a closed terminal and closed streams end no command without what it owes, and without a traceback."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader

from autodrive.cli.stopping import StopSignals
from tests.support.command_line import AUTODRIVE, call
from tests.support.hardening import cases
from tests.support.waiting import LIMIT, wait_until

PROGRAM = """
import os, signal, sys
from autodrive.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have started the tests with SIGINT ignored
number, sys.argv = int(sys.argv[1]), ["autodrive", *sys.argv[2:]]
imports = 0
def interrupt(event, arguments):
    global imports
    if event == "import":
        imports += 1
        if imports == number:
            os.kill(os.getpid(), signal.SIGINT)
sys.addaudithook(interrupt)
main()
"""
"""`autodrive`, which gets the signal at the import of that number."""


@pytest.mark.process
@pytest.mark.parametrize("number", cases([1, 2, 40, 150], list(range(1, 190, 2))))
@pytest.mark.parametrize("arguments", [["--help"], ["run", "plane", "--headless", "--duration", "1000"]])
def test_a_signal_during_the_imports_ends_the_program_at_once_and_without_a_traceback(
    number: int, arguments: list[str]
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(number), *arguments],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 130
    assert done.stderr == done.stdout == ""


@pytest.mark.process
def test_a_run_whose_terminal_is_closed_writes_its_recording_and_summary(tmp_path: Path) -> None:
    """The kernel sends SIGHUP; after that, each line that is printed to the terminal would be an error."""
    recording, summary = tmp_path / "r.mcap", tmp_path / "s.json"
    options = ("--no-browser", "--no-cameras", "--port", "0", "--record", str(recording), "--summary", str(summary))
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [*AUTODRIVE, "run", "plane", *options])
    printed = b""

    def is_running() -> bool:
        nonlocal printed
        printed += os.read(terminal, 65536)
        return b"V1" in printed  # the status line

    wait_until(is_running)
    os.close(terminal)
    _, status = os.waitpid(pid, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    ended = json.loads(summary.read_text())
    assert (ended["ended_by"], ended["recording"]["error"]) == ("SIGHUP", "")
    with recording.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        last = max(message.log_time for _, _, message in reader.iter_messages(["/autodrive/frame"]))
    assert last * 1e-9 == pytest.approx(ended["simulated_time"], abs=0.015)  # a tick, and the rounding


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_campaign_that_gets_a_signal_writes_the_results_of_its_finished_runs(
    tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "driver.py").write_text(f"""
import os
from autodrive import Command
class Driver:
    def reset(self, scene):
        if scene.scenario.seed == 2:
            os.kill(os.getpid(), {int(number)})
    def act(self, frame):
        return Command()
""")
    (tmp_path / "c.yaml").write_text(
        "title: A signal\nscenario: plane\ndriver: driver.py:Driver\nseeds: 5\nstop: {time: 0.1}\n"
        "metrics: [collisions]\n"
    )
    before = signal.getsignal(number)
    done = call("campaign", "c.yaml", "--workers", "0", "--no-cache", cwd=tmp_path)
    assert done.returncode == 130, done.stderr
    assert "2 of 5 runs: 2 done" in done.stdout
    assert json.loads((tmp_path / "c_results" / "summary.json").read_text())["rows"] == 2
    assert signal.getsignal(number) is before


def test_a_hang_up_that_is_ignored_stays_ignored() -> None:
    """As by nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals(lambda _: None) as signals:
            signals.catch()
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.process
def test_a_command_whose_output_is_closed_ends_as_usual() -> None:
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" >&-', "sh", *AUTODRIVE, "list", "scenarios"], check=False, stderr=subprocess.PIPE
    )
    assert (done.returncode, done.stderr) == (0, b"")
