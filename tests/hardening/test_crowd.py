"""Two hundred hostile connections: the run goes on as if they were not there, and others are served."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path
from statistics import median

import pytest

from tests.support.attackers import CROWD
from tests.support.command_line import Started
from tests.support.hardening import attackers, cases, memory, open_files
from tests.support.native_clients import NativeClient, connected
from tests.support.waiting import free_port, wait_until


@pytest.mark.process
def test_a_run_goes_on_beside_two_hundred_connections(tmp_path: Path) -> None:
    port, summary = free_port(), tmp_path / "s.json"
    arguments = ("--port", str(port), "--no-browser", "--no-cameras", "--summary", str(summary))
    run = Started(tmp_path, "run", "plane", *arguments)
    run.wait_for("press Ctrl-C to stop")
    pid = run.process.pid
    try:
        with connected(port) as before, attackers(port, CROWD):
            _watch(before, cases(2.0, 20.0))  # until the buffers of all connections are in use
            start = memory(pid)
            with connected(port) as honest:
                factors = [one for _ in range(cases(1, 35)) for who in (honest, before) for one in _watch(who, 1.0)]
                if cases(short=False, long=True):
                    end = memory(pid)
                    print(f"memory {start:.1f} MB, then {end:.1f} MB")
                    print(f"real-time factors: median {median(factors):.4f}, least {min(factors):.4f}")
                    assert end < 1.05 * start
        wait_until(lambda: open_files(pid) < 50)
    finally:
        code = run.end(signal.SIGTERM)
    assert code == 0, run.messages.read_text()
    assert "Traceback" not in run.messages.read_text()
    print(f"{json.loads(summary.read_text())['real_time_factor']:.4f} real-time factor of the run")


def _watch(client: NativeClient, seconds: float) -> list[float]:
    """Receive Frames of so much wall time and 30 ticks at least; the real-time factors that were reported."""
    end = time.monotonic() + seconds
    factors, first = [], client.until("Frame")["tick"]
    tick = first
    while time.monotonic() < end or abs(tick - first) < 30:
        message = client.receive()
        if message["type"] == "Status":
            factors.append(message["real_time_factor"])
        elif message["type"] == "Frame":
            tick = message["tick"]
            first = min(first, tick)  # after a reset
    return factors
