"""A vector environment for rsl_rl: `OnPolicyRunner(NigelVecEnv("NigelLaneKeeping-v0", 256), cfg, device="cpu")`."""

from __future__ import annotations

from typing import Any

import gymnasium

from autodrive.experiments.envs.adapters import require

require("rsl_rl", "rsl-rl-lib")

import torch  # noqa: E402  # pyright: ignore[reportMissingImports]
from rsl_rl.env import VecEnv  # noqa: E402  # pyright: ignore[reportMissingImports]
from tensordict import TensorDict  # noqa: E402  # pyright: ignore[reportMissingImports]


class NigelVecEnv(VecEnv):
    """A `VecEnv` of one batch, with one group of observations, 'policy'. `settings`: those of `gymnasium.make_vec`."""

    def __init__(self, id_: str, num_envs: int, *, device: str = "cpu", **settings: Any) -> None:
        self.envs: Any = gymnasium.make_vec(f"autodrive:{id_}", num_envs, autoreset_mode="SameStep", **settings)
        spec = self.envs.spec
        self.num_envs = num_envs
        self.num_actions = gymnasium.spaces.flatdim(self.envs.single_action_space)
        self.max_episode_length = spec.kwargs.get("max_episode_steps") or spec.max_episode_steps
        self.device = device
        self.cfg = {"id": id_, **settings}
        self.episode_length_buf = torch.zeros(num_envs, dtype=torch.long, device=device)
        self._observations = self._group(self.envs.reset()[0])

    def get_observations(self) -> Any:
        """The present ones."""
        return self._observations

    def step(self, actions: Any) -> Any:
        """Observations, rewards, ends, and which of them are truncations (`time_outs`)."""
        steps = self.envs.unwrapped.steps
        steps[:] = self.episode_length_buf.cpu().numpy()  # the runner may have written it
        observations, rewards, terminated, truncated, _ = self.envs.step(actions.detach().cpu().numpy())
        self.episode_length_buf[:] = self._tensor(steps)
        self._observations = self._group(observations)
        done, time_outs = self._tensor(terminated | truncated), self._tensor(truncated & ~terminated)
        return self._observations, self._tensor(rewards).float(), done.long(), {"time_outs": time_outs}

    def close(self) -> None:
        """Close the batch."""
        self.envs.close()

    def _tensor(self, values: Any) -> Any:
        return torch.as_tensor(values, device=self.device)

    def _group(self, observations: Any) -> Any:
        return TensorDict({"policy": self._tensor(observations)}, batch_size=[self.num_envs])
