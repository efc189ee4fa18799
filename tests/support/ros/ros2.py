"""ROS 2 for the tests: the sourced environment, the bridge node and a probe node."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from tests.support.ros.processes import ROOT, Probe, Program

ENVIRONMENT = ROOT / ".venv-ros2-jazzy"
BUILT = ROOT / "build" / "ros2"
PROGRAMS = BUILT / "install" / "lib" / "autodrive_ros2"
VEHICLE = "/autodrive/nigel_1"


def sourced() -> dict[str, str]:
    """Environment of a terminal after `. build/ros2/setup.sh`, with a domain for this process."""
    plain = {name: value for name, value in os.environ.items() if name in {"HOME", "LANG", "TMPDIR"}}
    printed = subprocess.run(
        ["bash", "-c", f". {BUILT}/setup.sh && env -0"],
        env=plain | {"PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return dict(line.split("=", 1) for line in printed.split("\0") if line) | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),  # workers of pytest-xdist started together get different ones
        "PYTHONUNBUFFERED": "1",
    }


def bridge(environment: dict[str, str], folder: Path, *arguments: str, **parameters: object) -> Program:
    """The bridge node; `arguments` follow --ros-args."""
    options = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    return Program(environment, folder, PROGRAMS / "autodrive_bridge", "--ros-args", *arguments, *options)


def probe(environment: dict[str, str], folder: Path) -> Probe:
    return Probe(environment, folder, ENVIRONMENT / "bin" / "python", "ros2_probe.py")
