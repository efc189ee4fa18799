"""Observers of a World are told each command, each change and each Frame, in the order in which they happen."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

import autodrive
from autodrive import Command, CommandError
from autodrive.protocol.messages import (
    Draw,
    Frame,
    Hold,
    Reset,
    SetDrivingMode,
    SetSceneLight,
    SetTimeOfDay,
    SetWeather,
    Teleport,
    Weather,
)
from autodrive.world.observer import Request, ResetTo, Restored, SetPoses


class Notes:
    """All that it was told."""

    def __init__(self) -> None:
        self.heard: list[object] = []

    def given(self, commands: Mapping[str, Command]) -> None:
        self.heard.append(dict(commands))

    def executed(self, request: Request) -> None:
        self.heard.append(request)

    def publish(self, frame: Frame) -> None:
        self.heard.append(frame.tick)


def test_an_observer_hears_all_that_a_world_is_given_and_does() -> None:
    world, notes = autodrive.make("plane"), Notes()
    world.observers.append(notes)
    saved = world.save()
    pose = world.pose("V1")
    world.step()
    world.step({"V1": Command(0.5)})
    world.reset(3)
    world.reset(poses={"V1": (1.0, 2.0, 0.0)})
    world.set_poses({"V1": pose})
    world.teleport("V1", 3.0, 0.0)
    world.set_driving_mode("V1", is_autonomous=True)
    world.hold("V1", np.array([1.0, 2.0, 3.0]))  # type: ignore[arg-type]
    world.hold("V1", None)
    world.set_scene_light(False)
    world.set_time_of_day(100.0, 2.0)
    world.set_weather(Weather(rain=0.5))
    world.draw.clear()
    world.restore(saved)
    world.look()
    world.observers.remove(notes)
    world.step()
    placed = tuple(pose.tolist())
    assert notes.heard == [
        1,
        *({"V1": Command(0.5)}, 2),
        *(Reset(3), 0),
        *(ResetTo(None, {"V1": (1.0, 2.0, 0.0)}), 0),
        *(SetPoses({"V1": placed}), 0),
        *(Teleport("V1", 3.0, 0.0), 0),
        *(SetDrivingMode("V1", True), 0),
        Hold("V1", (1.0, 2.0, 3.0)),
        Hold("V1", None),
        *(SetSceneLight(False), 0),
        *(SetTimeOfDay(100.0, 2.0), 0),
        *(SetWeather(Weather(rain=0.5)), 0),
        Draw({}, clears=True),
        *(Restored(), 0),
    ]


def test_an_observer_hears_nothing_of_what_is_refused() -> None:
    world, notes = autodrive.make("plane"), Notes()
    world.observers.append(notes)
    with pytest.raises(CommandError):
        world.step({"V2": Command()})
    with pytest.raises(CommandError):
        world.reset(poses={"V1": (1.0, 2.0, float("nan"))})
    with pytest.raises(CommandError):
        world.set_time_of_day(float("inf"))
    assert notes.heard == []


def test_a_hold_ends_whatever_its_orientation_is() -> None:
    world, notes = autodrive.make("plane"), Notes()
    world.observers.append(notes)
    world.hold("V1", (1.0, 2.0, 0.1))
    world.hold("V1", None, None)  # type: ignore[arg-type]
    assert world.poses.held == {}
    assert notes.heard == [Hold("V1", (1.0, 2.0, 0.1)), Hold("V1", None)]
