"""Devkit scripts that are killed at random moments: the simulator connects to the next one, and nothing is left."""

from __future__ import annotations

import contextlib
import random
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from autodrive import Simulation
from autodrive.connect.bridge import devkit
from autodrive.connect.bridge.devkit import DevkitBridge
from tests.connect.bridge.conftest import ROOT, script
from tests.support.hardening import cases, memory, open_files
from tests.support.waiting import free_port, wait_until

KILLED_SCRIPT = Path(__file__).parents[1] / "support" / "killed_script.py"
FOLLOW_LOOP = ROOT / "examples" / "devkit" / "follow_loop.py"

STAGES = {"listening": 1, "connected": 2, "open": 2, "commands": 5}
"""What a script prints before it is killed, and how often."""


@contextlib.contextmanager
def started(port: int) -> Iterator[subprocess.Popen[str]]:
    """A script of the standard library, which starts in some milliseconds; it is killed at the end."""
    command = [sys.executable, "-S", "-E", str(KILLED_SCRIPT), str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def left_behind() -> tuple[int, int]:
    """Threads and open files of this process."""
    return threading.active_count(), open_files()


@pytest.mark.process
def test_a_simulator_connects_again_however_its_script_was_killed(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(devkit, "RETRY_MAX", 0.2)
    random_ = random.Random(3)
    port, kills = free_port(), cases(12, 1000)
    stages = Counter[str]()
    begin = time.monotonic()
    before, start = (0, 0), 0.0
    with DevkitBridge(simulation, port=port) as bridge:
        for number in range(kills):
            (stage,) = random_.choices(list(STAGES), list(STAGES.values()))
            with started(port) as process:
                assert process.stdout is not None
                while process.stdout.readline() != f"{stage}\n":
                    assert process.poll() is None
                time.sleep(random_.uniform(0.0, 0.05))
            stages[stage] += 1
            if number == min(kills // 5, 100):
                wait_until(lambda: bridge.status == "connecting")
                before, start = left_behind(), memory()
        with started(port):  # the last one is not killed before the car drives
            commands = bridge.counters.commands_received
            wait_until(lambda: bridge.counters.commands_received > commands + 10)
        wait_until(lambda: bridge.status == "connecting")
        assert left_behind()[0] == before[0]
        wait_until(lambda: left_behind()[1] <= before[1])
        assert bridge.counters.reconnects > stages["commands"] - 2
        end = memory()
    print(
        f"{kills} kills in {time.monotonic() - begin:.0f} s, {dict(stages)}; memory {start:.1f} MB, then {end:.1f} MB"
    )
    assert not simulation.error
    if cases(short=False, long=True):
        assert end < 1.05 * start


@pytest.mark.process
@pytest.mark.toolchain
@pytest.mark.parametrize("stack", ["legacy", "newest"])
def test_a_simulator_connects_again_to_a_killed_script_with_the_libraries_of_the_devkit(
    simulation: Simulation, stack: str
) -> None:
    random_ = random.Random(4)
    port = free_port()
    with DevkitBridge(simulation, port=port) as bridge:
        for _ in range(cases(2, 25)):
            commands = bridge.counters.commands_received
            with script(stack, FOLLOW_LOOP, port=port):
                wait_until(lambda commands=commands: bridge.counters.commands_received > commands)
                time.sleep(random_.uniform(0.0, 0.2))
    assert not simulation.error
