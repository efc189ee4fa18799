"""Faults of the machine: few file descriptors, no shared memory folder, a clock that jumps."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.command_line import AUTODRIVE
from tests.support.hardening import mount_or_skip
from tests.support.waiting import LIMIT

pytestmark = pytest.mark.process

RUN = [
    "run",
    "mini_map",
    "--headless",
    "--cameras",
    "--no-lockstep",
    "--speed",
    "max",
    "--duration",
    "0.5",
    "--summary",
    "s.json",
]


def run_in_shell(before: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the simulator after the commands of a shell."""
    command = f"{before}; exec {shlex.join([*AUTODRIVE, *RUN])}"
    return subprocess.run(["sh", "-c", command], check=False, capture_output=True, text=True, timeout=LIMIT, cwd=folder)


@pytest.mark.parametrize("descriptors", [9])
def test_few_file_descriptors_cost_the_cameras_at_most(descriptors: int, tmp_path: Path, gl: str) -> None:
    """The physics needs none; one line reports what is missing."""
    done = run_in_shell(f"ulimit -n {descriptors}", tmp_path)
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "s.json").read_text())["ticks"] == 50


def test_without_a_shared_memory_folder_the_cameras_work(tmp_path: Path, gl: str) -> None:
    """In a mount namespace of its own, in which /dev/shm cannot be written."""
    mount_or_skip(["unshare", "-m", "mount", "-t", "tmpfs", "-o", "ro", "tmpfs", "/dev/shm"])
    inner = f"mount -t tmpfs -o ro tmpfs /dev/shm && exec {shlex.join([*AUTODRIVE, *RUN])}"
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", inner], check=False, capture_output=True, text=True, timeout=LIMIT, cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "s.json").read_text())["cameras"]["error"] is None


JUMPING_CLOCK = """
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long jump(void) { static long calls; return ++calls % 2 ? -3600 * calls : 3600 * calls; }
int clock_gettime(clockid_t clock, struct timespec *now) {
    long failed = syscall(SYS_clock_gettime, clock, now);
    if (clock == CLOCK_REALTIME) now->tv_sec += jump();
    return (int)failed;
}
int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec t;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &t);
    now->tv_sec = t.tv_sec;
    now->tv_usec = t.tv_nsec / 1000;
    return 0;
}
time_t time(time_t *now) {
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    if (now) *now = t.tv_sec;
    return t.tv_sec;
}
"""
"""A library in which the wall clock jumps by hours, forward and back, whenever it is read."""


def test_a_wall_clock_that_jumps_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "clock.c").write_text(JUMPING_CLOCK)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", "clock.so", "clock.c"], check=True, cwd=tmp_path)
    environment = {**os.environ, "LD_PRELOAD": str(tmp_path / "clock.so")}
    code = "import time; print(abs(time.time() - time.time()) > 3000.0)"
    proof = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment)
    assert proof.stdout == "True\n"
    done = subprocess.run(
        [*AUTODRIVE, *["run", "plane", "--headless", "--no-cameras", "--duration", "0.5", "--summary", "s.json"]],
        check=False,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        cwd=tmp_path,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "s.json").read_text())
    assert summary["ticks"] == 50
    assert 0.4 < summary["wall_time"] < LIMIT  # of half a second in real time, on a machine that may be busy
