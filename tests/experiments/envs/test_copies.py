"""A copied or unpickled environment has the settings, the conditions and the bits of the original."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

import autodrive  # noqa: F401  registers the environments
from autodrive.experiments.envs.conditions import Conditions
from autodrive.experiments.envs.crossing_env import CrossingParallelEnv
from autodrive.experiments.envs.driving_env import DrivingEnv
from autodrive.experiments.envs.duel_env import DuelParallelEnv
from autodrive.experiments.envs.parallel_env import DrivingParallelEnv
from autodrive.experiments.envs.race_env import RaceParallelEnv

MADE: dict[str, Callable[[], Any]] = {
    "single": lambda: DrivingEnv("parking", action="discrete"),
    "gymnasium.make": lambda: gymnasium.make("NigelLaneKeeping-v0", observation="state"),
    "RoboRacer": lambda: gymnasium.make("RoboRacer-v0", tracks=1),
    "gymnasium.make_vec": lambda: gymnasium.make_vec("NigelLaneKeeping-v0", 3, frame_skip=2),
    "crossing in make_vec": lambda: gymnasium.make_vec("NigelCrossing-v0", 4),
    "parallel": lambda: DrivingParallelEnv(2, observation="state"),
    "race": lambda: RaceParallelEnv(2, noise=1.0),
    "crossing": CrossingParallelEnv,
    "duel": DuelParallelEnv,
}
COPIES: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


def bits(value: Any) -> Any:
    """A comparable form of dictionaries and tuples with arrays."""
    if isinstance(value, dict):
        return {key: bits(part) for key, part in value.items()}
    if isinstance(value, tuple):
        return [bits(part) for part in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


def episode(env: Any) -> list[Any]:
    """The first steps of an episode."""
    steps = [bits(env.reset(seed=5))]
    for seed in range(4):
        if hasattr(env, "possible_agents"):
            action = {}
            for agent in env.agents:
                env.action_space(agent).seed(seed)
                action[agent] = env.action_space(agent).sample()
        else:
            env.action_space.seed(seed)
            action = env.action_space.sample()
        steps.append(bits(env.step(action)))
    return steps


@pytest.mark.parametrize("made", MADE)
def test_a_copy_of_a_used_environment_has_the_bits_of_the_original(made: str) -> None:
    env = MADE[made]()
    expected = episode(env)
    for name, way in COPIES.items():
        if name == "copy" and isinstance(env, gymnasium.Wrapper):
            continue  # it would share the environment that is wrapped
        copied = way(env)
        assert episode(copied) == expected
        copied.close()
    assert episode(env) == expected
    env.close()


def test_a_copy_has_the_present_conditions_and_the_spec() -> None:
    env = gymnasium.make_vec("NigelLaneKeeping-v0", 2)
    env.unwrapped.conditions = Conditions(fog=(0.5, 1.0))  # type: ignore[attr-defined]
    copied = pickle.loads(pickle.dumps(env))
    assert copied.unwrapped.conditions == Conditions(fog=(0.5, 1.0))
    assert copied.spec == env.spec
