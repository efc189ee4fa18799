"""Lets policies drive all cars of a task of several cars, with or without the page."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import closing
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.crossing import Crossing
from autodrive.experiments.envs.duel import Duel
from autodrive.experiments.envs.episodes import Episodes, observed
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.settings import Settings
from autodrive.experiments.envs.several_cars import SeveralCarsVectorEnv
from autodrive.experiments.envs.task import CarReadings
from autodrive.experiments.policies.policy import Drivers
from autodrive.protocol.messages import Command

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.experiments.envs.task import Bools, Task
    from autodrive.experiments.policies.foreign import ForeignPolicy
    from autodrive.experiments.policies.policy import Policy

TICKS = 5
"""Of an action."""
STEPS = {"crossing": 600, "duel": 4800}
"""Of an episode."""
Act: TypeAlias = Callable[[NDArray[np.float32]], "Floats"]
"""Throttle and steering of all cars, shape (n, 2), for their observations, shape (n, n_number)."""


class Team(NamedTuple):
    """What drives all cars of a task."""

    task: Task
    start: Callable[[int], Act]
    """Makes the driver of so many cars, whose episodes begin."""


def foreign_team(policy: ForeignPolicy, *, has_noise: bool = False) -> Team:
    """A network that was trained elsewhere, in the published variant of its task.

    `has_noise`: whether the LIDAR of the duel has the noise of its data sheet.
    """
    task = {"crossing": Crossing, "duel": Duel}[policy.shape.task](TICKS, "published")
    if task.name == Duel.name and not has_noise:
        cars = {name: car.model_copy(update={"sensors": {}}) for name, car in task.scenario.vehicles.items()}
        task.scenario = task.scenario.model_copy(update={"vehicles": cars})
    return Team(task, lambda _: lambda observations: task.choices[policy.act(observations)])


def learnt_team(policy: Policy) -> Team:
    """A policy that was trained here, in the variant "own". Raises `SpecError` if it is for another task."""
    if policy.task != Crossing.name:
        raise SpecError([f"the policy was trained for '{policy.task}', not for '{Crossing.name}'"])
    task = Crossing(TICKS)
    names = [one.name for one in observed(task, "state")]
    return Team(task, lambda count: Drivers(policy, names, count).act)


def drive(team: Team, episodes: int, seed: int = 0) -> Bools:
    """Which cars succeed in so many episodes with the seeds `seed`, `seed` + 1, ..., shape (episodes, cars)."""
    task = team.task
    cars = len(task.scenario.vehicles)
    steps = STEPS[task.name]
    envs = SeveralCarsVectorEnv(
        cars * episodes, task, max_episode_steps=steps, autoreset_mode="SameStep", frame_skip=TICKS
    )
    successes, is_over = np.zeros(cars * episodes, np.bool_), np.zeros(cars * episodes, np.bool_)
    act = team.start(cars * episodes)
    with closing(envs):
        observations, _ = envs.reset(seed=seed)
        while not is_over.all():
            observations, _, terminated, truncated, info = envs.step(act(observations))
            if (ended := (terminated | truncated) & ~is_over).any():
                successes[ended] = info["final_info"]["is_success"][ended]
                is_over |= ended
    return successes.reshape(episodes, cars)


def show(
    team: Team,
    episodes: int | None = None,
    seed: int = 0,
    *,
    mode: Literal["human"] | None = "human",
    port: int | None = None,
    is_real_time: bool = True,
) -> Bools:
    """Likewise, one episode after the other, with the page, on that port; `episodes` None: until Ctrl-C.

    `mode` None: without the page, as fast as possible. The bits are those of `drive`.
    """
    settings = Settings(None, "state", frame_skip=TICKS, render_mode=mode)
    successes: list[Bools] = []
    world = RenderedWorld(team.task.scenario, settings, has_camera=False, port=port, is_real_time=is_real_time)
    with closing(world) as rendered:
        for number in itertools.count() if episodes is None else range(episodes):
            successes.append(_episode(team, rendered, seed + number))
            if mode == "human":
                print(f"episode {number + 1}: {successes[-1].sum()} of {len(successes[-1])} cars succeeded", flush=True)
    return np.array(successes)


def _episode(team: Team, rendered: RenderedWorld, seed: int) -> Bools:
    rng, task = seeding.np_random(seed)[0], team.task
    world_seed, starts = int(rng.integers(2**31)), task.starts(rng)
    poses = {name: pose for start in starts for name, pose in start.poses.items()}
    names, seen = list(task.scenario.vehicles), Episodes(task, "state", len(starts))
    seen.begin(np.arange(len(starts)), starts, CarReadings.of_frame(rendered.reset(world_seed, poses)))
    is_live, successes = np.ones(len(names), np.bool_), np.zeros(len(names), np.bool_)
    act = team.start(len(names))
    for _ in range(STEPS[task.name]):
        commands = np.where(is_live[:, None], act(seen.numbers()), 0.0)
        commands[:, 0] *= task.throttle_factors(seen.memory)
        frame = rendered.step({name: Command(*one) for name, one in zip(names, commands.tolist(), strict=True)})
        outcome = seen.advance(CarReadings.of_frame(frame))
        successes |= outcome.is_success & is_live
        is_live &= ~outcome.has_ended
        if not is_live.any():
            break
    return successes
