"""Speed of a town with traffic: `world.step` of Tiny Town with a car of the user and cars that drive themselves.

    uv run benchmarks/traffic.py [CARS ...]

Simulated seconds per second of one core, and the time of a tick, after ten simulated seconds. The cars drive, wait and
turn, so that the contact engine works in some ticks and rests in others.
"""

from __future__ import annotations

import argparse
import time

import autodrive
from autodrive.scenario.scenario import TrafficSpec

SECONDS = 60.0


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cars", nargs="*", type=int, default=[0, 6, 12, 20])
    for cars in parser.parse_args().cars:
        start = {"V1": autodrive.VehiclePlacement(x=-1.1, y=-0.15)}
        world = autodrive.make(autodrive.Scenario(map="tiny_town", vehicles=start, traffic=TrafficSpec(cars=cars)))
        while world.time < 10.0:
            world.step()
        before, wall = time.process_time(), time.perf_counter()
        while world.time < 10.0 + SECONDS:
            world.step()
        used, wall = time.process_time() - before, time.perf_counter() - wall
        tick = used / (SECONDS / world.tick_duration)
        speeds = f"{SECONDS / used:5.0f} times real time ({SECONDS / wall:.0f} by the clock of the wall)"
        print(f"{cars:3} cars: {speeds}, {tick * 1e6:4.0f} us a tick")


if __name__ == "__main__":
    main()
