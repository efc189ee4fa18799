"""A vector environment for PufferLib 3: `NigelPufferEnv("NigelLaneKeeping-v0", 256)`.

PufferLib 3.0 states that it needs NumPy below 2 and Gymnasium below 1, which our package does not support; its
environments and `pufferlib.vector` run with later ones, too.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from autodrive.experiments.envs.adapters import require

require("pufferlib", "--no-deps pufferlib")

import pufferlib  # noqa: E402  # pyright: ignore[reportMissingImports]


class NigelPufferEnv(pufferlib.PufferEnv):
    """A `PufferEnv` of one batch, which writes into the buffers of PufferLib. `settings`: of `gymnasium.make_vec`."""

    def __init__(
        self, id_: str = "NigelLaneKeeping-v0", num_envs: int = 1, *, buf: Any = None, seed: int = 0, **settings: Any
    ) -> None:
        self.envs = gymnasium.make_vec(f"autodrive:{id_}", num_envs, autoreset_mode="SameStep", **settings)
        self.single_observation_space = self.envs.single_observation_space
        self.single_action_space = self.envs.single_action_space
        self.num_agents = num_envs
        self._seed = seed
        super().__init__(buf)

    def reset(self, seed: int | None = None) -> Any:
        """Start all episodes."""
        self.observations[:] = self.envs.reset(seed=self._seed if seed is None else seed)[0]
        self._returns = np.zeros(self.num_agents)
        self._lengths = np.zeros(self.num_agents, np.int64)
        return self.observations, []

    def step(self, actions: Any) -> Any:
        """Step the batch; the infos are the mean return, length and success of the episodes that have ended."""
        observations, rewards, terminated, truncated, info = self.envs.step(actions)
        self.observations[:], self.rewards[:] = observations, rewards
        self.terminals[:], self.truncations[:] = terminated, truncated
        self._returns += rewards
        self._lengths += 1
        infos = []
        if (ended := terminated | truncated).any():
            infos.append(
                {
                    "episode_return": float(self._returns[ended].mean()),
                    "episode_length": float(self._lengths[ended].mean()),
                    "is_success": float(info["final_info"]["is_success"][ended].mean()),
                }
            )
            self._returns[ended], self._lengths[ended] = 0.0, 0
        return self.observations, self.rewards, self.terminals, self.truncations, infos

    def close(self) -> None:
        """Close the batch."""
        self.envs.close()
