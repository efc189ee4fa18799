"""A World that several threads use: one at a time is legal, two at once is an error and not a crash."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import WorldInUseError
from autodrive.protocol.messages import Command, Frame
from autodrive.scenario import ScenarioSpec
from autodrive.world import World
from tests.support.command_line import python
from tests.support.frames import digest, digests
from tests.support.waiting import LIMIT

CALLS: dict[str, Callable[[World], object]] = {
    "step": lambda world: world.step(),
    "reset": lambda world: world.reset(),
    "save": lambda world: world.save(),
    "restore": lambda world: world.restore(world.save()),
    "teleport": lambda world: world.teleport("V1", 1.0, 1.0),
    "pose": lambda world: world.pose("V1"),
    "set_poses": lambda world: world.set_poses({"V1": np.array([1.0, 1.0, 0.1, 1.0, 0.0, 0.0, 0.0])}),
    "hold": lambda world: world.hold("V1", None),
    "set_driving_mode": lambda world: world.set_driving_mode("V1", True),
    "set_scene_light": lambda world: world.set_scene_light(False),
    "set_time_of_day": lambda world: world.set_time_of_day(0.0),
    "set_weather": lambda world: world.set_weather(),
    "show_drawings": lambda world: world.draw.points([[0.0, 0.0]]),
    "look": lambda world: world.look(),
    "close": lambda world: world.close(),
}


class SlowCamera:
    """A camera backend whose `update` waits, so that a thread stays inside the World for as long as a test needs."""

    def __init__(self) -> None:
        self.is_slow = False
        self.entered, self.leave = threading.Event(), threading.Event()

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        if self.is_slow:
            self.entered.set()
            assert self.leave.wait(LIMIT)
        return frame

    def reset(self, seed: int) -> None:
        pass

    def save(self) -> None:
        return None

    def restore(self, saved: object) -> None:
        pass

    def close(self) -> None:
        pass

    has_pending_images = is_thread_bound = False


@pytest.mark.parametrize("inside", ["step", "reset"])
@pytest.mark.parametrize("call", CALLS)
def test_a_call_while_another_thread_is_inside_is_an_error_and_changes_nothing(inside: str, call: str) -> None:
    cameras = SlowCamera()
    world = autodrive.make(ScenarioSpec(), cameras=lambda _: cameras)
    other = autodrive.make(ScenarioSpec())
    cameras.is_slow = True
    thread = threading.Thread(target=CALLS[inside], args=(world,))
    thread.start()
    assert cameras.entered.wait(LIMIT)
    try:
        with pytest.raises(WorldInUseError, match="another thread"):
            CALLS[call](world)
    finally:
        cameras.is_slow = False
        cameras.leave.set()
        thread.join(LIMIT)
    CALLS[inside](other)
    assert digests(world, 20, _drive) == digests(other, 20, _drive)


def test_threads_may_use_a_world_in_turn() -> None:
    world, other = autodrive.make(ScenarioSpec()), autodrive.make(ScenarioSpec())
    frames: list[str] = []
    for _ in range(5):
        thread = threading.Thread(target=lambda: frames.append(digest(world.step(_drive(world.frame)))))
        thread.start()
        thread.join(LIMIT)
    assert frames == digests(other, 5, _drive)[1:]


@pytest.mark.process
def test_four_threads_in_one_world_end_with_errors_and_the_world_still_steps() -> None:
    """In a process of its own, which the engine could end."""
    code = (
        "import sys, threading, autodrive\n"
        "sys.setswitchinterval(1e-6)\n"
        "world = autodrive.make('four_cars')\n"
        "done, refused = [], []\n"
        "def use():\n"
        "    for _ in range(2000):\n"
        "        try:\n"
        "            done.append(world.step().tick)\n"
        "        except autodrive.WorldInUseError:\n"
        "            refused.append(1)\n"
        "threads = [threading.Thread(target=use) for _ in range(4)]\n"
        "[thread.start() for thread in threads]\n"
        "[thread.join() for thread in threads]\n"
        "assert sorted(done) == list(range(1, len(done) + 1)), 'two threads ran the same tick'\n"
        "assert len(done) + len(refused) == 8000\n"
        "assert world.step().tick == len(done) + 1\n"
    )
    python("-c", code)


def _drive(frame: Frame) -> dict[str, Command]:
    return {"V1": Command(throttle=0.5, steering=0.3)}
