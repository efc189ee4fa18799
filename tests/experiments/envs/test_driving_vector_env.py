"""The vector environment has the bits of single environments, in all autoreset modes."""

from __future__ import annotations

import itertools
from copy import deepcopy
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from autodrive.base.errors import CommandError, SpecError
from autodrive.experiments.envs.conditions import Conditions
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.registration import ROBORACER
from autodrive.scenario.scenario import WeatherSpec

TASKS = {"NigelLaneKeeping-v0": "state", "NigelParking-v0": "lidar", "NigelNavigation-v0": "state"}
"""With the observation that the other tests do not use."""


def vector_env(id_: str, count: int, **settings: Any) -> DrivingVectorEnv:
    env = gymnasium.make_vec(f"autodrive:{id_}", count, **settings)
    assert isinstance(env, DrivingVectorEnv)
    return env


def equal(a: Any, b: Any) -> bool:
    return data_equivalence(a, b, exact=True)


CONDITIONS = {"friction": (0.6, 1.0), "mass": (0.9, 1.2), "noise": (0.0, 2.0), "latency": (0.0, 0.06)}


def test_offences_are_counted_and_cost_what_was_chosen() -> None:
    """Drivers who follow the lane past all lights and signs, one of them in a single environment."""
    settings: dict[str, Any] = {"frame_skip": 10, "max_episode_steps": None}
    free, dear = (vector_env("NigelLaneKeeping-v0", 4, offence_cost=cost, **settings) for cost in (0.0, 2.0))
    single = gymnasium.make("autodrive:NigelLaneKeeping-v0", offence_cost=2.0, **settings)
    observations, _ = free.reset(seed=3)
    dear.reset(seed=3)
    single.reset(seed=3)
    names = [feature.name for feature in free.task.features]
    x, y = names.index("ahead_0.4_x"), names.index("ahead_0.4_y")
    before, infos = np.zeros(4), {}
    for _ in range(330):
        steering = 2.0 * np.arctan2(observations[:, y], observations[:, x])
        actions = np.stack([np.full(4, 0.8), steering], 1).astype(np.float32)
        observations, rewards, terminated, _, infos = free.step(actions)
        _, dearer, _, _, others = dear.step(actions)
        _, alone, _, _, info = single.step(actions[0])
        assert not terminated.any()
        offences = infos["red_lights"] + infos["stop_signs"]
        np.testing.assert_array_equal(dearer, rewards - 2.0 * (offences - before))
        assert (alone, info["red_lights"]) == (dearer[0], others["red_lights"][0])
        assert info["stop_signs"] == others["stop_signs"][0]
        before = offences
    assert infos["red_lights"].sum() > 0
    assert "red_lights" not in vector_env("NigelNavigation-v0", 1).step(np.zeros((1, 2)))[4]
    with pytest.raises(SpecError, match="offence_cost: must be a number from 0 to 1000, not -1"):
        vector_env("NigelLaneKeeping-v0", 2, offence_cost=-1)


@pytest.mark.parametrize(
    ("id_", "mode"), [*itertools.product(TASKS, AutoresetMode), (ROBORACER, AutoresetMode.SAME_STEP)]
)
def test_a_vector_environment_has_the_bits_of_single_ones(id_: str, mode: AutoresetMode) -> None:
    settings: dict[str, Any] = {"frame_skip": 10, "max_episode_steps": 12}
    if id_ == ROBORACER:
        settings |= CONDITIONS
    elif mode == AutoresetMode.SAME_STEP:
        settings |= {"observation": TASKS[id_], "action": "discrete", "rain": (0.0, 1.0), "fog": 0.2}
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


