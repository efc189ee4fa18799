"""What hostile clients cost a run: its pace, its memory, and what an honest viewer gets beside each attack.

    uv run benchmarks/hostile.py [--seconds 20] [--only quiet,resets,crowd]

Each attack meets a new `autodrive run boxes --no-cameras` in real time. The attackers (tests/support/attackers.py) run
in a process of their own; with two cores they take time from the simulator all the same. Columns: real-time factor,
median and least of means over a second; late ticks in a second; Frames per second of a viewer that wants 60; processor
time of the simulator, share of a core; its memory [MB] after `WARM_UP` seconds of the attack and at the end.
"""

from __future__ import annotations

import argparse
import os
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from autodrive.connect.client import Client

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from tests.support.attackers import CROWD  # noqa: E402
from tests.support.hardening import attackers, memory  # noqa: E402
from tests.support.waiting import free_port  # noqa: E402

WARM_UP = 5.0

ATTACKS: dict[str, dict[str, int]] = {
    "quiet": {},
    "a reset flood": {"resets": 1},
    "20 reset floods": {"resets": 20},
    "5 that load scenarios": {"loads": 5},
    "5 that reset and leave": {"hit_and_run": 5},
    "10 that undo": {"undoes": 10},
    "5 at the bridge": {"connects_the_bridge": 5},
    "10 refused": {"refused": 10},
    "10 that drive": {"drives": 10},
    "10 that subscribe": {"subscribes": 10},
    "10 that ping": {"pings": 10},
    "10 with garbage": {"garbage": 10},
    "50 that never read": {"deaf": 50},
    "50 viewers": {"viewer": 50},
    "25 HTTP floods": {"gets": 25},
    "200 connections": CROWD,
    "a script flood": {"commands": 1},
    "a script flood, 60 kB": {"long_commands": 1},
}


@contextmanager
def simulator(port: int, script: int) -> Iterator[int]:
    """A run; its process identifier."""
    words = ["run", "boxes", "--no-cameras", "--no-browser", "--port", str(port), "--devkit", f"127.0.0.1:{script}"]
    command = [sys.executable, "-c", "from autodrive.cli import main; main()", *words]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            while socket.socket().connect_ex(("127.0.0.1", port)):
                time.sleep(0.1)
            time.sleep(2.0)
            yield process.pid
        finally:
            process.terminate()


def processor_time(pid: int) -> float:
    """Processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(name: str, seconds: float) -> None:
    port, script = free_port(), free_port()
    with (
        simulator(port, script) as pid,
        Client(f"127.0.0.1:{port}", frame_rate=60.0, scans=False) as viewer,
        attackers(script if name.startswith("a script") else port, ATTACKS[name]),
    ):
        watch(viewer, WARM_UP)
        start, busy, begin = memory(pid), processor_time(pid), time.monotonic()
        factors, late, frames = watch(viewer, seconds)
        wall = time.monotonic() - begin
        share = (processor_time(pid) - busy) / wall
        print(
            f"{name:22} {statistics.median(factors):7.3f} {min(factors):7.3f} {late / wall:6.1f} {frames / wall:8.1f} "
            f"{share:8.2f} {start:8.1f} {memory(pid):7.1f}",
            flush=True,
        )


def watch(viewer: Client, seconds: float) -> tuple[list[float], int, int]:
    """Real-time factors, late ticks, and the number of Frames that came."""
    factors: list[float] = []
    first = latest = None
    frames, end = 0, time.monotonic() + seconds
    while time.monotonic() < end:
        view = viewer.wait_news(10.0 + seconds)
        frames += view.is_new
        view.read()
        if view.status is not latest and view.status is not None:
            latest = view.status
            first = first or latest
            factors.append(latest.real_time_factor)
    assert first is not None
    assert latest is not None
    return factors, latest.late_ticks - first.late_ticks, frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each attack")
    parser.add_argument("--only", default=",".join(ATTACKS), help="beginnings of the names of attacks, with commas")
    arguments = parser.parse_args()
    print(f"{'attack':22} {'factor':>7} {'least':>7} {'late/s':>6} {'frames/s':>8} {'cores':>8} {'MB':>8} {'then':>7}")
    for name in ATTACKS:
        if any(name.startswith(begin) for begin in arguments.only.split(",")):
            measure(name, arguments.seconds)


if __name__ == "__main__":
    main()
