"""Processes that end with the process that started them, and the number of processors that a process may use."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from autodrive.base import child_process
from autodrive.base.child_process import Group, cpu_count, quotas
from tests.support.waiting import is_alive, wait_until

WRAPPER = 'sleep 1000 & echo $! >"$0.child"; sleep 1000 & wait'
"""Starts a process that it leaves behind, and one that it waits for."""


def wrapper(folder: Path) -> Path:
    path = folder / "wrap.sh"
    path.write_text(WRAPPER)
    return path


def child_of(wrapper: Path) -> int:
    note = wrapper.with_name(f"{wrapper.name}.child")
    wait_until(lambda: note.exists() and note.read_text().endswith("\n"))
    return int(note.read_text())


def test_a_group_ends_with_all_its_processes(tmp_path: Path) -> None:
    path = wrapper(tmp_path)
    group = Group(["sh", str(path)], cwd=tmp_path)
    child = child_of(path)
    assert group.exit_code is None
    assert is_alive(child)
    group.close()
    wait_until(lambda: not is_alive(child))
    assert group.exit_code is not None


def test_what_a_program_leaves_behind_ends_when_its_group_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "wrap.sh"
    path.write_text('sleep 1000 & echo $! >"$0.child"; exit 7')
    group = Group(["sh", str(path)], cwd=tmp_path)
    child = child_of(path)
    wait_until(lambda: group.exit_code == 7)
    assert is_alive(child)
    group.close()
    wait_until(lambda: not is_alive(child))


STARTS_A_GROUP = """
import sys, time
from pathlib import Path
from autodrive.base.child_process import Group, start_module
group = Group(["sh", sys.argv[1]], cwd=Path("."))
print(start_module("tests.base.test_child_process").pid, flush=True)
time.sleep(1000)
"""


def main() -> None:
    """Of a process that `start_module` starts: it is busy and does not read its stdin."""
    while True:
        pass


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_processes_end_with_the_one_that_started_them(tmp_path: Path, end: signal.Signals) -> None:
    path = wrapper(tmp_path)
    root = str(Path(__file__).parents[2])
    line = [sys.executable, "-c", STARTS_A_GROUP, str(path)]
    options = {"env": {**os.environ, "PYTHONPATH": root}, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(line, cwd=root, **options) as parent:  # type: ignore[call-overload]
        assert parent.stdout is not None
        started = [child_of(path), int(parent.stdout.readline())]
        assert all(map(is_alive, started))
        parent.send_signal(end)
    wait_until(lambda: not any(map(is_alive, started)))


def test_a_program_that_does_not_exist_is_an_error_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no program")
    with pytest.raises(FileNotFoundError):
        Group(["no-such-program"], cwd=tmp_path)
    with pytest.raises(FileNotFoundError):
        Group(["./missing.sh"], cwd=tmp_path)
    with pytest.raises(PermissionError):
        Group(["./notes.txt"], cwd=tmp_path)


@pytest.mark.parametrize(
    ("files", "count"),
    [
        ({"proc/self/cgroup": "0::/job/step\n", "sys/fs/cgroup/job/step/cpu.max": "max 100000\n"}, []),
        ({"proc/self/cgroup": "0::/job/step\n", "sys/fs/cgroup/job/cpu.max": "250000 100000\n"}, [2.5]),
        ({"proc/self/cgroup": "0::/\n", "sys/fs/cgroup/cpu.max": "50000 100000\n"}, [0.5]),  # in a container
        (
            {
                "proc/self/cgroup": "3:memory:/a\n2:cpu,cpuacct:/a\n0::/a\n",
                "sys/fs/cgroup/cpu/a/cpu.cfs_quota_us": "300000\n",
                "sys/fs/cgroup/cpu/a/cpu.cfs_period_us": "100000\n",
                "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1\n",
                "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000\n",
            },
            [3.0],
        ),
        ({}, []),
    ],
)
def test_control_groups_limit_the_number_of_processors(
    files: dict[str, str], count: list[float], tmp_path: Path
) -> None:
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert quotas(tmp_path) == count


def test_affinity_slurm_and_quota_limit_the_number_of_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)
    monkeypatch.setattr(child_process.os, "sched_getaffinity", lambda _: set(range(64)))
    monkeypatch.setattr(child_process, "quotas", lambda: [8.0, 5.5])
    assert cpu_count() == 5
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", "4")
    assert cpu_count() == 4
    monkeypatch.setattr(child_process.os, "sched_getaffinity", lambda _: {3, 7})
    assert cpu_count() == 2
    monkeypatch.setattr(child_process, "quotas", lambda: [0.5])
    assert cpu_count() == 1
