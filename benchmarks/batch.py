"""CPU time and memory of a batch of worlds: one 10 ms tick of one world, in a batch of 256 worlds of `tiny_town`.

    uv run benchmarks/batch.py [--f1tenth-gym PYTHON] [--gymkhana PYTHON]

Medians of CPU time, except the ratio of two threads to one, which is wall time. With a Python that has f1tenth_gym or
gymkhana installed, a 10 ms step of one of its cars with a scan of 1080 rays is measured, too.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from step import PEER, with_fast_lidar

import autodrive
from autodrive.scenario import ScenarioSpec, load_scenario
from autodrive.world.batch import BatchWorld

N, ROUNDS, TICKS = 256, 31, 5

GYMKHANA = """
import sys, time, numpy as np, gymnasium as gym, gymkhana
from gymkhana.envs.track import Track
angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
track = Track.from_refline(10.0 * np.cos(angle), 10.0 * np.sin(angle), np.full(200, 3.0))
rows, columns = np.indices(track.occupancy_map.shape)
x, y = (track.spec.origin[i] + track.spec.resolution * axis for i, axis in enumerate((columns, rows)))
track.occupancy_map[abs(np.hypot(x, y) - 10.0) > 1.5] = 0.0
track.centerline.w_lefts = track.centerline.w_rights = np.full(len(track.centerline.ss), 1.5)
step, integrator_step = map(float, sys.argv[1].split(','))
env = gym.make('gymkhana-v0', config={
    'num_agents': 1, 'map': track, 'timestep': step, 'integrator_timestep': integrator_step})
env.reset()
"""
"""On a ring 3 m wide; the maps of gymkhana are downloads. Argument: durations of a step and of its integration [s]."""

GYMKHANA_TIMES = """
action = np.zeros(env.action_space.shape)
for _ in range(50): env.step(action)
for _ in range(15):
    start = time.process_time()
    for _ in range(200): env.step(action)
    print((time.process_time() - start) / 200 * 1e6)
"""


def scenario(vehicle: str, cars: int = 1, *, has_lidar: bool = True) -> ScenarioSpec:
    """So many cars of that type in `tiny_town`, one behind the other."""
    first = load_scenario("tiny_town").vehicles["V1"]
    sensors = {} if has_lidar else {"lidar": {"is_on": False}}
    vehicles: Any = {
        f"V{i + 1}": first.model_dump() | {"type": vehicle, "x": first.x + 0.8 * i, "sensors": sensors}
        for i in range(cars)
    }
    return ScenarioSpec(map="tiny_town", vehicles=vehicles)


def drive(batch: BatchWorld, clock: Any, rounds: int = ROUNDS) -> float:
    """Time of one tick of one world by that clock: median of the rounds [us]. Nothing touches."""
    commands = np.zeros((batch.n, len(batch.vehicle_names), 2))
    commands[..., 0] = 0.3
    commands[..., 1] = np.linspace(-0.3, 0.3, batch.n)[:, None]
    figures = []
    for _ in range(rounds):
        batch.reset()
        start = clock()
        for _ in range(TICKS):
            batch.step(commands)
        figures.append((clock() - start) / TICKS / batch.n * 1e6)
    return statistics.median(figures)


def single(spec: ScenarioSpec) -> float:
    """CPU time of `World.step` [us]."""
    world = autodrive.make(spec)
    figures = []
    for _ in range(15):
        world.reset()
        start = time.process_time()
        for _ in range(100):
            world.step({"V1": autodrive.Command(throttle=0.3, steering=0.1)})
        figures.append((time.process_time() - start) / 100 * 1e6)
    return statistics.median(figures)


def memory(n: int) -> float:
    """Memory of a process with a batch of n worlds that has run some ticks [KiB]."""
    program = f"import batch; print(batch.resident({n}))"
    shown = subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parent, check=True, capture_output=True)
    return float(shown.stdout)


def resident(n: int) -> float:
    """See `memory`; of this process."""
    with tempfile.TemporaryDirectory() as folder:
        batch = BatchWorld(scenario(with_fast_lidar(Path(folder))), n, threads=1)
    drive(batch, time.process_time, rounds=1)
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--f1tenth-gym", metavar="PYTHON", help="interpreter of an environment with f1tenth_gym")
    parser.add_argument("--f1tenth-map", metavar="MAP", help="map of f1tenth_gym, without .yaml", default="vegas")
    parser.add_argument("--gymkhana", metavar="PYTHON", help="interpreter of an environment with gymkhana")
    arguments = parser.parse_args()
    cpu = time.process_time
    with tempfile.TemporaryDirectory() as folder:
        fast = with_fast_lidar(Path(folder))
        with_scan = drive(BatchWorld(scenario(fast), N, threads=1), cpu)
        print(f"one car, 1080 rays each tick: {with_scan:.1f} us")
        print(f"the same without LIDAR: {drive(BatchWorld(scenario(fast, has_lidar=False), N, threads=1), cpu):.1f} us")
        print(f"one car, sensors at their own rates: {drive(BatchWorld(scenario('nigel'), N, threads=1), cpu):.1f} us")
        print(f"two cars, 1080 rays each tick: {drive(BatchWorld(scenario(fast, 2), N, threads=1), cpu):.1f} us")
        singles = single(scenario(fast)), single(scenario("nigel"))
        print(f"World.step, 1080 rays each tick / own rates: {singles[0]:.1f} / {singles[1]:.1f} us")
        one, two = (BatchWorld(scenario(fast), 4 * N, threads=threads) for threads in (1, 2))
        ratios = [drive(one, time.perf_counter, 3) / drive(two, time.perf_counter, 3) for _ in range(7)]
        print(f"two threads / one: {statistics.median(ratios):.2f}")
    print(f"memory of a world beyond the first, of 1,024: {(memory(1024) - memory(1)) / 1023:.1f} KiB")
    for name, python, program, argument in (
        ("f1tenth_gym", arguments.f1tenth_gym, PEER, arguments.f1tenth_map),
        ("gymkhana", arguments.gymkhana, GYMKHANA + GYMKHANA_TIMES, "0.01,0.01"),
    ):
        if python:
            shown = subprocess.run([python, "-c", program, argument], check=True, capture_output=True, text=True)
            theirs = statistics.median(float(line) for line in shown.stdout.split())
            print(f"{name} env.step: {theirs:.1f} us; ratio theirs/ours {theirs / with_scan:.1f}")


if __name__ == "__main__":
    main()
