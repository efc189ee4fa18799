"""CPU time of a tick: `world.step` of 10 ms with a scan of 1080 rays and the complete Frame.

    uv run benchmarks/step.py [--f1tenth-gym PYTHON]

CPU time of one core, medians. A tick of a World is also compared with a tick of one world of a batch with the same car,
in turn: what the World adds is the Frame. With a Python that has f1tenth_gym installed, its `env.step` of 10 ms (with
a scan of 1080 rays) is measured, too.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import yaml

import autodrive
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world.batch import BatchWorld

ROUNDS, TICKS, WORLDS = 15, 200, 64
VEHICLE = Path(autodrive.__file__).parent / "scenario/data/vehicles/nigel.yaml"

PEER = """
import time, numpy as np, gym, f110_gym, sys
env = gym.make('f110_gym:f110-v0', map=sys.argv[1], map_ext='.png', num_agents=1)
env.reset(np.array([[0.0, 0.0, 0.0]]))
for _ in range(50): env.step(np.array([[0.1, 1.0]]))
for _ in range(15):
    start = time.process_time()
    for _ in range(200): env.step(np.array([[0.1, 1.0]]))
    print((time.process_time() - start) / 200 * 1e6)
"""


def with_fast_lidar(folder: Path) -> str:
    """Vehicle file of nigel with 1080 rays at 100 Hz: a scan in every tick."""
    tree = yaml.safe_load(VEHICLE.read_text())
    tree["sensors"]["lidar"] |= {"rays": 1080, "rate": 100.0}
    file = folder / "nigel_1080.yaml"
    file.write_text(yaml.safe_dump(tree))
    return str(file)


def ours(scenario_map: str, folder: Path) -> tuple[list[float], list[float]]:
    """CPU time of a tick of a World and of one world of a batch in each round [us]."""
    car = VehiclePlacement(type=with_fast_lidar(folder), x=-1.1, y=-0.15)
    spec = ScenarioSpec(map=scenario_map, vehicles={"V1": car})
    world, batch = autodrive.make(spec), BatchWorld(spec, WORLDS, threads=1)
    command = {"V1": autodrive.Command(throttle=0.4, steering=0.05)}
    commands = np.tile([0.4, 0.05], (WORLDS, 1, 1))
    single: list[float] = []
    many: list[float] = []
    for _ in range(ROUNDS):
        world.reset()
        for _ in range(20):
            world.step(command)
        start = time.process_time()
        for _ in range(TICKS):
            world.step(command)
        single.append((time.process_time() - start) / TICKS * 1e6)
        batch.reset()
        batch.step(commands, 20)
        start = time.process_time()
        for _ in range(TICKS // 10):
            batch.step(commands)
        many.append((time.process_time() - start) / (TICKS // 10 * WORLDS) * 1e6)
    return single, many


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--f1tenth-gym", metavar="PYTHON", help="interpreter of an environment with f1tenth_gym")
    parser.add_argument("--f1tenth-map", metavar="MAP", help="map of f1tenth_gym, without .yaml", default="vegas")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures, many = ours("tiny_town", Path(folder))
    ratio = statistics.median(mine / other for mine, other in zip(figures, many, strict=True))
    print(f"world.step, tiny_town, 1080 rays each tick: {statistics.median(figures):.1f} us (best {min(figures):.1f})")
    print(f"a tick of a world in a batch of {WORLDS}: {statistics.median(many):.1f} us; ratio {ratio:.2f}")
    if arguments.f1tenth_gym:
        peer = subprocess.run(
            [arguments.f1tenth_gym, "-c", PEER, arguments.f1tenth_map], check=True, capture_output=True, text=True
        )
        median = statistics.median(float(line) for line in peer.stdout.split())
        print(f"f1tenth_gym env.step: {median:.1f} us; ratio ours/theirs {statistics.median(figures) / median:.2f}")


if __name__ == "__main__":
    main()
