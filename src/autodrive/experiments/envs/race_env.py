"""The PettingZoo environment of a race: 2 to 8 cars RoboRacer on a random track, in one world of a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.conditions import Conditions, Drive, Range
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.parallel_env import FEWEST, MOST
from autodrive.experiments.envs.settings import Action, Settings, action_space, commands_of
from autodrive.experiments.envs.task import CarReadings, Observation
from autodrive.experiments.envs.time_trial import DRIVEN, TimeTrial
from autodrive.world.batch import BatchWorld

WORLD = np.zeros(1, np.intp)


class RaceParallelEnv(ParallelEnv[str, Any, Any]):
    """A race of `laps` laps from a grid; observations, rewards and ends are those of `envs.time_trial`.

    Agents are 'V1', 'V2', ... The race ends for all of them when the first one has driven all laps; it has
    `info["is_success"]`. A car that collides is no longer in `agents`; it brakes and is an obstacle. `info["rank"]` is
    the place in the race, from 1; `info["distance"]` is the distance since the start line [m].
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "roboracer_race_v0",
        "render_modes": [],
        "is_parallelizable": True,
    }

    @with_suggestions
    def __init__(
        self,
        cars: int = 4,
        *,
        laps: int = 2,
        tracks: int = 3,
        track_seed: int = 0,
        friction: Range = 1.0,
        mass: Range = 1.0,
        noise: Range = 0.0,
        latency: Range = 0.0,
        max_episode_steps: int | None = 4800,
        observation: Observation = "lidar",
        action: Action = "continuous",
        frame_skip: int = 5,
    ) -> None:
        """`friction`, `mass`, `noise`, `latency`: see `Conditions`; each car has its own.

        Raises `SpecError` for wrong settings.
        """
        if isinstance(cars, bool) or not isinstance(cars, int) or not FEWEST <= cars <= MOST:
            raise SpecError([f"cars: must be a whole number from {FEWEST} to {MOST}, not {cars!r}"])
        if observation == "camera":
            raise SpecError(["observation: a race has no images. Known: state, lidar"])
        self.conditions = Conditions(friction, mass, noise, latency)
        self.settings = Settings(TimeTrial.name, observation, action, frame_skip)
        self.task = TimeTrial(frame_skip, tracks, track_seed, cars, laps)
        self.batch = BatchWorld(self.task.scenario, 1, threads=1)
        """Its only world is that of the race."""
        self.possible_agents = list(self.task.scenario.vehicles)
        self.agents: list[str] = []
        self.observation_spaces = {one: observation_space(self.task, observation) for one in self.possible_agents}
        self.action_spaces = {one: action_space(self.settings) for one in self.possible_agents}
        self.render_mode = None
        self._max_steps = max_episode_steps
        self._driver = Drive(self.batch, frame_skip)
        self._episodes = Episodes(self.task, observation, cars)
        self._rng: np.random.Generator | None = None

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object each time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object each time."""
        return self.action_spaces[agent]

    @property
    def distance(self) -> Floats:
        """Of all cars since the start line, along the centre line [m], shape (cars,)."""
        return self._episodes.memory[:, DRIVEN].copy()

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start a race of all agents; without a seed the next one of the same random numbers."""
        if seed is not None or self._rng is None:
            self._rng = seeding.np_random(seed)[0]
        world_seed = int(self._rng.integers(2**31))
        starts = self.task.starts(self._rng)
        poses = {name: np.array(pose) for start in starts for name, pose in start.poses.items()}
        drawn = np.array([self.conditions.draw(self._rng) for _ in self.possible_agents])
        friction, mass, noise, latency = drawn.T[:, None]
        self.batch.reset(WORLD, [world_seed], poses=poses, grip=friction, mass=mass, noise=noise)
        self._driver.reset(WORLD, latency)
        self.agents = list(self.possible_agents)
        self._steps = 0
        self._episodes.begin(np.arange(len(starts)), starts, CarReadings.of_first_world(self.batch.readings))
        return self._observations(self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive the live agents with these actions for `frame_skip` ticks."""
        live = self.agents
        rows = [self.possible_agents.index(agent) for agent in live]
        commands = np.zeros((1, len(self.possible_agents), 2))
        commands[0, rows] = commands_of([actions[agent] for agent in live], self.settings, len(live))
        self._driver.step(commands)
        readings = self.batch.readings
        is_unstable = np.full(len(self.possible_agents), readings.is_unstable[0])
        outcome = self._episodes.advance(CarReadings.of_first_world(readings), is_unstable)
        self._steps += 1
        is_over = self._max_steps is not None and self._steps >= self._max_steps
        driven = self.distance
        rank = np.empty(len(driven), np.int64)
        rank[np.argsort(-driven, kind="stable")] = np.arange(1, len(driven) + 1)
        has_won = outcome.is_success & ~outcome.has_ended & (rank == 1)
        has_ended = outcome.has_ended | has_won.any()
        terminated = {agent: bool(has_ended[row]) for agent, row in zip(live, rows, strict=True)}
        self.agents = [agent for agent in live if not (terminated[agent] or is_over)]
        return (
            self._observations(live),
            {agent: float(outcome.reward[row]) for agent, row in zip(live, rows, strict=True)},
            terminated,
            dict.fromkeys(live, is_over),
            {
                agent: {"is_success": bool(has_won[row]), "rank": int(rank[row]), "distance": float(driven[row])}
                for agent, row in zip(live, rows, strict=True)
            },
        )

    def close(self) -> None:
        """End the threads of the batch."""
        self.batch.close()

    def _observations(self, agents: list[str]) -> dict[str, Any]:
        numbers = self._episodes.numbers()
        return {agent: numbers[self.possible_agents.index(agent)].copy() for agent in agents}
