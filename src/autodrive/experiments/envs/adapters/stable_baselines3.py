"""A vector environment for Stable-Baselines3: `PPO("MlpPolicy", NigelVecEnv("NigelLaneKeeping-v0", 64))`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.adapters import require
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.settings import check_options
from autodrive.experiments.envs.task import Task

require("stable_baselines3", "stable-baselines3")

from stable_baselines3.common.vec_env import VecEnv  # noqa: E402  # pyright: ignore[reportMissingImports]


class NigelVecEnv(VecEnv):
    """A `VecEnv` of one batch. `settings` are those of `gymnasium.make_vec`, or of `DrivingVectorEnv` for a `Task`.

    With several cars in a world, environment k is car k % cars of world k // cars, and `num_envs` a multiple of cars.
    """

    def __init__(self, id_: str | Task, num_envs: int, **settings: Any) -> None:
        """`id_`: of an environment, or a task of your own."""
        self.envs: Any = (
            gymnasium.make_vec(f"autodrive:{id_}", num_envs, autoreset_mode="SameStep", **settings)
            if isinstance(id_, str)
            else DrivingVectorEnv(num_envs, id_, autoreset_mode="SameStep", **settings)
        )
        super().__init__(num_envs, self.envs.single_observation_space, self.envs.single_action_space)

    def reset(self) -> Any:
        """Start all episodes, with the seeds of `seed`: world k has the k-th one. Raises `SpecError` for options."""
        for options in self._options:
            check_options(options)
        seeds = self._seeds[: self.envs.batch.n]
        observations, _ = self.envs.reset(seed=seeds)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: Any) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Observations, rewards, ends and infos; an ended episode has its last observation in its info."""
        observations, rewards, terminated, truncated, info = self.envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(terminated | truncated).tolist():
            infos[row] = {
                "terminal_observation": info["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
                **{name: values[row].item() for name, values in info["final_info"].items() if name[0] != "_"},
            }
        return observations, rewards.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Close the batch."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute of the vector environment, once for each index."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set `conditions` of all environments, which are one object; anything else raises `SpecError`."""
        if len({*self._get_indices(indices)}) < self.num_envs:
            raise SpecError([f"{attr_name}: the environments of a batch have no attributes of their own"])
        self.envs.set_attr(attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refused: raises `SpecError`."""
        raise SpecError([f"{method_name}: the environments of a batch have no methods of their own"])

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """False for each environment: wrappers are for single environments."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[Any]:
        """List of None, one for each environment: a batch draws no images."""
        return [None] * self.num_envs
