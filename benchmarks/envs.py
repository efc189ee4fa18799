"""Speed of a vector environment: environment steps a second, and what the environment adds to the batch call.

    uv run benchmarks/envs.py [--id NigelNavigation-v0] [--num-envs 256] [--frame-skip 1] [--threads 1] [--cars 2]
        [--variant published]

Medians of rounds, CPU time of all threads, and wall time. All cars drive with random actions, each held for half a
second, so that episodes end and start again. `--cars`: of each race of RoboRacer-v0. `--variant`: of NigelCrossing-v0
and RoboRacerDuel-v0, whose environments are cars, too. The batch calls (`step`, `reset`) are timed inside of the
environment's, in the same run.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

ROUNDS, TICKS, HELD = 15, 200, 50
"""Rounds, and ticks of each; ticks for which an action is held."""


class Timed:
    """A function that adds up its CPU time [s]."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.total = 0.0

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call it."""
        start = time.process_time()
        result = self._function(*args, **kwargs)
        self.total += time.process_time() - start
        return result


def random_actions(rng: np.random.Generator, space: spaces.Space[Any], shape: tuple[int, int]) -> np.ndarray:
    """Of any kind; throttles that are not discrete are not negative."""
    if isinstance(space, spaces.Discrete):
        return rng.integers(int(space.n), size=shape)
    return rng.uniform((0.0, -1.0), (1.0, 1.0), (*shape, 2)).astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--id", default="NigelNavigation-v0")
    parser.add_argument("--num-envs", type=int, default=256)
    parser.add_argument("--frame-skip", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--cars", type=int)
    parser.add_argument("--variant", choices=("published", "own"))
    options = parser.parse_args()
    settings = {"frame_skip": options.frame_skip, "threads": options.threads}
    settings |= {"cars": options.cars} if options.cars else {}
    settings |= {"variant": options.variant} if options.variant else {}
    envs: Any = gymnasium.make_vec(f"autodrive:{options.id}", options.num_envs, **settings)
    envs.batch.step, envs.batch.reset = Timed(envs.batch.step), Timed(envs.batch.reset)
    rng = np.random.default_rng(1)
    envs.reset(seed=1)
    steps, held = max(1, TICKS // options.frame_skip), max(1, HELD // options.frame_skip)
    whole, walls, of_step, of_reset, episodes = [], [], [], [], 0
    for _ in range(ROUNDS):
        envs.batch.step.total = envs.batch.reset.total = 0.0
        actions = random_actions(rng, envs.single_action_space, (steps // held + 1, options.num_envs))
        start, wall = time.process_time(), time.perf_counter()
        for k in range(steps):
            _, _, terminated, truncated, _ = envs.step(actions[k // held])
            episodes += int((terminated | truncated).sum())
        whole.append(time.process_time() - start)
        walls.append(time.perf_counter() - wall)
        of_step.append(envs.batch.step.total)
        of_reset.append(envs.batch.reset.total)
    count = steps * options.num_envs
    rate = statistics.median(count / seconds for seconds in whole)
    batch = statistics.median(count / (step + reset) for step, reset in zip(of_step, of_reset, strict=True))
    overhead = statistics.median(w / (s + r) - 1.0 for w, s, r in zip(whole, of_step, of_reset, strict=True))
    share = statistics.median(r / w for w, r in zip(whole, of_reset, strict=True))
    print(f"{options.id}, {options.num_envs} environments, frame_skip {options.frame_skip}, threads {options.threads}")
    print(
        f"{rate:,.0f} steps/s of CPU time; the batch calls alone {batch:,.0f} steps/s; overhead {100 * overhead:.1f} %"
    )
    print(f"{statistics.median(count / seconds for seconds in walls):,.0f} steps/s with these threads at this load")
    length = ROUNDS * count / max(episodes, 1)
    print(f"{100 * share:.1f} % of the time is resets; an episode has {length:,.0f} steps")


if __name__ == "__main__":
    main()
