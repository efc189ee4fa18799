"""The vector environment has the bits of single environments, in all autoreset modes."""

from __future__ import annotations

from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from autodrive.envs.driving_vector_env import DrivingVectorEnv

TASKS = {"NigelLaneKeeping-v0": "state", "NigelParking-v0": "lidar", "NigelNavigation-v0": "state"}
"""With the observation that the other tests do not use."""


def vector_env(id_: str, count: int, **settings: Any) -> DrivingVectorEnv:
    env = gymnasium.make_vec(f"autodrive:{id_}", count, **settings)
    assert isinstance(env, DrivingVectorEnv)
    return env


def equal(a: Any, b: Any) -> bool:
    return data_equivalence(a, b, exact=True)


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("id_", TASKS)
def test_a_vector_environment_has_the_bits_of_single_ones(id_: str, mode: AutoresetMode) -> None:
    settings: dict[str, Any] = {"frame_skip": 10, "max_episode_steps": 12}
    if mode == AutoresetMode.SAME_STEP:
        settings |= {"observation": TASKS[id_], "action": "discrete"}
    ours = vector_env(id_, 3, autoreset_mode=mode, **settings)
    assert ours.metadata["autoreset_mode"] is mode
    theirs = SyncVectorEnv([lambda: gymnasium.make(f"autodrive:{id_}", **settings)] * 3, autoreset_mode=mode)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert equal(ours.reset(seed=5), theirs.reset(seed=5))
    ours.action_space.seed(1)
    ends = 0
    for _ in range(30):
        actions = ours.action_space.sample()
        step = ours.step(actions)
        assert equal(step, theirs.step(actions))
        ended = step[2] | step[3]
        ends += int(ended.sum())
        if mode == AutoresetMode.DISABLED and ended.any():
            reset = [env.reset(options={"reset_mask": ended.copy()}) for env in (ours, theirs)]
            assert equal(*reset)
    assert ends >= 6
    ours.close()
    theirs.close()
