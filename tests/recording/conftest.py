"""A drive that several tests read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import autodrive
from autodrive import Command, Frame, Indicators
from autodrive.recording import Recorder, Recording
from autodrive.recording import open as open_recording
from autodrive.recording.replay.tape import Tape


@dataclass
class Drive:
    """A recorded drive: 4 s with a teleport, a reset, a change of light, and a collision at its end."""

    path: Path
    frames: list[Frame]


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    path = tmp_path_factory.mktemp("recordings") / "drive.mcap"
    world = autodrive.make("four_cars", seed=7)
    with Recorder(path, world, name="four_cars"):
        frames = [world.frame]
        for tick in range(150):
            command = Command(0.6, 0.3 * tick / 150, indicators=Indicators.LEFT)
            frames.append(world.step({"V1": command, "V2": Command(0.4)} if tick % 3 == 0 else None))
        frames.append(world.reset(11))
        world.teleport("V1", 1.0, 0.0)
        frames.append(world.frame)
        world.set_scene_light(False)
        frames.append(world.frame)
        while not any(frame.events for frame in frames[153:]):
            assert len(frames) < 2000
            frames.append(world.step({"V1": Command(1.0)}))
    return Drive(path, frames)


@pytest.fixture
def recording(drive: Drive) -> Iterator[Recording]:
    with open_recording(drive.path) as opened:
        yield opened


@pytest.fixture
def tape(drive: Drive) -> Iterator[Tape]:
    with Tape(drive.path) as opened:
        yield opened
