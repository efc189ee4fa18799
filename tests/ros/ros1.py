"""ROS 1 for tests: the packages built, a master, launched files, and a node that tells what it hears."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xmlrpc.client import ServerProxy

import pytest

from tests.ros.running import ROOT, Running, Witness, await_that, free_port, simulator
from tests.test_cli import Started

WORKSPACE = ROOT / "build" / "ros1"


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """Of a terminal in which the packages are built and sourced."""
    if shutil.which("roscore", path="/usr/bin") is None or shutil.which("catkin_make", path="/usr/bin") is None:
        pytest.skip("ROS 1 is not installed: scripts/ros1")
    subprocess.run([ROOT / "scripts" / "ros1", "--headless", "true"], check=True, timeout=600)
    return sourced()


def sourced() -> dict[str, str]:
    """What a terminal has after `. build/ros1/devel/setup.sh`, with a master of its own."""
    own = {"HOME", "LANG", "TMPDIR"}
    plain = {name: value for name, value in os.environ.items() if name in own} | {"PATH": "/usr/bin:/bin:/usr/sbin"}
    source = f". {WORKSPACE}/devel/setup.sh && env -0"
    told = subprocess.run(["sh", "-c", source], env=plain, capture_output=True, text=True, check=True).stdout
    variables = dict(line.split("=", 1) for line in told.split("\0") if line)
    return variables | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}", "ROS_IP": "127.0.0.1"}


def master(environment: dict[str, str], folder: Path) -> Running:
    """roscore, when it answers."""
    port = environment["ROS_MASTER_URI"].rsplit(":", 1)[1]
    running = Running(environment, folder, "roscore", "-p", port)

    def answers() -> bool:
        with contextlib.suppress(OSError):
            return ServerProxy(environment["ROS_MASTER_URI"]).hasParam("/test", "/run_id")[2]  # type: ignore[index]
        return False

    await_that(answers)
    return running


def witness(environment: dict[str, str], folder: Path) -> Witness:
    return Witness(environment, folder, "/usr/bin/python3", "ros1_witness.py")


class Stage(NamedTuple):
    """A master and a simulator for all tests."""

    environment: dict[str, str]
    folder: Path
    master: list[Running]
    simulator: list[Started]
    port: int


@pytest.fixture(scope="session")
def stage(environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("ros1")
    port = free_port()
    run = simulator(folder, "mini_map", port=port)
    one = Stage(environment, folder, [master(environment, folder)], [run], port)
    try:
        yield one
    finally:
        one.simulator[0].end(signal.SIGTERM)
        one.master[0].end(signal.SIGINT)


def launched(stage: Stage, *arguments: str, **options: Any) -> Running:
    return Running(stage.environment, stage.folder, "roslaunch", "autodrive_ros", *arguments, **options)
