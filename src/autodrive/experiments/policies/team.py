"""Lets policies drive all cars of a task of several cars, with or without the page."""

from __future__ import annotations

import itertools
import runpy
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.crossing import Crossing
from autodrive.experiments.envs.duel import DRIVEN, Duel
from autodrive.experiments.envs.episodes import Episodes, observed
from autodrive.experiments.envs.rendered_world import RenderedWorld
from autodrive.experiments.envs.settings import EnvSettings
from autodrive.experiments.envs.several_cars import SeveralCarsVectorEnv
from autodrive.experiments.envs.task import CarReadings, Task
from autodrive.experiments.envs.time_trial import TimeTrial
from autodrive.experiments.policies.policy import PolicyDrivers
from autodrive.experiments.policies.racer import PolicyRacer

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.experiments.envs.task import Bools
    from autodrive.experiments.policies.foreign import ForeignPolicy
    from autodrive.experiments.policies.policy import Policy

TICKS = 5
"""Ticks of an action in the crossing."""
SECONDS = {"crossing": 30.0, "duel": 120.0}
"""Longest duration of an episode [s], by task."""
TRACKS, TRACK_SEED = 8, 1000
"""Random tracks of a duel of policies; none of them is trained on."""

Act: TypeAlias = Callable[[NDArray[np.float32], CarReadings], "Floats"]
"""Throttle and steering of n cars, shape (n, 2), for their observations, shape (n, n_number), and their readings."""


class Team(NamedTuple):
    """What drives all cars of a task."""

    task: Task
    start: Callable[[int], Act]
    """Makes what drives so many cars, whose episodes begin."""

    @property
    def ticks(self) -> int:
        """Ticks of an action."""
        return self.task.frame_skip if isinstance(self.task, Duel) else TICKS

    @property
    def steps(self) -> int:
        """Most steps of an episode."""
        return round(SECONDS[self.task.name] / (self.task.scenario.tick * self.ticks))


class Results(NamedTuple):
    """Results of some episodes; each array has the shape (episodes, cars)."""

    is_success: Bools
    has_collided: Bools
    """Whether the car touched something before its episode ended."""
    is_at_fault: Bools
    """Whether the car has collided, unless that was a car behind it on the track."""


def foreign_team(policy: ForeignPolicy, rival: ForeignPolicy | None = None, *, has_noise: bool = False) -> Team:
    """A network that was trained elsewhere, in the published variant of its task.

    `rival`: drives the second car of the duel; None: `policy`. `has_noise`: whether the LIDAR of the duel has the noise
    of its data sheet.
    """
    task = Crossing(TICKS, "published") if policy.shape.task == Crossing.name else _duel("published", has_noise)
    drivers = [policy] if rival is None else [policy, rival]

    def act(observations: NDArray[np.float32], _: CarReadings) -> Floats:
        chosen = np.empty(len(observations), np.int64)
        for k, driver in enumerate(drivers):
            chosen[k :: len(drivers)] = driver.act(observations[k :: len(drivers)])
        return task.choices[chosen]

    return Team(task, lambda _: act)


def learnt_team(policy: Policy) -> Team:
    """A policy that was trained here drives through the crossing, variant "own". Raises `SpecError`: another task."""
    if policy.task != Crossing.name:
        raise SpecError([f"the policy was trained for '{policy.task}', not for '{Crossing.name}'"])
    task = Crossing(TICKS)
    names = [feature.name for feature in observed(task, "state")]

    def start(count: int) -> Act:
        drivers = PolicyDrivers(policy, names, count)
        return lambda observations, _: drivers.act(observations)

    return Team(task, start)


