"""Processes that this one starts; none is left behind, however this process ends.

Python processes get pickled objects as requests from stdin, write answers to stdout, and end when stdin closes. Other
programs run as a group, which ends as a whole. A small process, the keeper, stands between this one and those that may
start others (`keeper.py`).
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import shutil
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO

if sys.platform == "linux":
    import fcntl

PIPE_SIZE = 1 << 20
"""Bytes that the pipe for answers holds where the system allows it, so that an image is not passed in small pieces."""

KEEPER = [sys.executable, "-I", "-S", str(Path(__file__).with_name("keeper.py"))]
"""Command line to put before that of a program, which gets the stdin; its exit code is that of the program.

Not for Windows.
"""


def start_module(module: str, *, has_children: bool = False, **variables: str) -> subprocess.Popen[bytes]:
    """Run `main` of that module in a new Python, with pipes to its stdin and from its stdout.

    `has_children`: it may start processes, which end with it; `terminate` ends all, `kill` does not. `variables`: more
    variables of its environment.
    """
    process: subprocess.Popen[Any] = subprocess.Popen(
        # -P: a file in the user's folder must not replace one of our modules. Not -m: pickled classes of a module that
        # is `__main__` there would not be found here.
        [
            *(KEEPER if has_children and sys.platform != "win32" else ()),
            sys.executable,
            "-P",
            "-c",
            f"from {__name__} import end_with_parent; end_with_parent(); from {module} import main; main()",
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # graphics drivers print many warnings
        env=environment() | variables,
        **popen_options(),
    )
    if sys.platform == "linux":
        assert process.stdout is not None
        with contextlib.suppress(OSError):  # a user may have a limited number of large pipes
            fcntl.fcntl(process.stdout, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
    return process


def end_with_parent() -> None:
    """End the process at once when the process that started it has ended, or has closed its end of stdin."""
    if not hasattr(select, "poll"):  # Windows: the process ends when it reads the next request
        return
    poll = select.poll()
    poll.register(0, 0)  # without events, `poll` returns when the other end is closed

    def wait() -> None:
        poll.poll()
        os._exit(1)

    threading.Thread(target=wait, name="autodrive-end-with-parent", daemon=True).start()


class Group:
    """A program that runs with its stdin closed, and all processes that come from it, which end together.

    They end with `close`, with the program, or with this process, however it ends. On Linux these are also those that
    have left the group of the program, as with `setsid`, `timeout` and `roslaunch`; on macOS only its group; on Windows
    only the program, with `close`. Arguments: see `Popen`. Raises `OSError` if the program cannot be started.
    """

    def __init__(self, line: list[str], *, cwd: Path, **options: Any) -> None:
        if sys.platform == "win32":
            self._process = subprocess.Popen(line, cwd=cwd, stdin=subprocess.DEVNULL, **options)
            return
        program = cwd / line[0] if "/" in line[0] else shutil.which(line[0])
        if program is None or not Path(program).exists():
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), line[0])
        if not os.access(program, os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), line[0])
        # The shell says why a program cannot be run, and runs a file without '#!'.
        kept = [*KEEPER, "/bin/sh", "-c", 'exec "$@" </dev/null', "autodrive", *line]
        self._process = subprocess.Popen(kept, cwd=cwd, stdin=subprocess.PIPE, start_new_session=True, **options)

    @property
    def exit_code(self) -> int | None:
        """Exit code of the program; None while one of its processes runs; 128 + signal if a signal ended it."""
        return self._process.poll()

    def close(self) -> None:
        """End all processes; returns when they have ended."""
        if self._process.stdin is not None:
            self._process.stdin.close()  # the keeper ends them
        else:
            self._process.kill()
        self._process.wait()


def cpu_count() -> int:
    """Processors that this process may use: by its affinity, the quota of its control group, and its job in Slurm."""
    counts = [len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1]
    with contextlib.suppress(ValueError):
        counts.append(int(os.environ.get("SLURM_CPUS_PER_TASK", "")))
    return max(1, min([*counts, *map(int, quotas())]))


def quotas(root: Path = Path("/")) -> list[float]:
    """Processors that the control groups of this process may use: version 2, else 1; empty without a limit."""
    limits: list[float] = []
    with contextlib.suppress(OSError):
        for entry in os.fsdecode((root / "proc/self/cgroup").read_bytes()).splitlines():
            _, controllers, path = entry.split(":", 2)
            folder = root / "sys/fs/cgroup"
            if controllers:
                folder /= "cpu"
            if controllers and "cpu" not in controllers.split(","):
                continue
            group = Path(path.lstrip("/"))
            for place in (group, *group.parents):  # in a container, only the last one is there: the root
                with contextlib.suppress(OSError, ValueError):
                    limits.append(_quota(folder / place, is_old=bool(controllers)))
    return limits


def _quota(folder: Path, *, is_old: bool) -> float:
    """Processors of one control group. Raises `ValueError` without a limit."""
    if is_old:
        quota, period = (float((folder / f"cpu.cfs_{name}_us").read_bytes()) for name in ("quota", "period"))
        if quota <= 0:
            raise ValueError
    else:
        quota, period = map(float, (folder / "cpu.max").read_bytes().split())  # 'max' is no number
    return quota / period


def popen_options(platform: str = sys.platform) -> dict[str, Any]:
    """Options of `Popen` that differ between platforms.

    Ctrl-C goes to this process only, which then ends the other. On Windows the priority is set here; elsewhere a
    process lowers its own.
    """
    if platform == "win32":
        return {"creationflags": 0x200 | 0x4000}  # CREATE_NEW_PROCESS_GROUP, BELOW_NORMAL_PRIORITY_CLASS
    return {"start_new_session": True}


def environment() -> dict[str, str]:
    """The process finds the package where this one found it."""
    root = str(Path(__file__).parents[2])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))}


def take_stdout() -> BinaryIO:
    """The pipe for the answers of this process. What anything else prints goes to stderr from now on."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return answers
