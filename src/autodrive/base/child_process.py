"""Python processes that this one starts, with pickled objects as requests to stdin and as answers from stdout.

Such a process ends when its stdin closes, so none is left behind however this process ends.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
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
        [sys.executable, "-P", "-c", f"from {module} import main; main()"],
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


def cpu_count() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


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
