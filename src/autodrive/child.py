"""Another process of this Python beside the simulator: it draws, and gives way to the physics.

It gets orders on its stdin, answers on its stdout, and ends when its stdin does, so that nothing is left behind
however the simulator ends.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO, TypeAlias

Process: TypeAlias = subprocess.Popen[bytes]


def spawn(module: str, *arguments: str, descriptors: Sequence[int] = ()) -> Process:
    """The process that runs that module; it may use these file descriptors too."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *arguments],  # -P: a file in the user's folder is none of our modules
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,  # graphics drivers talk a lot
        pass_fds=descriptors,
        start_new_session=True,  # Ctrl-C is for the simulator, which then ends the process
        env=_environment(),
    )


def become_child() -> IO[bytes]:
    """In the process: give way to others; where its answers go. Whatever else prints does not spoil them."""
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    with contextlib.suppress(OSError, AttributeError):
        os.nice(5)
    return answers


def _environment() -> dict[str, str]:
    """The process finds the package where the simulator found it."""
    root = str(Path(__file__).parents[1])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))}
