"""Hours of varied driving in one World: `python -m tests.support.long_drive SCENARIO HOURS` prints what it measured.

Random commands, contacts with boxes and cars, teleports, day and night, and now and then a reset or a return to a
snapshot. The same hours and seed give the same bits.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import random
import sys
import time
from pathlib import Path
from typing import Any

import autodrive
from autodrive.base.errors import CommandError
from autodrive.protocol.messages import Collision, Command, Headlights, Indicators
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import Snapshot, World
from autodrive.world.columns import columns_of
from tests.support.frames import bytes_of
from tests.support.hardening import memory, open_files

SCENARIOS = {
    "day": ScenarioSpec(
        vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)},
        boxes={"a": BoxSpec(x=0.6, y=0.2), "b": BoxSpec(x=1.2, y=-0.15, mass=0.3)},
        tick=0.05,  # few Frames, so that a day takes minutes; the physics has the usual substep
    ),
    "loop": ScenarioSpec(
        map="mini_map",
        vehicles={"V1": VehiclePlacement(has_realistic_sensors=True)},
        boxes={"a": BoxSpec(x=0.6, y=0.2)},
    ),
    "two cars": ScenarioSpec(
        map="mini_map", vehicles={"V1": VehiclePlacement(), "V2": VehiclePlacement(type="nigel_2023", x=0.8)}
    ),
}
BLOCK = 2.0
"""Simulated time between two choices of what to do besides driving [s]."""
COMMAND_TIME = 0.2
"""Simulated time between two commands [s]."""


class LongDrive:
    """Drives a World; `counts` says how often what happened."""

    def __init__(self, spec: ScenarioSpec, seed: int = 0) -> None:
        self.world: World = autodrive.make(spec)
        self.counts = {"resets": 0, "restores": 0, "teleports": 0, "refused teleports": 0, "contacts": 0, "ticks": 0}
        self._rng = random.Random(seed)
        self._saved: Snapshot = self.world.save()

    def drive(self, simulated: float) -> None:
        """For that time [s]."""
        ticks, block = (round(time / self.world.tick_duration) for time in (simulated, BLOCK))
        for start in range(0, ticks, block):
            self._interfere()
            self._drive_block(min(block, ticks - start))

    def _drive_block(self, ticks: int) -> None:
        commands: dict[str, Command] = {}
        for tick in range(ticks):
            if tick % round(COMMAND_TIME / self.world.tick_duration) == 0:
                commands = {name: self._command() for name in self.world.vehicle_names}
            frame = self.world.step(commands)
            self.counts["contacts"] += sum(isinstance(event, Collision) for event in frame.events)
        self.counts["ticks"] += ticks

    def _command(self) -> Command:
        rng = self._rng
        throttle = rng.choice([1.0, 1.0, 0.5, rng.uniform(-1.0, 1.0), -1.0])
        steering = rng.choice([0.0, 0.0, 0.2, rng.uniform(-1.0, 1.0)])
        return Command(throttle, steering, rng.choice([None, *Headlights]), rng.choice([None, *Indicators]))

    def _interfere(self) -> None:
        rng, world = self._rng, self.world
        match rng.randrange(60):
            case 0:
                world.reset(rng.choice([None, rng.randrange(1000)]))
                self.counts["resets"] += 1
            case 1:
                self._saved = world.save()
            case 2:
                self._saved = pickle.loads(pickle.dumps(world.save()))
            case 3 | 4:
                world.restore(self._saved)
                self.counts["restores"] += 1
            case 5:
                world.set_scene_light(rng.random() < 0.5)
            case 6:
                world.set_time_of_day(rng.uniform(0.0, 86400.0), rng.choice([0.0, 60.0]))
            case 24:
                rain, snow, fog = (rng.choice([0.0, 0.0, 0.5, 1.0]) for _ in range(3))
                world.set_weather(autodrive.Weather(fog=fog, rain=rain, snow=snow))
            case 7:
                world.set_driving_mode(rng.choice(world.vehicle_names), rng.random() < 0.5)
            case number if number < 24:
                self._meet_a_box(rng, world)

    def _meet_a_box(self, rng: random.Random, world: World) -> None:
        """Bring a vehicle to within half a metre of a box or of another vehicle, facing it."""
        name = rng.choice(world.vehicle_names)
        target = rng.choice([other for other in (*world.boxes, *world.vehicle_names) if other != name])
        x, y = world.pose(target)[:2].tolist()
        if abs(x) > 50.0 or abs(y) > 50.0:  # driven or pushed far away
            world.reset()
            self.counts["resets"] += 1
            return
        try:
            world.teleport(name, x - rng.uniform(0.3, 0.6), y + rng.uniform(-0.05, 0.05), rng.uniform(-0.1, 0.1))
            self.counts["teleports"] += 1
        except CommandError:  # a wall or another object is there
            self.counts["refused teleports"] += 1

    def digest(self) -> str:
        """SHA-256 of the State and of the whole Frame."""
        saved = self.world.save()
        parts = [*(column.tobytes() for column in columns_of(saved.row)), *bytes_of(saved.frame)]
        return hashlib.sha256(b"|".join(parts)).hexdigest()


def driven(scenario: str, hours: float, parts: int = 20) -> dict[str, Any]:
    """What a drive in that scenario gives: counts, memory after each part, the digest of its end."""
    start = time.process_time()
    drive = LongDrive(SCENARIOS[scenario])
    used = []
    for part in range(parts):
        drive.drive(3600.0 * hours / parts)
        used.append(memory())
        print(json.dumps({"part": part + 1, "of": parts, "memory": used[-1], **drive.counts}), flush=True)
    return {
        "scenario": scenario,
        "hours": hours,
        **drive.counts,
        "memory": used,
        "threads": len(list(Path("/proc/self/task").iterdir())),
        "descriptors": open_files(),
        "digest": drive.digest(),
        "processor time": time.process_time() - start,
    }


if __name__ == "__main__":
    print(json.dumps(driven(sys.argv[1], float(sys.argv[2]))))
