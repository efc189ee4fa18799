"""Fixtures of the ROS tests: for each generation of ROS, one environment and one set of processes in a session."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator

import pytest

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
