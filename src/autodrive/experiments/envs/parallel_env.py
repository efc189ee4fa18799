"""The PettingZoo environment: 2 to 8 cars keep the lane in one world, and must not hit each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from autodrive.base.errors import EngineError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.conditions import WEATHER, Conditions, Range, checked_conditions
from autodrive.experiments.envs.episodes import Episodes, observation_space
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.rendered_world import CAMERA, RenderedWorld
from autodrive.experiments.envs.settings import Action, Settings, checked_cars, commands_of, whole_seed, with_traffic
from autodrive.experiments.envs.several_cars import Agents
from autodrive.experiments.envs.task import OFFENCES, Observation, Outcome
from autodrive.protocol.messages import Command, Frame


class DrivingParallelEnv(Agents):
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
        offence_cost: float = 0.0,
        fog: Range = 0.0,
        rain: Range = 0.0,
        snow: Range = 0.0,
    ) -> None:
        """`traffic`: cars that drive themselves.

        `offence_cost`: subtracted from the reward for each red light and stop sign that is run.
        `fog`, `rain`, `snow`: see `Conditions`.

        Raises `SpecError` for wrong settings, `GlUnavailable` for images without OpenGL.
        """
        checked = Settings(
            "lane_keeping", observation, action, frame_skip, render_mode, traffic=traffic, offence_cost=offence_cost
        )
        self.task, self.settings = with_traffic(LaneKeeping(frame_skip, checked_cars(cars)), traffic), checked
        super().__init__(self.task, observation_space(self.task, observation), checked)
        self.conditions = Conditions(fog=fog, rain=rain, snow=snow)
        self._max_steps = max_episode_steps
        self._episodes = Episodes(self.task, observation, len(self.possible_agents), offence_cost)
        self._rng: np.random.Generator | None = None
        self._has_camera = observation == "camera"
        self.rendered = RenderedWorld(self.task.scenario, self.settings, has_camera=self._has_camera)
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / self.rendered.step_duration}

    @property
    def frame(self) -> Frame:
        """The latest Frame of the World, with all that the simulator knows."""
        return self.rendered.world.frame

    @property
    def conditions(self) -> Conditions:
        """The weather of the episodes that follow. Setting others raises `SpecError`."""
        return self._conditions

    @conditions.setter
    def conditions(self, conditions: Conditions) -> None:
        self._conditions = checked_conditions(conditions, WEATHER)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode of all agents; without a seed the next one of the same random numbers."""
        if seed is not None or self._rng is None:
            self._rng = seeding.np_random(whole_seed(seed))[0]
        world_seed = int(self._rng.integers(2**31))
        starts = self.task.starts(self._rng)
        poses = {name: pose for start in starts for name, pose in start.poses.items()}
        self.rendered.reset(world_seed, poses, self.conditions.draw_weather(self._rng))
        self.agents = list(self.possible_agents)
        self._steps = 0
        self._episodes.begin(np.arange(len(starts)), starts, self.rendered.cars)
        return self._observations(self.agents), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive the live agents with these actions for `frame_skip` ticks."""
        live = self.agents
        rows = {agent: self.possible_agents.index(agent) for agent in live}
        commands = np.zeros((len(self.possible_agents), 2))
        commands[[*rows.values()]] = commands_of([actions[agent] for agent in live], self.settings, len(live))
        outcome, offences = self._drive(commands)
        self._steps += 1
        is_over = self._max_steps is not None and self._steps >= self._max_steps
        terminated = {agent: bool(outcome.has_ended[row]) for agent, row in rows.items()}
        self.agents = [agent for agent in live if not (terminated[agent] or is_over)]
        return (
            self._observations(live),
            {agent: float(outcome.reward[row]) for agent, row in rows.items()},
            terminated,
            dict.fromkeys(live, is_over),
            {agent: {"is_success": bool(outcome.is_success[row]), **offences[agent]} for agent, row in rows.items()},
        )

    def render(self) -> NDArray[np.uint8] | None:
        """With 'rgb_array', the image of Driver's Eye behind the first car."""
        return self.rendered.render()

    def close(self) -> None:
        """Stop the page, and free the renderers."""
        self.rendered.close()

    def _drive(self, commands: NDArray[np.float64]) -> tuple[Outcome, dict[str, dict[str, Any]]]:
        """Run the ticks of one action, shape (cars, 2): what it led to, and the offences of each agent."""
        is_unstable = np.zeros(len(commands), np.bool_)
        given = zip(self.possible_agents, commands.tolist(), strict=True)
        try:
            self.rendered.step({agent: Command(*command) for agent, command in given})
        except EngineError:
            is_unstable[:] = True
        cars = self.rendered.cars
        rows = zip(self.possible_agents, cars.offences.tolist(), strict=True)
        offences: dict[str, dict[str, Any]] = {agent: {**dict(zip(OFFENCES, row, strict=True))} for agent, row in rows}
        return self._episodes.advance(cars, is_unstable), offences

    def _observations(self, agents: list[str]) -> dict[str, Any]:
        numbers, cars = self._episodes.numbers(), self.frame.vehicles
        own = {agent: numbers[self.possible_agents.index(agent)] for agent in agents}
        if not self._has_camera:
            return own
        images = {agent: np.ascontiguousarray(cars[agent].cameras[CAMERA].rgb) for agent in agents}
        return {agent: {"image": images[agent], "state": own[agent]} for agent in agents}
