"""Cost of LIDAR, physics and cameras on race tracks, and how it depends on the length of the track.

    python benchmarks/tracks.py [--cameras]

Times are processor times of one thread, the least of several repetitions, so that other programs disturb them little.
"""

from __future__ import annotations

import argparse
import itertools
import math
import tempfile
import time
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np

import autodrive
from autodrive.physics.sensors.suite import SensorSuite
from autodrive.scenario import VehiclePlacement
from autodrive.scenario.tracks.shape import resampled, walls_along
from autodrive.scenario.tracks.track import DUCT, Track

LENGTHS = (100.0, 400.0, 1600.0)


def serpentine(length: float) -> Track:
    """A track of about that length whose surroundings look the same everywhere: rows of 20 m, 3 m apart."""
    rows = max(2, 2 * round(length / 46.0))
    corners = [(x, 3.0 * row) for row in range(rows) for x in ((0.0, 20.0) if row % 2 == 0 else (20.0, 0.0))]
    corners += [(-3.0, 3.0 * (rows - 1)), (-3.0, 0.0)]
    points = resampled(np.array(corners), 0.1)
    for _ in range(60):
        points = (np.roll(points, 1, axis=0) + 2.0 * points + np.roll(points, -1, axis=0)) / 4.0
    line = np.hstack([np.roll(points, -100, axis=0), np.full((len(points), 2), 0.6)])
    return Track(f"serpentine_{length:g}", line, walls=walls_along(line), barrier=DUCT)


def least(call: Callable[[], object], count: int = 100) -> float:
    """Processor time of a call [us], the least of ten means."""
    found = math.inf
    for _ in range(10):
        start = time.thread_time()
        for _ in range(count):
            call()
        found = min(found, (time.thread_time() - start) / count)
    return found * 1e6


def world_on(track: str, *, engine: Literal["auto", "always"] = "auto", cameras: bool = False) -> autodrive.World:
    """A RoboRacer at the start line."""
    x, y, yaw = Track.load(track).start_pose
    placed = VehiclePlacement(type="roboracer", x=x, y=y, yaw_deg=math.degrees(yaw))
    return autodrive.make(autodrive.Scenario(map=track, vehicles={"V1": placed}), engine=engine, cameras=cameras)


def scan_time(world: autodrive.World) -> float:
    """Time of a scan of the LIDAR, as the World samples it [us]."""
    c = world.compiled
    vehicles = {"V1": {"lidar": c.configured["V1"]["lidar"]}}
    period = 1 / Fraction(str(c.configured["V1"]["lidar"].spec.rate))
    suite = SensorSuite(vehicles, c.model.shapes, c.state, substep=period, substeps=1, gravity=c.spec.gravity)
    suite.reset(0)
    periods = itertools.count()
    return least(lambda: suite.sample(next(periods)))


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", action="store_true", help="also the pictures of the camera")
    options = parser.parse_args()
    print(f"{'track':<18} {'length':>8} {'pieces':>7} {'scan':>8} {'tick':>8} {'tick, engine always':>20}   [m, us]")
    with tempfile.TemporaryDirectory() as folder:
        tracks = ["fast", "practice", "technical"]
        for length in LENGTHS:
            track = serpentine(length)
            tracks.append(str(Path(folder) / f"{track.name}.yaml"))
            track.save(tracks[-1])
        for name in tracks:
            world = world_on(name)
            scan = scan_time(world)
            always = world_on(name, engine="always")
            world.step({})
            always.step({})
            pieces = len(world.compiled.map.statics)
            print(
                f"{Path(name).stem:<18} {Track.load(name).length:8.0f} {pieces:7} {scan:8.1f} "
                f"{least(lambda w=world: w.step({})):8.1f} {least(lambda w=always: w.step({})):20.1f}",
                flush=True,
            )
            if options.cameras:
                print(f"{'':<18} picture {picture_time(name):8.1f} ms", flush=True)


def picture_time(name: str) -> float:
    """Wall time of a tick with a picture of the front camera [ms], the least of several."""
    world = world_on(name, cameras=True)
    found = math.inf
    for _ in range(40):
        before = world.frame.vehicles["V1"].cameras["front"]
        start = time.perf_counter()
        after = world.step({}).vehicles["V1"].cameras["front"]
        if after is not before:
            found = min(found, time.perf_counter() - start)
    return found * 1e3


if __name__ == "__main__":
    main()
