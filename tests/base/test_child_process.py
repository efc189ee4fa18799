"""Processes that end with the process that started them, and the number of processors that a process may use."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from autodrive.base import child_process
from autodrive.base.child_process import Group, cpu_count, quotas, start_module
from tests.support.waiting import is_alive, wait_until

ROOT = str(Path(__file__).parents[2])
WRAPPERS = {
    "background": 'sleep 1000 & echo $! >"$0.child"; sleep 1000 & wait',
    "setsid": """(setsid sh -c 'echo $$ >"$0.child"; sleep 1000' "$0" &); sleep 1000""",
    "job control": 'set -m; sleep 1000 & echo $! >"$0.child"; sleep 1000',
    "timeout": """timeout 1000 sh -c 'echo $$ >"$0.child"; sleep 1000' "$0" """,
}
"""Each starts a process that it leaves behind; all but the first one start it in another group."""


def wrapper(folder: Path, text: str) -> Path:
    path = folder / "wrap.sh"
    path.write_text(text)
    return path


def child_of(wrapper: Path) -> int:
    note = wrapper.with_name(f"{wrapper.name}.child")
    wait_until(lambda: note.exists() and note.read_text().endswith("\n"))
    return int(note.read_text())


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


@pytest.mark.parametrize("kind", WRAPPERS)
def test_a_group_ends_with_all_its_processes(kind: str, tmp_path: Path) -> None:
    path = wrapper(tmp_path, WRAPPERS[kind])
    group = Group(["bash", str(path)], cwd=tmp_path)
    child = child_of(path)
    assert group.exit_code is None
    assert is_alive(child)
    group.close()
    assert not is_alive(child)
    assert group.exit_code is not None


def test_what_a_program_leaves_behind_ends_with_it(tmp_path: Path) -> None:
    path = wrapper(tmp_path, 'setsid sleep 1000 & echo $! >"$0.child"; exit 7')
    group = Group(["bash", str(path)], cwd=tmp_path)
    child = child_of(path)
    wait_until(lambda: group.exit_code == 7)
    assert not is_alive(child)
    group.close()


def test_a_signal_that_ends_a_program_is_in_its_exit_code(tmp_path: Path) -> None:
    group = Group(["bash", str(wrapper(tmp_path, "kill -SEGV $$"))], cwd=tmp_path)
    wait_until(lambda: group.exit_code == 128 + signal.SIGSEGV)
    group.close()


def test_a_program_of_a_group_ends_with_its_keeper(tmp_path: Path) -> None:
    path = wrapper(tmp_path, 'echo $$ >"$0.child"; exec sleep 1000')
    group = Group(["bash", str(path)], cwd=tmp_path)
    program = child_of(path)
    os.kill(parent_of(program), signal.SIGKILL)
    wait_until(lambda: not is_alive(program))
    group.close()


def test_a_program_of_a_group_may_be_a_shell_script_without_its_interpreter(tmp_path: Path) -> None:
    wrapper(tmp_path, "exit 7").chmod(0o755)
    group = Group(["./wrap.sh"], cwd=tmp_path)
    wait_until(lambda: group.exit_code == 7)
    group.close()


def test_a_program_of_a_group_has_the_signals_that_a_shell_gives_it(tmp_path: Path) -> None:
    path = wrapper(tmp_path, "grep -E 'Sig(Blk|Ign)' /proc/self/status")
    line = ["bash", str(path)]
    with (tmp_path / "signals").open("w+") as output:
        group = Group(line, cwd=tmp_path, stdout=output)
        wait_until(lambda: group.exit_code is not None)
        group.close()
        output.seek(0)
        assert output.read() == subprocess.run(line, capture_output=True, text=True, check=True).stdout


STARTS_PROCESSES = """
import sys, time
from pathlib import Path
from autodrive.base.child_process import Group, start_module
group = Group(["bash", sys.argv[1]], cwd=Path())
module = start_module("tests.base.test_child_process", has_children=True)
print(module.pid, int(module.stdout.readline()), flush=True)
time.sleep(1000)
"""


def main() -> None:
    """Of a process that `start_module` starts: it starts another one, and ends if it reads something."""
    print(subprocess.Popen(["setsid", "sleep", "1000"]).pid, flush=True)
    sys.exit(len(sys.stdin.buffer.read(1)) + 6)


@pytest.mark.parametrize("is_asked", [True, False])
def test_a_module_ends_with_the_processes_that_it_has_started(is_asked: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", ROOT)
    with start_module(__name__, has_children=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        child = int(process.stdout.readline())
        assert is_alive(child)
        if is_asked:
            process.stdin.write(b"x")
            process.stdin.flush()
        else:
            process.terminate()
        assert process.wait() == (7 if is_asked else 128 + signal.SIGKILL)
        assert not is_alive(child)


@pytest.mark.parametrize(
    ("end", "kind"),
    [
        (signal.SIGKILL, "setsid"),
        (signal.SIGTERM, "background"),
        (signal.SIGINT, "job control"),
        (signal.SIGHUP, "timeout"),
    ],
)
def test_processes_end_with_the_one_that_started_them(tmp_path: Path, end: signal.Signals, kind: str) -> None:
    path = wrapper(tmp_path, WRAPPERS[kind])
    line = [sys.executable, "-c", STARTS_PROCESSES, str(path)]
    options = {"env": {**os.environ, "PYTHONPATH": ROOT}, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(line, cwd=ROOT, **options) as parent:  # type: ignore[call-overload]
        assert parent.stdout is not None
        started = [child_of(path), *map(int, parent.stdout.readline().split())]
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