@pytest.mark.parametrize("id_", [*TASKS, "NigelCrossing-v0", "RoboRacerDuel-v0"])
def test_each_episode_of_every_environment_has_its_own_weather(id_: str) -> None:
    envs = vector_env(id_, 8, rain=(0.2, 1.0), snow=0.1)
    rains: list[float] = []
    for seed in (1, None):
        envs.reset(seed=seed)
        rains += [weather.rain for weather in envs.batch.weathers]
        assert all((weather.snow, weather.fog) == (0.1, 0.0) for weather in envs.batch.weathers)
    assert len({*rains}) == len(rains)
    assert 0.2 <= min(rains) < max(rains) <= 1.0
    with pytest.raises(SpecError, match="fog: must be a number from 0 to 1, or two such numbers"):
        vector_env(id_, 8, fog=(0.0, 2.0))


def test_a_task_keeps_the_weather_of_its_scenario() -> None:
    task = LaneKeeping(5)
    task.scenario = task.scenario.model_copy(update={"weather": WeatherSpec(snow=0.4)})
    envs = DrivingVectorEnv(2, task)
    envs.reset(seed=1)
    assert [weather.snow for weather in envs.batch.weathers] == [0.4, 0.4]


def test_what_was_returned_is_not_written_again() -> None:
    envs = vector_env("NigelNavigation-v0", 3)
    returned = [envs.reset(seed=1)]
    returned += [envs.step(envs.action_space.sample()) for _ in range(3)]
    copies = deepcopy(returned)
    for _ in range(3):
        envs.step(envs.action_space.sample())
    envs.reset(seed=2)
    assert all(equal(value, other) for value, other in zip(returned, copies, strict=True))


def test_wrappers_of_vector_environments_work() -> None:
    envs = RecordEpisodeStatistics(vector_env("NigelParking-v0", 3, max_episode_steps=4))
    envs.reset(seed=1)
    *_, truncated, info = [envs.step(envs.action_space.sample()) for _ in range(4)][-1]
    assert truncated.all()
    assert info["episode"]["l"].tolist() == [4, 4, 4]


def test_a_disabled_autoreset_waits_for_a_mask() -> None:
    envs = vector_env("NigelParking-v0", 2, autoreset_mode="DISABLED", max_episode_steps=1)
    envs.reset(seed=1)
    envs.step(envs.action_space.sample())
    with pytest.raises(SpecError, match=r"environments \[0, 1\] have ended; reset them with a reset_mask"):
        envs.step(envs.action_space.sample())
    for mask in ([True, True], np.ones(3, np.bool_), np.ones(2), np.zeros(2, np.bool_)):
        with pytest.raises(ValueError, match="reset_mask"):
            envs.reset(options={"reset_mask": mask})


def test_an_unstable_world_ends_its_episode_only() -> None:
    envs = vector_env("NigelParking-v0", 3)
    envs.reset(seed=1)
    envs.batch.worlds.state.qvel[1, 0] = np.nan
    observations, rewards, terminated, _, _ = envs.step(np.zeros((3, 2), np.float32))
    assert terminated.tolist() == [False, True, False]
    assert rewards[1] == -1.0
    assert observations in envs.observation_space
    envs.step(np.zeros((3, 2), np.float32))
    assert envs.step(np.zeros((3, 2), np.float32))[0] in envs.observation_space


def test_a_wrong_number_of_seeds_is_named() -> None:
    with pytest.raises(ValueError, match="there must be 2 seeds, one for each world, not 3"):
        vector_env("NigelParking-v0", 2).reset(seed=[1, 2, 3])


def test_seeds_may_be_integers_of_numpy() -> None:
    envs, single = vector_env("NigelParking-v0", 2), gymnasium.make("autodrive:NigelParking-v0")
    for seed in (0, 255):
        starts = envs.reset(seed=[seed, seed + 1])[0]
        others: list[Any] = [seed, np.int64(seed), np.uint8(seed), (seed, seed + 1), np.array([seed, seed + 1])]
        for same in others:
            assert envs.reset(seed=same)[0].tobytes() == starts.tobytes(), same
        assert single.reset(seed=np.int64(seed))[0].tobytes() == starts[0].tobytes()  # pyright: ignore[reportArgumentType]
    assert envs.reset()[0].tobytes() != starts.tobytes()


