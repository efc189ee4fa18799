"""Contact forces of a replay are those of the World that was recorded."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive.protocol.messages import Command, Seek
from autodrive.recording import Recorder
from autodrive.recording.replay import forces as module
from autodrive.recording.replay.forces import ForcesAgain
from autodrive.recording.replay.player import Player, Stage
from autodrive.recording.replay.tape import Tape
from tests.recording.conftest import Drive
from tests.support.waiting import LIMIT, wait_until


def numbers(forces: Any) -> Any:
    """Comparable values."""
    return {name: (of.parts, of.position.tolist(), of.force.tolist()) for name, of in forces.items()}


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Any]]:
    """A recording of a drive into a wall, and the contact forces of each of its Frames."""
    path = tmp_path_factory.mktemp("recordings") / "bump.mcap"
    world = autodrive.make("mini_map", cameras=False)
    world.watch_contacts()
    forces: list[Any] = [{}]
    with Recorder(path, world, name="mini_map"):
        while not any(len(of.parts) > 4 for of in forces[-1].values()) or len(forces) < 200:
            assert len(forces) < 3000
            world.step({"V1": Command(1.0)})
            forces.append(dict(world.contact_forces))
    return path, [numbers(one) for one in forces]


@pytest.fixture
def again(driven: tuple[Path, list[Any]]) -> Iterator[ForcesAgain]:
    made = ForcesAgain(driven[0])
    yield made
    made.close()


def known(again: ForcesAgain, time: float) -> Any:
    wait_until(lambda: again.at(time) is not None)
    return again.at(time)


def test_they_are_those_of_the_recorded_world(driven: tuple[Path, list[Any]], again: ForcesAgain) -> None:
    _, forces = driven
    last = len(forces) - 1
    assert any(len(of[0]) > 4 for of in forces[last].values())
    for number in (last, 0, 1, 150, last - 1):
        assert numbers(known(again, 0.01 * number)) == forces[number], number
    assert numbers(known(again, 1e3)) == forces[last]


def test_a_long_recording_keeps_a_part_of_them(
    driven: tuple[Path, list[Any]], again: ForcesAgain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST", 16)
    _, forces = driven
    last = len(forces) - 1
    known(again, 1e3)
    assert again.count <= 17
    shown = numbers(again.at(0.01 * last))
    assert shown in forces[-64:]


def test_a_player_shows_them_while_somebody_looks_also_in_a_pause(driven: tuple[Path, list[Any]]) -> None:
    path, forces = driven
    again, stage = ForcesAgain(path), Stage(autodrive.make("mini_map", cameras=False))
    with Tape(path) as tape, Player(tape, lambda time: stage, is_paused=True, forces=again.at) as player:
        player.request(Seek(1.5)).result(LIMIT)
        assert again.count == 0  # nobody looks: nothing is simulated
        stage.world.watch_contacts()
        wait_until(lambda: numbers(stage.world.contact_forces) == forces[150])
        player.request(Seek(0.5)).result(LIMIT)
        wait_until(lambda: numbers(stage.world.contact_forces) == forces[50])
    again.close()


def test_a_recording_that_does_not_begin_at_a_start_has_none_and_says_why(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = autodrive.make("plane")
    world.step()
    with Recorder(tmp_path / "late.mcap", world, name="plane", last=5.0) as recorder:
        recorder.save()
        for _ in range(110):
            world.step()
    again = ForcesAgain(recorder.files[0])
    with caplog.at_level(logging.WARNING):
        assert known(again, 1.0) == {}
    assert "not at the start of a run" in caplog.text
    again.close()


def test_forces_follow_resets_and_edits_of_a_recording(drive: Drive) -> None:
    again = ForcesAgain(drive.path)
    end = known(again, 1e3)
    assert end.keys() == drive.frames[-1].vehicles.keys()
    weight = sum(of.force[:4, 2].sum() for name, of in end.items() if name != "V1")
    assert np.isfinite(weight)
    assert weight > 0.0
    again.close()
