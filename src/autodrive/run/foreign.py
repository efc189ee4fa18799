"""Lets a foreign policy drive all cars of the published task that it was made for, with or without the page."""

from __future__ import annotations

import itertools
from contextlib import closing
from typing import TYPE_CHECKING, Literal

import numpy as np
from gymnasium.utils import seeding

from autodrive.experiments.envs.crossing import Crossing
from autodrive.experiments.envs.duel import Duel
from autodrive.experiments.envs.episodes import Episodes
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.settings import Settings
from autodrive.experiments.envs.several_cars import SeveralCarsVectorEnv
from autodrive.experiments.envs.task import CarReadings
from autodrive.protocol.messages import Command

if TYPE_CHECKING:
    from collections.abc import Callable

    from autodrive.experiments.envs.task import Bools, Task
    from autodrive.experiments.policies.foreign import ForeignPolicy

TICKS = 5
"""Of an action."""
TASKS: dict[str, tuple[Callable[[], Task], int]] = {
    "crossing": (lambda: Crossing(TICKS, "published"), 600),
    "duel": (lambda: Duel(TICKS, "published"), 4800),
}
"""Tasks, and steps of an episode."""


def drive(policy: ForeignPolicy, episodes: int, seed: int = 0) -> Bools:
    """Which cars succeed in so many episodes with the seeds `seed`, `seed` + 1, ..., shape (episodes, cars)."""
    make, steps = TASKS[policy.shape.task]
    task = make()
    cars = len(task.scenario.vehicles)
    envs = SeveralCarsVectorEnv(
        cars * episodes, task, max_episode_steps=steps, autoreset_mode="SameStep", action="discrete", frame_skip=TICKS
    )
    successes, is_over = np.zeros(cars * episodes, np.bool_), np.zeros(cars * episodes, np.bool_)
    with closing(envs):
        observations, _ = envs.reset(seed=seed)
        while not is_over.all():
            observations, _, terminated, truncated, info = envs.step(policy.act(observations))
            if (ended := (terminated | truncated) & ~is_over).any():
                successes[ended] = info["final_info"]["is_success"][ended]
                is_over |= ended
    return successes.reshape(episodes, cars)


def show(
    policy: ForeignPolicy, episodes: int | None = None, seed: int = 0, *, mode: Literal["human"] | None = "human"
) -> Bools:
    """Likewise, one episode after the other, in real time with the page; `episodes` None: until Ctrl-C.

    `mode` None: without the page, as fast as possible. The bits are those of `drive`.
    """
    make, steps = TASKS[policy.shape.task]
    task = make()
    settings = Settings(None, "state", "discrete", TICKS, mode, task.choices)
    successes: list[Bools] = []
    with closing(RenderedWorld(task.scenario, settings, has_camera=False)) as rendered:
        for number in itertools.count() if episodes is None else range(episodes):
            successes.append(_episode(policy, task, rendered, steps, seed + number))
            if mode == "human":
                print(f"episode {number + 1}: {successes[-1].sum()} of {len(successes[-1])} cars succeeded", flush=True)
    return np.array(successes)


def _episode(policy: ForeignPolicy, task: Task, rendered: RenderedWorld, steps: int, seed: int) -> Bools:
    rng = seeding.np_random(seed)[0]
    world_seed, starts = int(rng.integers(2**31)), task.starts(rng)
    poses = {name: pose for start in starts for name, pose in start.poses.items()}
    names, seen = list(task.scenario.vehicles), Episodes(task, "state", len(starts))
    seen.begin(np.arange(len(starts)), starts, CarReadings.of_frame(rendered.reset(world_seed, poses)))
    is_live, successes = np.ones(len(names), np.bool_), np.zeros(len(names), np.bool_)
    for _ in range(steps):
        commands = np.where(is_live[:, None], task.choices[policy.act(seen.numbers())], 0.0)
        commands[:, 0] *= task.throttle_factors(seen.memory)
        frame = rendered.step({name: Command(*one) for name, one in zip(names, commands.tolist(), strict=True)})
        outcome = seen.advance(CarReadings.of_frame(frame))
        successes |= outcome.is_success & is_live
        is_live &= ~outcome.has_ended
        if not is_live.any():
            break
    return successes
