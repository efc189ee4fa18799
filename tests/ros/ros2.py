"""ROS 2 for tests: the packages built, the bridge's node, and a node that tells what it hears."""

from __future__ import annotations

import os
import random
import subprocess
from pathlib import Path

import pytest

from tests.ros.running import ROOT, Running, Witness

WHEELS = ROOT / ".venv-ros2-jazzy"
BUILT = ROOT / "build" / "ros2"
VEHICLE = "/autodrive/nigel_1"


def sourced() -> dict[str, str]:
    """Environment of a terminal in which the packages are sourced, in a domain of its own."""
    plain = {name: value for name, value in os.environ.items() if name in {"HOME", "LANG", "TMPDIR"}}
    told = subprocess.run(
        ["bash", "-c", f". {BUILT}/setup.sh && env -0"],
        env=plain | {"PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return dict(line.split("=", 1) for line in told.split("\0") if line) | {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(random.randint(1, 100)),
        "PYTHONUNBUFFERED": "1",
    }


@pytest.fixture(scope="session")
def ros2() -> dict[str, str]:
    """Likewise, once they are built."""
    if not (WHEELS / "installed.txt").is_file():
        pytest.skip("ROS 2 is not there: scripts/ros2")
    subprocess.run([ROOT / "scripts" / "ros2"], check=True, timeout=600)
    return sourced()


def bridge(environment: dict[str, str], folder: Path, *arguments: str, **parameters: object) -> Running:
    """The bridge's node; `arguments` come after --ros-args."""
    given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    program = BUILT / "install" / "lib" / "autodrive_ros2" / "autodrive_bridge"
    return Running(environment, folder, program, "--ros-args", *arguments, *given)


def witness(environment: dict[str, str], folder: Path) -> Witness:
    return Witness(environment, folder, WHEELS / "bin" / "python", "ros2_witness.py")
