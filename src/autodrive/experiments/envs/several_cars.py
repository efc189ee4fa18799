"""Environments of several cars whose episodes end one by one: many worlds, or one of them for PettingZoo."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError
from autodrive.experiments.envs.conditions import Conditions
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.remade import Remade
from autodrive.experiments.envs.settings import action_space
from autodrive.experiments.envs.task import Bools, StepOutcome, Task


class SeveralCarsVectorEnv(DrivingVectorEnv):
    """Environment k is car k % cars of world k // cars.

    An episode of a world ends when those of all its cars have ended, or after `max_episode_steps`. Until then a car
    whose own episode has ended brakes and stays where it is; its reward is 0 and its observation consists of zeros
    (`is_live`). So a library that knows nothing of several cars learns what the cars are worth: nothing follows for
    them. `info["is_success"]` says whether the car has succeeded in this episode.
    """

    def __init__(self, num_envs: int, *task: Task, **settings: Any) -> None:
        """`task`, `settings`: of the next class, which is `DrivingVectorEnv` or a subclass. Raises `SpecError`."""
        super().__init__(num_envs, *task, **settings)
        self.is_live: Bools = np.ones(num_envs, np.bool_)
        """Whether the own episode of each car goes on."""
        self._is_seen: Bools = np.ones(num_envs, np.bool_)
        """Whether the own episode of each car went on before the last step."""
        self._has_succeeded: Bools = np.zeros(num_envs, np.bool_)

    @property
    def memory(self) -> Floats:
        """What the task remembers of the episode of each car, a view of the shape (num_envs, memory_size)."""
        return self._episodes.memory

    def _begin(self, mask: Bools) -> None:
        super()._begin(mask)
        self.is_live[mask] = self._is_seen[mask] = True
        self._has_succeeded[mask] = False

    def _drive(self, commands: NDArray[Any], worlds: Bools) -> None:
        driven = np.where(self._of_worlds(self.is_live)[..., None], commands, 0.0)
        driven[..., 0] *= self._of_worlds(self.task.throttle_factors(self._episodes.memory))
        super()._drive(driven, worlds)

    def _judge(self) -> StepOutcome:
        outcome = super()._judge()
        self._is_seen = self.is_live.copy()
        outcome.reward[~self.is_live] = 0.0
        self._has_succeeded |= outcome.is_success & self.is_live
        outcome.is_success[:] = self._has_succeeded
        self.is_live &= ~outcome.has_ended
        return outcome

    def _ends(self, outcome: StepOutcome, is_late: Bools) -> tuple[Bools, Bools]:
        is_over = self._of_worlds(is_late).any(axis=1) | ~self._of_worlds(self.is_live).any(axis=1)
        is_over = np.repeat(is_over, self.car_count)
        return is_over & ~self.is_live, is_over & self.is_live

    def _observations(self) -> Any:
        observations = super()._observations()
        for part in observations.values() if isinstance(observations, dict) else [observations]:
            part[~self._is_seen] = 0
        return observations


class SeveralCarsParallelEnv(Remade, ParallelEnv[str, Any, Any]):
    """One world of a vector environment. Its cars are the agents 'V1', 'V2', ...

    An agent whose episode has ended is no longer in `agents`; its car brakes and stays where it is.
    """

    metadata: dict[str, Any] = {"name": "several_cars", "render_modes": [], "is_parallelizable": True}  # noqa: RUF012

    def __init__(self, vector: SeveralCarsVectorEnv) -> None:
        """`vector`: with one world, and the autoreset mode 'Disabled'."""
        assert vector.batch.n == 1
        self.vector = vector
        """The environment that does the work."""
        self._no_actions = np.zeros_like(vector.action_space.sample())
        self.render_mode = vector.settings.render_mode
        self.possible_agents = list(vector.task.scenario.vehicles)
        self.agents: list[str] = []
        self.observation_spaces = dict.fromkeys(self.possible_agents, vector.single_observation_space)
        self.action_spaces = {agent: action_space(vector.settings) for agent in self.possible_agents}

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """The space of the observations of an agent; the same object each time."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """The space of the actions of an agent; the same object each time."""
        return self.action_spaces[agent]

    @property
    def conditions(self) -> Conditions:
        """What the episodes that follow draw. Setting others than those of the environment raises `SpecError`."""
        return self.vector.conditions

    @conditions.setter
    def conditions(self, conditions: Conditions) -> None:
        self.vector.conditions = conditions

    @property
    def task(self) -> Task:
        """The task, with its scenario and features."""
        return self.vector.task

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Start an episode of all agents; without a seed the next one of the same random numbers."""
        observations, _ = self.vector.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return {agent: _row(observations, row) for row, agent in enumerate(self.agents)}, {
            agent: {} for agent in self.agents
        }

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Drive the live agents with these actions for `frame_skip` ticks."""
        rows = {agent: self.possible_agents.index(agent) for agent in self.agents}
        if not rows:
            return {}, {}, {}, {}, {}
        if missing := sorted(rows.keys() - actions.keys()):
            raise CommandError(f"actions: the action of {missing[0]} is missing")
        all_actions = np.zeros_like(self._no_actions)
        for agent, row in rows.items():
            all_actions[row] = np.asarray(actions[agent]).reshape(all_actions.shape[1:])
        observations, reward, _, truncated, info = self.vector.step(all_actions)
        is_live = self.vector.is_live
        self.agents = [agent for agent, row in rows.items() if is_live[row] and not truncated[row]]
        return (
            {agent: _row(observations, row) for agent, row in rows.items()},
            {agent: float(reward[row]) for agent, row in rows.items()},
            {agent: not is_live[row] for agent, row in rows.items()},
            {agent: bool(truncated[row]) for agent, row in rows.items()},
            {
                agent: {name: values[row].item() for name, values in info.items() if name[0] != "_"}
                for agent, row in rows.items()
            },
        )

    def close(self) -> None:
        """End the threads of the batch."""
        self.vector.close()


def _row(observations: Any, row: int) -> Any:
    """The observation of one car."""
    if isinstance(observations, dict):
        return {key: values[row] for key, values in observations.items()}
    return observations[row]
