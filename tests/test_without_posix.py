"""The simulator uses the parts of Python that only POSIX systems have nowhere at import time, nor in a run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

PROGRAM = r"""
import importlib, os, pkgutil, signal, subprocess, sys, urllib.request

MODULES = "fcntl", "grp", "pwd", "resource", "syslog", "termios", "tty"
FUNCTIONS = (
    "fork", "forkpty", "getegid", "geteuid", "getgid", "getpgid", "getuid", "killpg", "nice", "sched_getaffinity",
    "sched_setaffinity", "setpgid", "setpriority", "setsid", "mkfifo", "uname", "openpty",
)
SIGNALS = "SIGALRM", "SIGCHLD", "SIGHUP", "SIGKILL", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGWINCH"


def load(names):
    # The names of the modules whose packages are installed.
    loaded = []
    for name in names:
        try:
            importlib.import_module(name)
        except ImportError:
            if ".adapters." not in name:  # these need packages that are not installed here
                raise
        else:
            loaded.append(name)
    return loaded


import autodrive

found = [module.name for module in pkgutil.walk_packages(autodrive.__path__, "autodrive.")]
# Other packages choose their own parts by the platform: they are imported while POSIX is there.
installed = load(name for name in found if not name.endswith("__main__"))
for name in [name for name in sys.modules if name.partition(".")[0] == "autodrive"]:
    del sys.modules[name]
for name in MODULES:
    sys.modules[name] = None
for name in FUNCTIONS:
    if hasattr(os, name):
        delattr(os, name)
for name in SIGNALS:
    delattr(signal, name)


class Popen(subprocess.Popen):
    # A process of this system, started with the options of Windows.
    def __init__(self, *args, creationflags, **options):
        super().__init__(*args, **options)

    def kill(self):
        self.send_signal(9)


subprocess.Popen = Popen
sys.platform = "win32"
os.environ["USERNAME"] = "student"  # Windows sets it
assert len(installed) > 400 and load(installed) == installed

from autodrive.run.options import RunOptions
from autodrive.run.runner import RunObserver, simulate
from autodrive.connect.server.served import PageOptions


class Visitor(RunObserver):
    def started(self, run):
        print(urllib.request.urlopen(run.link, timeout=60).status, "from the page server")


options = RunOptions("plane", duration=0.5, speed=None, cameras=False, page=PageOptions(port=0))
print(simulate(options, observer=Visitor()).ended_by)
"""


def test_every_module_is_imported_and_a_world_runs_with_the_page_without_posix(tmp_path: Path) -> None:
    """In another process: its modules are loaded a second time, as on Windows."""
    command = [sys.executable, "-c", PROGRAM]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["200 from the page server", "duration"]
