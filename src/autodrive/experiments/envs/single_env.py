"""A single environment: the vector environment with one world."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium.vector import AutoresetMode

from autodrive.experiments.envs.conditions import Conditions
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.remade import Remade
from autodrive.experiments.envs.settings import EnvSettings, check_changeable, check_options, whole_seed
from autodrive.experiments.envs.task import Task


class SingleEnv(Remade, gymnasium.Env[Any, Any]):
    """One car with one task. `info["is_success"]` says after each step whether the task is accomplished."""

    def __init__(self, vector: DrivingVectorEnv, render_mode: str | None) -> None:
        """`vector`: with one world and the autoreset mode 'Disabled'."""
        assert vector.num_envs == 1
        assert vector.autoreset_mode == AutoresetMode.DISABLED
        self.vector = vector
        """The environment that does the work."""
        self.render_mode = render_mode
        self.observation_space = vector.single_observation_space
        self.action_space = vector.single_action_space
        step = vector.batch.tick_duration * vector.settings.frame_skip
        self.metadata = {**type(self).metadata, "render_fps": 1.0 / step}

    @property
    def task(self) -> Task:
        """The task, with its scenario and features."""
        return self.vector.task

    @property
    def settings(self) -> EnvSettings:
        """The settings, with the actions of the task."""
        return self.vector.settings

    @property
    def conditions(self) -> Conditions:
        """What the episodes that follow draw. Setting others than those of the environment raises `SpecError`."""
        return self.vector.conditions

    @conditions.setter
    def conditions(self, conditions: Conditions) -> None:
        self.vector.conditions = conditions

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Set `conditions`; any other attribute raises `SpecError`."""
        check_changeable(name)
        return super().set_wrapper_attr(name, value, force=force)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode; without a seed the next one of the same random numbers."""
        check_options(options)
        super().reset(seed=whole_seed(seed))
        observations, _ = self.vector.reset(seed=seed)
        return _first(observations), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive with that action for `frame_skip` ticks."""
        observations, reward, terminated, truncated, infos = self.vector.step(action)
        info = {name: values[0].item() for name, values in infos.items() if name[0] != "_"}
        return _first(observations), float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def close(self) -> None:
        """End the worlds, and free the renderers."""
        self.vector.close()


def _first(observations: Any) -> Any:
    """The observation of the first world."""
    if isinstance(observations, dict):
        return {key: values[0] for key, values in observations.items()}
    return observations[0]
