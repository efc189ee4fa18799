"""Environments for RLlib: `register()`, then `PPOConfig().environment("NigelLaneKeeping-v0", env_config={...})`."""

from __future__ import annotations

from typing import Any

import gymnasium

from autodrive.experiments.envs.adapters import require
from autodrive.experiments.envs.registration import IDS, ROBORACER

require("ray", "'ray[rllib]'")

from ray.tune import register_env  # noqa: E402  # pyright: ignore[reportMissingImports]


def register() -> None:
    """Make the ids known to RLlib; `env_config` has the settings of `gymnasium.make`."""
    for id_ in (*IDS, ROBORACER):
        register_env(id_, lambda config, id_=id_: make(id_, **config))


def make(id_: str, **settings: Any) -> gymnasium.Env[Any, Any]:
    """The single environment: RLlib makes its own vectors of it, also in other processes."""
    return gymnasium.make(f"autodrive:{id_}", **settings)
