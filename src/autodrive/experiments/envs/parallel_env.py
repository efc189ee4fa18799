"""The PettingZoo environment: 2 to 8 cars keep the lane in one world, and must not hit each other."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from autodrive.base.errors import EngineError, SpecError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.conditions import whole_number_errors
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.rendered_world import CAMERA, RenderedWorld
from autodrive.experiments.envs.settings import MOST_CARS, Action, Settings, action_space, commands_of, with_traffic
from autodrive.experiments.envs.task import Bools, CarReadings, Observation, Outcome, Start, Task
from autodrive.protocol.messages import Command, Frame


class Cars(ParallelEnv[str, Any, Any]):
    """Several cars in one world, each an agent.

    Agents are 'V1', 'V2', ... An agent whose episode has ended is no longer in `agents`; its car brakes and stays where
    it is.
    """

    def __init__(self, task: Task, settings: Settings, max_episode_steps: int | None) -> None:
        self.task, self.settings, self.render_mode = task, settings, settings.render_mode
        seen = settings.observation or task.observation
        self.possible_agents = list(task.scenario.vehicles)
        self.agents: list[str] = []
        self.observation_spaces = {one: observation_space(task, seen) for one in self.possible_agents}
        self.action_spaces = {one: action_space(settings) for one in self.possible_agents}
        self._max_steps = max_episode_steps
        self._episodes = Episodes(task, seen, len(self.possible_agents))
        self._rng: np.random.Generator | None = None

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object each time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Of an agent; the same object each time."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode of all agents; without a seed the next one of the same random numbers."""
        if seed is not None or self._rng is None:
            self._rng = seeding.np_random(seed)[0]
        world_seed = int(self._rng.integers(2**31))
        starts = self.task.starts(self._rng)
        readings = self._start(world_seed, starts, self._rng)
        self.agents = list(self.possible_agents)
        self._steps = 0
        self._episodes.begin(np.arange(len(starts)), starts, readings)
        return self._observations(self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive the live agents with these actions for `frame_skip` ticks."""
        live = self.agents
        rows = {agent: self.possible_agents.index(agent) for agent in live}
        commands = np.zeros((len(self.possible_agents), 2))
        commands[[*rows.values()]] = commands_of([actions[agent] for agent in live], self.settings, len(live))
        outcome = self._episodes.advance(*self._drive(commands))
        self._steps += 1
        is_over = self._max_steps is not None and self._steps >= self._max_steps
        has_ended, infos = self._judged(outcome)
        terminated = {agent: bool(has_ended[row]) for agent, row in rows.items()}
        self.agents = [agent for agent in live if not (terminated[agent] or is_over)]
        return (
            self._observations(live),
            {agent: float(outcome.reward[row]) for agent, row in rows.items()},
            terminated,
            dict.fromkeys(live, is_over),
            {agent: infos[row] for agent, row in rows.items()},
        )

    @abstractmethod
    def _start(self, seed: int, starts: Sequence[Start], rng: np.random.Generator) -> CarReadings:
        """Start an episode in the world."""

    @abstractmethod
    def _drive(self, commands: NDArray[np.float64]) -> tuple[CarReadings, Bools]:
        """Run the ticks of one action, shape (cars, 2); the readings, and whether the physics of a car diverged."""

    def _judged(self, outcome: Outcome) -> tuple[Bools, list[dict[str, Any]]]:
        """Whether the episode of each car ends, and its info."""
        return outcome.has_ended, [{"is_success": one} for one in outcome.is_success.tolist()]

    def _observations(self, agents: list[str]) -> dict[str, Any]:
        numbers = self._episodes.numbers()
        return {agent: numbers[self.possible_agents.index(agent)].copy() for agent in agents}


def checked_cars(cars: int) -> int:
    """The number of cars. Raises `SpecError`."""
    if errors := whole_number_errors({"cars": (cars, 2, MOST_CARS)}):
        raise SpecError(errors)
    return cars


class DrivingParallelEnv(Cars):
    """The task of lane keeping (`envs.lane_keeping`) for several cars at equal distances on the same lane."""

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "nigel_lane_keeping_v0",
        "render_modes": ["rgb_array", "human"],
        "render_fps": 20.0,
        "is_parallelizable": True,
    }

    @with_suggestions
    def __init__(
        self,
        cars: int = 4,
        *,
        max_episode_steps: int | None = 1000,
        observation: Observation = "lidar",
        action: Action = "continuous",
        frame_skip: int = 5,
        render_mode: str | None = None,
        traffic: int = 0,
    ) -> None:
        """`traffic`: cars that drive themselves.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        checked = Settings("lane_keeping", observation, action, frame_skip, render_mode, traffic=traffic)
        super().__init__(with_traffic(LaneKeeping(frame_skip, checked_cars(cars)), traffic), checked, max_episode_steps)
        self._has_camera = observation == "camera"
        self.rendered = RenderedWorld(self.task.scenario, self.settings, has_camera=self._has_camera)
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.rendered.step_duration}

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

    def render(self) -> NDArray[np.uint8] | None:
        """With 'rgb_array', the image of Driver's Eye behind the first car."""
        return self.rendered.render()

    def close(self) -> None:
        """Stop the page, and free the renderers."""
        self.rendered.close()

    def _start(self, seed: int, starts: Sequence[Start], rng: np.random.Generator) -> CarReadings:
        poses = {name: pose for start in starts for name, pose in start.poses.items()}
        self.rendered.reset(seed, poses)
        return self.rendered.cars

    def _drive(self, commands: NDArray[np.float64]) -> tuple[CarReadings, Bools]:
        is_unstable = np.zeros(len(commands), np.bool_)
        given = zip(self.possible_agents, commands.tolist(), strict=True)
        try:
            self.rendered.step({agent: Command(*command) for agent, command in given})
        except EngineError:
            is_unstable[:] = True
        return self.rendered.cars, is_unstable

    def _observations(self, agents: list[str]) -> dict[str, Any]:
        own, cars = super()._observations(agents), self.frame.vehicles
        if not self._has_camera:
            return own
        images = {agent: np.ascontiguousarray(cars[agent].cameras[CAMERA].rgb) for agent in agents}
        return {agent: {"image": images[agent], "state": own[agent]} for agent in agents}
