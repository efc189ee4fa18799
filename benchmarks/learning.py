"""Steps per second of a race car that learns: simulation alone, with the learning, and beside other race environments.

    uv run benchmarks/learning.py [--car-racing PYTHON] [--gymkhana PYTHON]

Wall time on all cores, medians of rounds that take turns. A step of ours is an action of 25 ms with a scan of 1080 rays
at its end, on the tracks of the training. "Cars that stand" show what steps without contacts and new episodes cost; at
full throttle and straight on, 2 to 3 % of the steps end an episode at a wall. "With the learning" is a whole iteration
of examples/learning/ppo.py. The interpreters are those of environments with `gymnasium[box2d]` (CarRacing-v3: 20 ms of
a car seen from above, and a picture of 96 x 96 pixels) and with `gymkhana` (an action of 25 ms in five steps, and a
scan of 1080 rays); each of them runs in one process for each core, with random actions.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
from batch import GYMKHANA
from gymnasium.vector import VectorEnv

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "learning"))
from ppo import ENVS, HORIZON, PROBLEMS, Trainer  # pyright: ignore[reportMissingImports]  of the line before

ROUNDS = 5

CAR_RACING = """
import sys, time, gymnasium as gym
env = gym.make('CarRacing-v3')
env.reset(seed=1)
"""

RANDOM_STEPS = """
print('ready', flush=True)
sys.stdin.readline()
start, steps = time.perf_counter(), 0
while time.perf_counter() - start < 5.0:
    for _ in range(50):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    steps += 50
print(steps / (time.perf_counter() - start))
"""


def peer(python: str, program: str, argument: str) -> float:
    """Steps per second of as many processes as there are cores, together."""
    command = [python, "-c", program + RANDOM_STEPS, argument]
    processes = [
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(os.cpu_count() or 1)
    ]
    for process in processes:
        assert process.stdout is not None
        while process.stdout.readline() != "ready\n":
            assert process.poll() is None, "the peer ended"
    return sum(float(process.communicate("go\n")[0]) for process in processes)


def simulation(trainer: Trainer) -> float:
    """Steps per second with random actions."""
    actions = np.random.default_rng(1).uniform((0.03, -1.0), (0.4, 1.0), (HORIZON, ENVS, 2)).astype(np.float32)
    start = time.perf_counter()
    for action in actions:
        trainer.envs.step(action)
    return actions.size / 2 / (time.perf_counter() - start)


def driven(envs: VectorEnv, throttle: float) -> float:
    """Steps per second with that throttle, straight on."""
    action = np.tile(np.array([throttle, 0.0], np.float32), (ENVS, 1))
    start = time.perf_counter()
    for _ in range(HORIZON):
        envs.step(action)
    return ENVS * HORIZON / (time.perf_counter() - start)


def learning(trainer: Trainer) -> float:
    """Steps per second of an iteration."""
    start = time.perf_counter()
    trainer.improve()
    return ENVS * HORIZON / (time.perf_counter() - start)


def race_envs() -> VectorEnv:
    """Environments as those of the training."""
    problem = PROBLEMS["race"]
    envs = gymnasium.make_vec(problem.env, ENVS, observation=problem.observation, **problem.settings)
    envs.reset(seed=1)
    return envs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--car-racing", metavar="PYTHON", help="interpreter of an environment with gymnasium[box2d]")
    parser.add_argument("--gymkhana", metavar="PYTHON", help="interpreter of an environment with gymkhana")
    arguments = parser.parse_args()
    trainer = Trainer("race", 1)
    trainer.improve()  # compiles
    envs = {throttle: race_envs() for throttle in (0.0, 1.0)}
    measured = {
        "simulation": lambda: simulation(trainer),
        "cars that stand": lambda: driven(envs[0.0], 0.0),
        "cars at full throttle": lambda: driven(envs[1.0], 1.0),
        "with the learning": lambda: learning(trainer),
    }
    if arguments.car_racing:
        measured["CarRacing-v3"] = lambda: peer(arguments.car_racing, CAR_RACING, "")
    if arguments.gymkhana:
        measured["gymkhana"] = lambda: peer(arguments.gymkhana, GYMKHANA, "0.025,0.005")
    rates: dict[str, list[float]] = {name: [] for name in measured}
    for _ in range(ROUNDS):
        for name, measure in measured.items():
            rates[name].append(measure())
    for name, values in rates.items():
        print(f"{name}: {statistics.median(values):,.0f} steps/s")


if __name__ == "__main__":
    main()