def duel_team(first: Policy | Act, second: Policy | Act, *, laps: int = 2, has_noise: bool = False) -> Team:
    """Two policies that race, or what else drives cars with the LIDAR, in the variant "own" of the duel.

    `first` drives V1, `second` V2. Raises `SpecError` for a policy of another task.
    """
    for policy in (first, second):
        if not callable(policy) and policy.task != TimeTrial.name:
            raise SpecError([f"the policy was trained for '{policy.task}', not for a race"])

    def start(count: int) -> Act:
        racers = [driver if callable(driver) else PolicyRacer(driver, count // 2).act_all for driver in (first, second)]

        def act(observations: NDArray[np.float32], cars: CarReadings) -> Floats:
            commands = np.empty((count, 2))
            for k, racer in enumerate(racers):
                rows = np.arange(k, count, 2)
                commands[rows] = racer(observations[rows], cars.rows(rows))
            return commands

        return act

    return Team(_duel("own", has_noise, tracks=TRACKS, track_seed=TRACK_SEED, laps=laps), start)


def program(file: Path) -> Act:
    """The function `command` of a Python file, as in examples/racing/follow_the_gap.py, which drives by the LIDAR.

    It gets ranges [m] and angles [rad] of a scan, from right to left, and returns throttle and steering. Raises
    `SpecError` if there is no such function.
    """
    command = runpy.run_path(str(file)).get("command") if file.is_file() else None
    if not callable(command):
        raise SpecError([f"{file} does not exist, or has no function command(ranges, angles)"])
    angles = np.radians(np.linspace(-135.0, 135.0, 1081))
    return lambda _, cars: np.array([command(ranges, angles) for ranges in cars.lidar_ranges])


def drive(team: Team, episodes: int, seed: int = 0) -> Results:
    """The results of that many episodes with the seeds `seed`, `seed` + 1, ..."""
    task = team.task
    cars = len(task.scenario.vehicles)
    envs = SeveralCarsVectorEnv(
        cars * episodes, task, max_episode_steps=team.steps, autoreset_mode="NextStep", frame_skip=team.ticks
    )
    tally = _Tally(task, cars * episodes)
    act = team.start(cars * episodes)
    with closing(envs):
        observations, _ = envs.reset(seed=seed)
        while not tally.is_over.all():
            commands = act(observations, CarReadings.of(envs.batch.readings, cars))
            observations, _, terminated, truncated, info = envs.step(commands)
            ends = tally.is_over | terminated | truncated | ~envs.is_live
            tally.add(ends, info["is_success"], CarReadings.of(envs.batch.readings, cars), envs.memory)
    return tally.results(cars)


def show(
    team: Team,
    episodes: int | None = None,
    seed: int = 0,
    *,
    mode: Literal["human"] | None = "human",
    port: int | None = None,
    is_real_time: bool = True,
) -> Results:
    """Drive one episode after the other with the page, on that port; `episodes` None: until Ctrl-C.

    `mode` None: without the page, as fast as possible. The bits are those of `drive`.
    """
    settings = EnvSettings(observation="state", frame_skip=team.ticks, render_mode=mode)
    results: list[Results] = []
    world = RenderedWorld(
        team.task.scenario,
        settings,
        task=team.task.name,
        has_camera=False,
        port=port,
        is_real_time=is_real_time,
    )
    with closing(world) as rendered:
        for number in itertools.count() if episodes is None else range(episodes):
            results.append(_episode(team, rendered, seed + number))
            if mode == "human":
                print(f"episode {number + 1}: {_described(team.task, results[-1])}", flush=True)
    return Results(*map(np.concatenate, zip(*results, strict=True)))


def summary(team: Team, results: Results) -> str:
    """The results of all episodes in words, for people."""
    count, cars = results.is_success.shape
    number = f"{count} episode{'s' * (count > 1)}"
    if not _is_own_duel(team.task):
        share, whole = results.is_success.mean(), results.is_success.all(axis=1).mean()
        text = f"{number}: {share:.1%} of the cars succeeded, all {cars} in {whole:.1%}"
        if not isinstance(team.task, Duel):
            return text
        shares = zip(team.task.scenario.vehicles, results.is_success.mean(axis=0), strict=True)
        return f"{text}; " + ", ".join(f"{name} in {part:.1%}" for name, part in shares)
    columns = zip(team.task.scenario.vehicles, *(result.mean(axis=0) for result in results), strict=True)
    return f"{number}: " + "; ".join(
        f"{name} won {won:.1%}, collided in {hit:.1%}, by its own fault in {fault:.1%}"
        for name, won, hit, fault in columns
    )


def _described(task: Task, results: Results) -> str:
    """How an episode ended."""
    (is_success,) = results.is_success
    if _is_own_duel(task):
        return f"{[*task.scenario.vehicles][int(is_success.argmax())]} won" if is_success.any() else "nobody won"
    return f"{is_success.sum()} of {len(is_success)} cars succeeded"


def _is_own_duel(task: Task) -> bool:
    return isinstance(task, Duel) and not task.is_published


def _duel(variant: Literal["own", "published"], has_noise: bool, **settings: Any) -> Duel:
    task = Duel(None, variant, **settings)
    if not has_noise:
        task.set_lidar(noise="file")
    return task


class _Tally:
    """The first episodes of n cars."""

    def __init__(self, task: Task, count: int) -> None:
        self._cars = len(task.scenario.vehicles)
        self._is_race = isinstance(task, Duel)
        self.is_over, self.is_success = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._has_collided, self._is_hit = np.zeros(count, np.bool_), np.zeros(count, np.bool_)

    def add(self, ends: Bools, is_success: Bools, cars: CarReadings, memory: Floats) -> None:
        """A step of all cars; `ends`: whether the episode of each has ended, in this step or before."""
        now = ends & ~self.is_over
        collides = now & (cars.collision_count > 0)
        if self._is_race:
            both = collides.reshape(-1, 2).all(axis=1)
            driven = memory[:, DRIVEN].reshape(-1, 2)
            self._is_hit |= (both.reshape(-1, 1) & (driven > driven[:, ::-1])).ravel()
        self.is_success |= now & is_success
        self._has_collided |= collides
        self.is_over |= ends

    def results(self, cars: int) -> Results:
        """The results of all episodes."""
        columns = self.is_success, self._has_collided, self._has_collided & ~self._is_hit
        return Results(*(column.reshape(-1, cars) for column in columns))


def _episode(team: Team, rendered: RenderedWorld, seed: int) -> Results:
    rng, task = seeding.np_random(seed)[0], team.task
    world_seed, starts = int(rng.integers(2**31)), task.starts(rng)
    poses = {name: pose for start in starts for name, pose in start.poses.items()}
    names, seen = list(task.scenario.vehicles), Episodes(task, "state", len(starts))
    cars = CarReadings.of(
        rendered.reset([0], [world_seed], poses={name: [pose] for name, pose in poses.items()}), len(starts)
    )
    seen.begin(np.arange(len(starts)), starts, cars)
    tally, act = _Tally(task, len(names)), team.start(len(names))
    for step in range(team.steps):
        commands = np.where(tally.is_over[:, None], 0.0, act(seen.numbers(), cars))
        commands[:, 0] *= task.throttle_factors(seen.memory)
        readings = rendered.step(commands[None], team.ticks)
        cars = CarReadings.of(readings, len(names))
        outcome = seen.advance(cars, np.repeat(readings.is_unstable, len(names)))
        is_late = step + 1 == team.steps
        tally.add(outcome.has_ended | tally.is_over | is_late, outcome.is_success, cars, seen.memory)
        driven = seen.memory[:, DRIVEN] if isinstance(task, Duel) else None
        rendered.tell(tally.is_over, tally.is_success, None if driven is None else float(driven[0] - driven[1]))
        if tally.is_over.all():
            break
    return tally.results(len(names))
