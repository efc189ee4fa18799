"""Races in lock-step: lap times of the example drivers, and simulated seconds per second of CPU time.

    uv run benchmarks/race.py [--laps N]

CPU time of one core. The last row: eight cars with a scan of 1081 rays each, 40 times a second, without their drivers.
"""

from __future__ import annotations

import argparse
import runpy
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import autodrive
from autodrive.protocol.messages import Command, Frame, VehicleFrame
from autodrive.scenario import RaceSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.tracks import Track
from autodrive.world import World
from autodrive.world.racing.results import RaceRecorder

EXAMPLES = Path(__file__).parents[1] / "examples" / "racing"
ANGLES = np.radians(np.linspace(-135.0, 135.0, 1081))
TRACKS = ("cdc_tf_2025", "fast", "practice", "technical")
FAST = 6.0, 4.0, 8.0
"""Accelerations of `race_line_fast`: forward, braking, sideways [m/s^2]."""
TICK = 0.025
"""Of `autodrive race` [s]."""
SPACING = 8.0
"""Distance of the eight cars along the track [m]."""

Driver = Callable[[VehicleFrame], tuple[float, float]]


def world_on(track: str, cars: int, laps: int) -> World:
    """A race on that track."""
    vehicles = {f"V{i}": VehiclePlacement(type="roboracer") for i in range(1, cars + 1)}
    return autodrive.make(
        ScenarioSpec(map=track, vehicles=vehicles, race=RaceSpec(rules="practice", laps=laps), tick=TICK)
    )


def drivers(track: Track) -> dict[str, Driver]:
    """The example drivers."""
    gap: Any = runpy.run_path(str(EXAMPLES / "follow_the_gap.py"))["command"]
    race_line: Any = runpy.run_path(str(EXAMPLES / "race_line.py"))["RaceLine"]
    line, fast_line = race_line(track), race_line(track, FAST)
    return {
        "follow_the_gap": lambda car: gap(car.lidar.ranges, ANGLES) if car.lidar else (0.0, 0.0),
        "race_line": lambda car: line.command(*car.ips.position[:2], car.imu.euler[2], car.speed),
        "race_line_fast": lambda car: fast_line.command(*car.ips.position[:2], car.imu.euler[2], car.speed),
    }


def race(track: str, name: str, laps: int) -> None:
    """Prints the figures of a race of one car."""
    world = world_on(track, 1, laps)
    drive, recorder = drivers(Track.load(track))[name], RaceRecorder()
    recorder.publish(world.frame)
    start = time.process_time()
    while not recorder.is_over and world.time < 1000.0:
        recorder.publish(world.step({"V1": Command(*drive(world.frame.vehicles["V1"]))}))
    factor = world.time / (time.process_time() - start)
    (standing,) = recorder.standings()
    *_, best, status = standing.row
    print(
        f"{track:<11} {name:<14} {status}: {standing.race_time:.2f} s, best lap {best or '-'} s, "
        f"{standing.collisions} collisions; {factor:.0f} times real time"
    )


def eight_cars(track: str, duration: float) -> None:
    """Prints how fast a world of eight cars is, without their drivers."""
    world = world_on(track, 8, 100)
    on = Track.load(track)
    drive = drivers(on)["race_line"]
    frame: Frame = world.reset(poses={f"V{i + 1}": on.pose_at(-0.5 - SPACING * i) for i in range(8)})
    spent = 0.0
    while world.time < duration:
        commands = {name: Command(*drive(car)) for name, car in frame.vehicles.items()}
        start = time.process_time()
        frame = world.step(commands)
        spent += time.process_time() - start
    hits = sum(car.collision_count for car in frame.vehicles.values())
    print(f"{track:<10} eight cars with scans: {duration / spent:.1f} times real time; {hits} collisions")


def main() -> None:
    """Prints all figures."""
    parser = argparse.ArgumentParser(description="Races in lock-step.")
    parser.add_argument("--laps", type=int, default=10)
    laps = parser.parse_args().laps
    for track in TRACKS:
        for name in ("follow_the_gap", "race_line"):
            race(track, name, laps)
    race("cdc_tf_2025", "race_line_fast", laps)
    eight_cars("practice", 20.0)


if __name__ == "__main__":
    main()