@pytest.mark.parametrize("seed", ["", "3", 3.0, True, -1, np.array(3), [1, True], [[1], [2]]])
def test_what_is_no_seed_is_refused(seed: Any) -> None:
    with pytest.raises(CommandError, match="a seed must be a whole number from 0 on, not "):
        vector_env("NigelParking-v0", 2).reset(seed=seed)


def test_no_seeds_are_not_the_same_as_no_seed() -> None:
    with pytest.raises(ValueError, match="there must be 2 seeds, one for each world, not 0"):
        vector_env("NigelParking-v0", 2).reset(seed=[])


@pytest.mark.parametrize(
    ("settings", "error"),
    [
        ({"num_envs": "2"}, "num_envs: must be a whole number from 1 to"),
        ({"num_envs": 0}, "num_envs: must be a whole number from 1 to"),
        ({"max_episode_steps": 0}, "max_episode_steps: must be a whole number from 1 to"),
        ({"max_episode_steps": 2.5}, "max_episode_steps: must be a whole number from 1 to"),
    ],
)
def test_a_wrong_number_of_environments_or_steps_is_named(settings: dict[str, Any], error: str) -> None:
    with pytest.raises(SpecError, match=error):
        DrivingVectorEnv(**settings)


def test_minus_one_is_no_limit_of_steps_as_in_gymnasium() -> None:
    envs = vector_env("NigelParking-v0", 1, max_episode_steps=-1)
    envs.reset(seed=1)
    assert not envs.step(np.zeros((1, 2), np.float32))[3].any()


@pytest.mark.parametrize("id_", [*TASKS, ROBORACER])
def test_only_what_changes_something_can_be_set(id_: str) -> None:
    singles = SyncVectorEnv([lambda: gymnasium.make(f"autodrive:{id_}")])
    vector = vector_env(id_, 1)
    foggy = Conditions(fog=0.5)
    for envs in (singles, vector):
        for name in ("friction", "frame_skip", "traffic", "nonsense"):
            with pytest.raises(SpecError, match=f"{name}: a change would have no effect"):
                envs.set_attr(name, 1)
        with pytest.raises(SpecError, match=r"must be Conditions\(\.\.\.\), not"):
            envs.set_attr("conditions", [{"fog": 0.5}] if envs is singles else {"fog": 0.5})
        if id_ != ROBORACER:
            with pytest.raises(SpecError, match=r"does not draw friction\. It draws: fog, rain, snow"):
                envs.set_attr("conditions", Conditions(friction=0.5))
        envs.set_attr("conditions", foggy)
    vector.reset(seed=1)
    assert vector.batch.weathers[0].fog == 0.5
    assert singles.get_attr("conditions") == (foggy,)


@pytest.mark.parametrize("weather", [{}, {"fog": (0.4, 0.8)}])
def test_images_of_a_vector_environment_are_those_of_single_ones(gl: str, weather: dict[str, Any]) -> None:
    settings: dict[str, Any] = {"observation": "camera", "max_episode_steps": 3, **weather}
    ours = vector_env("NigelNavigation-v0", 2, autoreset_mode="SameStep", **settings)
    theirs = SyncVectorEnv(
        [lambda: gymnasium.make("autodrive:NigelNavigation-v0", **settings)] * 2, autoreset_mode=AutoresetMode.SAME_STEP
    )
    steps = [[env.reset(seed=5)[0] for env in (ours, theirs)]]
    steps += [[env.step(np.ones((2, 2), np.float32))[0] for env in (ours, theirs)] for _ in range(4)]
    for own, other in steps:
        assert own in ours.observation_space
        assert own["state"].tobytes() == other["state"].tobytes()
        difference = np.abs(own["image"].astype(int) - other["image"])
        assert (difference > 2).mean() < 0.01  # equal but for rounding, and for pixels at edges
    ours.close()
    theirs.close()
