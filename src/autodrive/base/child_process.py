"""Processes that this one starts; none is left behind, however this process ends.

Python processes get pickled objects as requests from stdin, write answers to stdout, and end when stdin closes. Other
programs run as a group, which ends as a whole.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, BinaryIO

if sys.platform == "linux":
    import fcntl

PIPE_SIZE = 1 << 20
"""Bytes that the pipe for answers holds where the system allows it, so that an image is not passed in small pieces."""


def start_module(module: str) -> subprocess.Popen[bytes]:
    """Run `main` of that module in a new Python, with pipes to its stdin and from its stdout."""
    process: subprocess.Popen[Any] = subprocess.Popen(
        # -P: a file in the user's folder must not replace one of our modules. Not -m: pickled classes of a module that
        # is `__main__` there would not be found here.
        [
            sys.executable,
            "-P",
            "-c",
            f"from {__name__} import end_with_parent; end_with_parent(); from {module} import main; main()",
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # graphics drivers print many warnings
        env=environment(),
        **popen_options(),
    )
    if sys.platform == "linux":
        assert process.stdout is not None
        with contextlib.suppress(OSError):  # a user may have a limited number of large pipes
            fcntl.fcntl(process.stdout, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
    return process


def end_with_parent() -> None:
    """In the process: end at once when the process that started it has ended, or has closed its end of stdin."""
    if not hasattr(select, "poll"):  # Windows: the process ends when it reads the next request
        return
    poll = select.poll()
    poll.register(0, 0)  # without events, `poll` returns when the other end is closed

    def wait() -> None:
        poll.poll()
        os._exit(1)

    threading.Thread(target=wait, name="autodrive-end-with-parent", daemon=True).start()


KEEPER = """
exec 3<&0
"$@" </dev/null 3<&- &
program=$!
{ read -r _ <&3; kill -KILL 0; } &
exec 3<&-
wait "$program"
"""
"""Shell script that runs a program, and kills its own group when the pipe at its stdin closes: then the process that
started it has ended, or wants that."""


class Group:
    """A program that runs with its stdin closed, and all processes that it starts, which end together.

    They end with `close`, or with this process, however it ends. Arguments: see `Popen`. Raises `OSError` if the
    program cannot be started.
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
        keeper = ["/bin/sh", "-c", KEEPER, "autodrive-keeper", *line]
        self._process = subprocess.Popen(keeper, cwd=cwd, stdin=subprocess.PIPE, start_new_session=True, **options)

    @property
    def exit_code(self) -> int | None:
        """Exit code of the program; None while it runs, and 128 and the number of a signal that ended it."""
        return self._process.poll()

    def close(self) -> None:
        """End all processes of the group."""
        if sys.platform == "win32":
            self._process.kill()
        else:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        if self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()


def cpu_count() -> int:
    """Processors that this process may use: by its affinity, the quota of its control group, and its job in Slurm."""
    counts = [len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1]
    with contextlib.suppress(ValueError):
        counts.append(int(os.environ.get("SLURM_CPUS_PER_TASK", "")))
    return max(1, min([*counts, *map(int, quotas())]))


def quotas(root: Path = Path("/")) -> list[float]:
    """Processors that the control groups of this process may use: version 2, else 1; empty without a limit."""
    found: list[float] = []
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
                    found.append(_quota(folder / place, is_old=bool(controllers)))
    return found


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
    """In the process: the pipe for answers. What anything else prints goes to stderr from now on."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return answers
