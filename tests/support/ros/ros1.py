"""ROS 1 for the tests: the sourced environment, a master, launch files and a probe node."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
from pathlib import Path
from xmlrpc.client import ServerProxy

from tests.support.ros.processes import ROOT, Probe, Program, simulator
from tests.support.waiting import free_port, wait_until

WORKSPACE = ROOT / "build" / "ros1"


def is_installed() -> bool:
    return all(shutil.which(program, path="/usr/bin") for program in ("roscore", "catkin_make"))


def sourced() -> dict[str, str]:
    """Environment of a terminal after `. build/ros1/devel/setup.sh`, with a free port for the master."""
    kept = {"HOME", "LANG", "TMPDIR"}
    plain = {name: value for name, value in os.environ.items() if name in kept} | {"PATH": "/usr/bin:/bin:/usr/sbin"}
    source = f". {WORKSPACE}/devel/setup.sh && env -0"
    printed = subprocess.run(["sh", "-c", source], env=plain, capture_output=True, text=True, check=True).stdout
    variables = dict(line.split("=", 1) for line in printed.split("\0") if line)
    return variables | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1"}


def master(environment: dict[str, str], folder: Path) -> Program:
    """roscore, once it answers."""
    port = environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
    program = Program(environment, folder, "roscore", "-p", port)

    def is_ready() -> bool:
        with contextlib.suppress(OSError):
            return ServerProxy(environment["ROS_MASTER_URI"]).hasParam("/test", "/run_id")[2]  # type: ignore[index]
        return False

    wait_until(is_ready)
    return program


class Ros1:
    """A master and a simulator, which all tests of a session share and some restart."""

    def __init__(self, environment: dict[str, str], folder: Path) -> None:
        self.environment, self.folder = environment, folder
        self.port = free_port()
        self.master = master(environment, folder)
        self.simulator = self._simulator()

    def close(self) -> None:
        self.simulator.stop(signal.SIGTERM)
        self.master.stop()

    def restart_simulator(self) -> None:
        self.simulator.stop(signal.SIGTERM)
        self.simulator = self._simulator()

    def restart_master(self) -> None:
        self.master = master(self.environment, self.folder)

    def launch(self, *arguments: str, stdin: int | None = None, variables: dict[str, str] | None = None) -> Program:
        """Start a launch file of autodrive_ros, with further environment variables."""
        environment = self.environment | (variables or {})
        return Program(environment, self.folder, "roslaunch", "autodrive_ros", *arguments, stdin=stdin)

    def probe(self) -> Probe:
        return Probe(self.environment, self.folder, "/usr/bin/python3", "ros1_probe.py")

    def _simulator(self) -> Program:
        return simulator(self.folder, "mini_map", port=self.port)
