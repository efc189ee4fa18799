"""The PettingZoo environment: 2 to 8 cars keep the lane in one world, and must not hit each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from autodrive.base.errors import EngineError, SpecError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.rendered_world import CAMERA, RenderedWorld
from autodrive.experiments.envs.settings import Action, Settings, action_space, commands_of
from autodrive.experiments.envs.task import CarReadings, Observation
from autodrive.protocol.messages import Command, Frame

FEWEST, MOST = 2, 8
"""Cars."""


class DrivingParallelEnv(ParallelEnv[str, Any, Any]):
    """The task of lane keeping (`envs.lane_keeping`) for several cars at equal distances on the same lane.

    Agents are 'V1', 'V2', ... An agent whose episode has ended is no longer in `agents`; its car brakes and stays where
    it is.
    """

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
    ) -> None:
        """Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL."""
        if isinstance(cars, bool) or not isinstance(cars, int) or not FEWEST <= cars <= MOST:
            raise SpecError([f"cars: must be a whole number from {FEWEST} to {MOST}, not {cars!r}"])
        self.settings = Settings("lane_keeping", observation, action, frame_skip, render_mode)
        self.render_mode = render_mode
        self.task = LaneKeeping(frame_skip, cars)
        self.possible_agents = list(self.task.scenario.vehicles)
        self.agents: list[str] = []
        self.observation_spaces = {one: observation_space(self.task, observation) for one in self.possible_agents}
        self.action_spaces = {one: action_space(self.settings) for one in self.possible_agents}
        self._max_steps = max_episode_steps
        self._has_camera = observation == "camera"
        self._episodes = Episodes(self.task, observation, cars)
        self.rendered = RenderedWorld(self.task.scenario, self.settings, has_camera=self._has_camera)
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.rendered.step_duration}
        self._rng: np.random.Generator | None = None

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

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
        frame = self.rendered.reset(world_seed, {name: pose for start in starts for name, pose in start.poses.items()})
        self.agents = list(self.possible_agents)
        self._steps = 0
        self._episodes.begin(np.arange(len(starts)), starts, CarReadings.of_frame(frame))
        return self._observations(frame, self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive the live agents with these actions for `frame_skip` ticks."""
        live = self.agents
        driven = commands_of([actions[agent] for agent in live], self.settings, len(live)).tolist()
        commands = dict.fromkeys(self.possible_agents, Command())
        commands |= {agent: Command(*command) for agent, command in zip(live, driven, strict=True)}
        is_unstable = None
        try:
            frame = self.rendered.step(commands)
        except EngineError:
            frame, is_unstable = self.frame, np.ones(len(self.possible_agents), np.bool_)
        outcome = self._episodes.advance(CarReadings.of_frame(frame), is_unstable)
        self._steps += 1
        is_over = self._max_steps is not None and self._steps >= self._max_steps
        rows = [(agent, self.possible_agents.index(agent)) for agent in live]
        terminated = {agent: bool(outcome.has_ended[row]) for agent, row in rows}
        self.agents = [agent for agent in live if not (terminated[agent] or is_over)]
        return (
            self._observations(frame, live),
            {agent: float(outcome.reward[row]) for agent, row in rows},
            terminated,
            dict.fromkeys(live, is_over),
            {agent: {"is_success": bool(outcome.is_success[row])} for agent, row in rows},
        )

    def render(self) -> NDArray[np.uint8] | None:
        """With 'rgb_array', the image of Driver's Eye behind the first car."""
        return self.rendered.render()

    def close(self) -> None:
        """Stop the page, and free the renderers."""
        self.rendered.close()

    def _observations(self, frame: Frame, agents: list[str]) -> dict[str, Any]:
        numbers = self._episodes.numbers()
        own = {agent: numbers[self.possible_agents.index(agent)].copy() for agent in agents}
        if not self._has_camera:
            return own
        return {
            agent: {
                "image": np.ascontiguousarray(frame.vehicles[agent].cameras[CAMERA].rgb),
                "state": values,
            }
            for agent, values in own.items()
        }
