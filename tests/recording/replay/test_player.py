"""A Player shows what was recorded, when it was recorded, and nothing that was not."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.protocol import messages
from autodrive.protocol.messages import Command, Frame, Resume, Seek, SetSpeed, Step
from autodrive.recording.replay.player import Player, Stage
from autodrive.recording.replay.tape import Tape
from tests.recording.conftest import Drive
from tests.support.frames import digest
from tests.support.waiting import LIMIT, wait_until


class ManualClock:
    """Jumps to the end of each wait, so that playing takes no time and depends on no load."""

    def __init__(self) -> None:
        self.time = 100.0

    def now(self) -> float:
        return self.time

    def wait(self, condition: threading.Condition, timeout: float | None) -> None:
        if timeout is None:
            condition.wait(LIMIT)  # until a request arrives
        else:
            self.time += timeout


class Viewer:
    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def publish(self, frame: Frame) -> None:
        self.frames.append(frame)


@pytest.fixture
def player(tape: Tape) -> Iterator[Player]:
    """Paused at the start."""
    stage = Stage(autodrive.make("plane"))
    with Player(tape, lambda time: stage, is_paused=True, clock=ManualClock()) as running:
        yield running


def ask(player: Player, request: messages.Operation) -> Frame:
    return player.request(request).result(LIMIT)


def test_a_seek_shows_the_frame_of_that_time(player: Player, drive: Drive) -> None:
    for tick in (90, 3, 149, 0, 91):
        frame = ask(player, Seek(tick * 0.01))
        assert digest(frame) == digest(replace(drive.frames[tick], events=()))
        assert player.position == pytest.approx(tick * 0.01)


def test_scans_that_did_not_change_are_the_same_object(player: Player) -> None:
    scans = [frame.vehicles["V1"].lidar for frame in (ask(player, Seek(0.01 * tick)) for tick in range(60, 100))]
    ids = {id(scan) for scan in scans}
    times = {scan.time for scan in scans if scan is not None}
    assert len(times) > 1
    assert len(ids) == len(times)


def test_steps_go_from_frame_to_frame_in_both_directions(player: Player) -> None:
    ask(player, Seek(0.505))
    ticks = [ask(player, Step(steps)).tick for steps in (1, 1, -1, -3, 10)]
    assert ticks == [51, 52, 51, 48, 58]
    ask(player, Seek(0.0))
    assert ask(player, Step(-1)).tick == 0


def test_playing_shows_every_event_once_and_pauses_at_the_end(player: Player, tape: Tape, drive: Drive) -> None:
    viewer = Viewer()
    player.add_sink(viewer)
    ask(player, SetSpeed(8.0))
    ask(player, Resume())
    wait_until(lambda: player.is_paused)
    assert player.position == tape.duration
    recorded = [event for frame in drive.frames for event in frame.events]
    assert recorded
    shown = [event for frame in viewer.frames for event in frame.events]
    assert [digest(event) for event in shown] == [digest(event) for event in recorded]
    # 8 recorded seconds per second at 60 Frames per second: every 13th or 14th Frame, and no more
    assert len(viewer.frames) <= tape.duration / 8 * 60 + 2
    count = len(viewer.frames)
    ask(player, Resume())  # from the start again, and to the end before the next request can arrive
    wait_until(lambda: len(viewer.frames) > count and player.is_paused)
    assert viewer.frames[count].tick < 15
    assert player.position == tape.duration


@pytest.mark.parametrize(
    "request_",
    [
        messages.Reset(),
        messages.Teleport("V1", 0.0, 0.0),
        messages.SetSceneLight(True),
        messages.SetDrivingMode("V1", True),
        messages.LoadScenario("plane"),
        messages.AddBox("box", 1.0, 1.0),
        messages.Undo(),
        Step(1, {"V1": Command(1.0)}),
    ],
    ids=lambda request: type(request).__name__,
)
def test_changes_are_refused_with_the_reason(player: Player, request_: messages.Operation) -> None:
    with pytest.raises(AutodriveError, match=r"this is a replay of 'drive\.mcap': the recorded commands drive"):
        player.request(request_)


def test_commands_and_impossible_speeds_are_refused(player: Player) -> None:
    with pytest.raises(AutodriveError, match="nothing can be changed"):
        player.submit("V1", Command(1.0))
    with pytest.raises(AutodriveError, match="not 'as fast as possible'"):
        player.request(SetSpeed(None))
    with pytest.raises(AutodriveError, match=r"from 0\.001 to 1000"):
        player.request(SetSpeed(0.0))


def test_a_simulation_refuses_a_seek() -> None:
    with pytest.raises(AutodriveError, match="autodrive replay FILE"):
        autodrive.Simulation(autodrive.make("plane")).request(Seek(1.0))
