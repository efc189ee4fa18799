"""A short drive with images, which all exports read."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import autodrive
from autodrive import Command
from autodrive.recording import Recorder, Recording
from autodrive.recording import open as open_recording


@pytest.fixture(scope="session")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """1 s, 101 Frames, 8 scans, and about 30 images of each camera."""
    path = tmp_path_factory.mktemp("exports") / "lap.mcap"
    world = autodrive.make("mini_map", cameras="small", seed=4)
    with Recorder(path, world, name="mini_map"):
        for tick in range(100):
            world.step({"V1": Command(0.8, 0.2 if tick > 50 else 0.0)})
    return path


@pytest.fixture
def lap(file: Path) -> Iterator[Recording]:
    with open_recording(file) as recording:
        yield recording
