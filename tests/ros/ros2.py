"""ROS 2 for tests: the packages built, the bridge's node, and a node that tells what it hears."""

from __future__ import annotations

import contextlib
import json
import os
import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.ros.ros1 import Running

ROOT = Path(__file__).parents[2]
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


class Witness:
    """The node of ros2_witness.py: its methods are this one's."""

    def __init__(self, environment: dict[str, str], folder: Path) -> None:
        script = Path(__file__).parent / "ros2_witness.py"
        with (folder / "witness.txt").open("a") as words:
            self._process = subprocess.Popen(
                [WHEELS / "bin" / "python", script],
                env=environment | {"ROS_LOG_DIR": str(folder)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=words,
                text=True,
            )
        assert self._answer() == "ready"

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def ask(*arguments: object) -> Any:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps([name, arguments]) + "\n")
            self._process.stdin.flush()
            is_well, value = self._answer()
            assert is_well, value
            return value

        return ask

    def close(self) -> None:
        self._process.kill()
        self._process.wait()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())


@contextlib.contextmanager
def witness(environment: dict[str, str], folder: Path) -> Iterator[Witness]:
    one = Witness(environment, folder)
    try:
        yield one
    finally:
        one.close()
