"""Fixtures of the ROS tests: for each generation of ROS, one environment and one set of processes in a session."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

import autodrive
from autodrive import Command
from autodrive.recording import Recorder
from tests.support.builds import LIMIT
from tests.support.ros import ros1, ros2
from tests.support.ros.processes import ROOT


@pytest.fixture(scope="package")
def ros1_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ros1.Ros1]:
    """A master and a simulator."""
    if not ros1.is_installed():
        pytest.skip("ROS 1 is not installed: run scripts/ros1")
    subprocess.run([ROOT / "scripts" / "ros1", "--headless", "true"], check=True, timeout=LIMIT)
    session = ros1.Ros1(ros1.sourced(), tmp_path_factory.mktemp("ros1"))
    try:
        yield session
    finally:
        session.close()


@pytest.fixture(scope="package")
def ros2_environment() -> dict[str, str]:
    """Environment variables of a terminal with the ROS 2 packages."""
    if not (ros2.ENVIRONMENT / "installed.txt").is_file():
        pytest.skip("ROS 2 is not installed: run scripts/ros2")
    subprocess.run([ROOT / "scripts" / "ros2"], check=True, timeout=LIMIT)
    return ros2.sourced()


@pytest.fixture(scope="package")
def two_cars(gl: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 0.3 s with images: V1 is a Nigel, V2 a RoboRacer car."""
    path = tmp_path_factory.mktemp("drive") / "two_cars.mcap"
    placed = {"V1": {"type": "nigel"}, "V2": {"type": "roboracer", "y": 1.5}}
    world = autodrive.make(autodrive.Scenario(vehicles=placed), cameras="small")  # type: ignore[arg-type]  # pyright: ignore
    with Recorder(path, world, has_meshes=False):
        for _ in range(30):
            world.step(dict.fromkeys(placed, Command(0.5, 0.5)))
    return path
