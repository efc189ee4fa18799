"""Runs the program that its arguments name, and ends all processes that come from it when it ends or stdin closes.

`child_process` runs this file with a Python of its own, so it imports nothing of the package.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import sys
import time

PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36
END_TIME = 5.0
"""Processes that cannot be killed, such as those of another user, are left behind after that wall time [s]."""


def main() -> None:
    """End with the exit code of the program, or 128 and the number of the signal that ended it.

    SIGINT, SIGTERM and SIGHUP end the program, as the end of stdin does.
    """
    prctl = ctypes.CDLL(None).prctl if sys.platform == "linux" else lambda *_: None
    # A process whose parent has ended becomes a child of this one, also if it has left the group, as with setsid.
    prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    signals, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write)  # the numbers of all signals go there
    for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)
    program = os.fork()
    if program == 0:
        try:
            os.setpgid(0, 0)
            prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)  # when this process is killed
            for number in (signal.SIGPIPE, signal.SIGXFSZ):  # Python ignores them
                signal.signal(number, signal.SIG_DFL)
            os.execv(sys.argv[1], sys.argv[1:])
        finally:
            os._exit(127)
    status = wait_for(program, signals)
    end_all(program)
    code = os.waitstatus_to_exitcode(status)
    os._exit(code if code >= 0 else 128 - code)


def wait_for(program: int, signals: int) -> int:
    """The wait status of the program, or that of a killed one if it must end. `signals`: a pipe with their numbers."""
    poll = select.poll()
    poll.register(0, 0)  # without events, it is ready when the other end is closed
    poll.register(signals, select.POLLIN)
    while [file for file, _ in poll.poll()] == [signals] and {*os.read(signals, 1 << 16)} == {signal.SIGCHLD}:
        while (ended := os.waitpid(-1, os.WNOHANG))[0]:
            if ended[0] == program:
                return ended[1]
    return signal.SIGKILL


def end_all(group: int) -> None:
    """Kill a group, and all children of this process until none is left."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)
    deadline = time.monotonic() + END_TIME
    with contextlib.suppress(ChildProcessError):  # none is left
        while time.monotonic() < deadline:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
            for child in children():
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(child, signal.SIGKILL)
            time.sleep(0.002)


def children() -> list[int]:
    """Processes whose parent is this one; none where there is no /proc."""
    numbers = []
    for name in os.listdir("/proc") if os.path.isdir("/proc") else ():
        if name.isdecimal():
            with contextlib.suppress(OSError), open(f"/proc/{name}/stat", "rb") as file:
                if int(file.read().rpartition(b")")[2].split()[1]) == os.getpid():
                    numbers.append(int(name))
    return numbers


if __name__ == "__main__":
    main()
