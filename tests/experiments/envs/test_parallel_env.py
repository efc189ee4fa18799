"""The environment of several cars passes the tests of PettingZoo."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.envs.crossing_env import CrossingParallelEnv
from autodrive.experiments.envs.duel_env import DuelParallelEnv
from autodrive.experiments.envs.parallel_env import DrivingParallelEnv
from autodrive.experiments.envs.race_env import RaceParallelEnv
from autodrive.experiments.envs.task import MOTION

EIGHT: dict[str, Any] = {"cars": 8, "observation": "state", "action": "discrete"}


@pytest.mark.parametrize(
    ("kind", "settings", "more"),
    [
        (DrivingParallelEnv, {"cars": 2}, {}),
        (DrivingParallelEnv, EIGHT, {}),
        (RaceParallelEnv, {"cars": 2}, {"latency": (0.0, 0.05)}),
        (RaceParallelEnv, EIGHT, {"latency": (0.0, 0.05)}),
        *(
            (kind, {"variant": variant}, {})
            for kind in (CrossingParallelEnv, DuelParallelEnv)
            for variant in ("published", "own")
        ),
    ],
)
def test_the_tests_of_pettingzoo_pass(kind: Any, settings: dict[str, Any], more: dict[str, Any]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(kind(**settings, max_episode_steps=20), num_cycles=30)
        parallel_seed_test(lambda: kind(**settings, **more), num_cycles=5)


def test_a_car_whose_episode_has_ended_stays_and_the_others_drive_on() -> None:
    env = DrivingParallelEnv(4, observation="state")
    env.reset(seed=3)
    aside, still = np.array([1.0, 1.0]), np.zeros(2)
    _, rewards, terminated, truncated, _ = until_the_end(env, "V2", {"V2": aside})
    assert (rewards["V2"], terminated["V2"], truncated["V2"]) == (-1.0, True, False)
    assert env.agents == ["V1", "V3", "V4"]
    for _ in range(20):
        for part in env.step(dict.fromkeys(env.agents, still)):
            assert list(part) == ["V1", "V3", "V4"]
    assert abs(env.frame.vehicles["V2"].speed) < 1e-3


def test_a_car_sees_another_one_and_may_hit_it() -> None:
    env = DrivingParallelEnv(2)
    env.reset(seed=3)
    pose = env.frame.vehicles["V1"].pose
    ahead = complex(*pose.position[:2].tolist()) + 0.6 * np.exp(1j * yaw_from_quaternion(pose.orientation))
    env.rendered.world.teleport("V2", ahead.real, ahead.imag, yaw_from_quaternion(pose.orientation))
    observations, _, terminated, _, _ = until_the_end(env, "V1", {"V1": np.array([1.0, 0.0])})
    assert terminated["V1"]
    assert env.frame.vehicles["V1"].collision_count == 1
    assert observations["V1"][len(MOTION) + 1] < 0.5  # straight ahead


def until_the_end(env: DrivingParallelEnv, agent: str, actions: dict[str, Any]) -> tuple[Any, ...]:
    """The step in which the episode of an agent ends; the others stand still."""
    for _ in range(200):
        step = env.step({name: actions.get(name, np.zeros(2)) for name in env.agents})
        if agent not in env.agents:
            return step
    raise AssertionError("the episode has not ended")


def bits(step: Any) -> Any:
    """A comparable form of nested dictionaries with arrays."""
    if isinstance(step, dict):
        return {key: bits(value) for key, value in step.items()}
    if isinstance(step, tuple):
        return [bits(value) for value in step]
    return step.tobytes() if isinstance(step, np.ndarray) else step
