"""A long drive in one World: no error, and no more memory, files or threads.

AUTODRIVE_HARDENING=long drives 24 simulated hours instead of two minutes.
"""

from __future__ import annotations

import pickle
import random
from pathlib import Path

import autodrive
from autodrive.base.errors import CommandError
from autodrive.protocol.messages import Collision, Command
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.hardening import cases, memory, open_files

SPEC = ScenarioSpec(
    vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)},
    boxes={"a": BoxSpec(x=0.6, y=0.2), "b": BoxSpec(x=1.2, y=-0.15, mass=0.3)},
    tick=0.05,  # few Frames, so that a day takes minutes; the physics has the usual substep
)
BLOCKS = cases(60, 43_200)
"""Of two simulated seconds each."""
GROWTH = 10.0
"""Largest growth of the memory after a tenth of the drive [MB]."""


def interfere(world: World, rng: random.Random) -> None:
    """Reset, restore or teleport to a box, in the light and weather that is drawn."""
    saved = world.save()
    match rng.randrange(6):
        case 0:
            world.reset(rng.randrange(1000))
        case 1:
            world.restore(pickle.loads(pickle.dumps(saved)))
        case 2:
            world.set_time_of_day(rng.uniform(0.0, 86400.0), 60.0)
            world.set_weather(autodrive.Weather(rain=rng.choice([0.0, 0.5]), snow=rng.choice([0.0, 1.0])))
        case _:
            x, y = world.pose(rng.choice([*world.boxes]))[:2].tolist()
            try:
                world.teleport("V1", x - rng.uniform(0.3, 0.6), y)
            except CommandError:  # another object is there, or it was pushed far away
                world.reset()


def test_a_long_drive_needs_no_more_memory_files_or_threads() -> None:
    world, rng, contacts = autodrive.make(SPEC), random.Random(0), 0
    start, files, threads = 0.0, open_files(), len(list(Path("/proc/self/task").iterdir()))
    for block in range(BLOCKS):
        if block == BLOCKS // 10:
            start = memory()
        interfere(world, rng)
        for _ in range(40):
            frame = world.step({"V1": Command(rng.choice([1.0, 0.5, -1.0]), rng.uniform(-1.0, 1.0))})
            contacts += sum(isinstance(event, Collision) for event in frame.events)
    assert contacts > 0
    assert memory() < start + GROWTH
    assert open_files() <= files
    assert len(list(Path("/proc/self/task").iterdir())) <= threads
