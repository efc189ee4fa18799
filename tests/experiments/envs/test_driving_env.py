"""The single environments do what their definitions say, and pass the checker of Gymnasium."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
import shapely
from gymnasium.utils.env_checker import check_env

import autodrive
from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.envs.crossing_env import CrossingParallelEnv
from autodrive.experiments.envs.driving_env import DrivingEnv
from autodrive.experiments.envs.duel_env import DuelParallelEnv
from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.parallel_env import DrivingParallelEnv
from autodrive.experiments.envs.registration import IDS, ROBORACER
from autodrive.experiments.envs.roboracer_env import RoboRacerEnv
from autodrive.scenario.maps.map import load_map

COLLIDES = {"parking": 0, "navigation": 7}
"""Seed of an episode in which a car that drives straight on hits something."""


@pytest.fixture(scope="module")
def envs() -> Iterator[dict[str, DrivingEnv]]:
    made = {task: make(task) for task, _ in IDS.values()}
    yield made
    for env in made.values():
        env.close()


NO_OFFENCES: dict[str, dict[str, int]] = {"parking": {"red_lights": 0, "stop_signs": 0}, "navigation": {}}
"""Of a map with stop lines, and of one without."""


def make(task: str, **settings: Any) -> DrivingEnv:
    return DrivingEnv(task, **settings)


def values(env: DrivingEnv, observation: Any) -> dict[str, float]:
    """The observation by name of its features."""
    features = observed(env.task, env.settings.observation or env.task.observation)
    return dict(zip((feature.name for feature in features), observation.tolist(), strict=True))


def car(env: DrivingEnv) -> autodrive.VehicleFrame:
    return env.frame.vehicles["V1"]


def last_step(env: DrivingEnv, action: Callable[[], Any], rewards: list[float] | None = None) -> tuple[Any, ...]:
    """The step that ends the episode."""
    rewards = [] if rewards is None else rewards
    for _ in range(300):
        step = env.step(action())
        rewards.append(step[1])
        if step[2]:
            return step
    raise AssertionError("the episode has not ended")


# -- the checkers of the field ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("id_", [*IDS, ROBORACER])
def test_the_checker_of_gymnasium_passes(id_: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*render.*")  # some draw only where OpenGL is
        check_env(gymnasium.make(f"autodrive:{id_}").unwrapped, skip_render_check=True)


@pytest.mark.slow
def test_the_checker_passes_with_images_and_in_all_render_modes(gl: str, capsys: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("autodrive:NigelParking-v0", observation="camera", action="discrete")
        check_env(env.unwrapped)
    assert capsys.readouterr().out.count("The page of this environment: http://127.0.0.1:") == 1
    image = env.reset(seed=1)[0]["image"]
    assert image.std() > 5.0
    assert (env.step(14)[0]["image"] != image).mean() > 0.1  # a new image after each step
    env.close()


@pytest.mark.parametrize("observation", ["state", "lidar"])
@pytest.mark.parametrize("task", [task for task, _ in IDS.values()])
def test_reset_equals_a_fresh_world_in_every_bit(task: str, observation: Any) -> None:
    used = make(task, observation=observation, frame_skip=3)
    fresh = make(task, observation=observation, frame_skip=3)
    used.action_space.seed(2)
    for seed in (4, 5):
        used.reset(seed=seed)
        for _ in range(10):
            used.step(used.action_space.sample())
    starts = [env.reset(seed=9)[0] for env in (used, fresh)]
    assert starts[0].tobytes() == starts[1].tobytes()
    for _ in range(15):
        action = used.action_space.sample()
        step, other = used.step(action), fresh.step(action)
        assert step[0].tobytes() == other[0].tobytes()
        assert step[1:] == other[1:]


def test_every_episode_starts_somewhere_else_and_at_rest(envs: dict[str, DrivingEnv]) -> None:
    for env in envs.values():
        first, second = env.reset(seed=1)[0], env.reset()[0]
        assert (first != second).any()
        assert env.frame.tick == 0
        assert car(env).speed == 0.0


@pytest.mark.parametrize("frame_skip", [1, 7])
def test_an_action_lasts_frame_skip_ticks(frame_skip: int) -> None:
    env = make("navigation", frame_skip=frame_skip)
    env.reset(seed=1)
    env.step(np.array([1.0, 0.0], np.float32))
    assert env.frame.tick == frame_skip
    assert env.metadata["render_fps"] == pytest.approx(100.0 / frame_skip)


def test_a_discrete_action_is_a_throttle_and_a_steering() -> None:
    discrete, continuous = make("navigation", action="discrete"), make("navigation")
    assert discrete.action_space == gymnasium.spaces.Discrete(15)
    for number, action in ((0, (-1.0, -1.0)), (7, (0.0, 0.0)), (13, (1.0, 0.5))):
        for env in (discrete, continuous):
            env.reset(seed=1)
        ours = discrete.step(np.int64(number))[0]
        assert ours.tobytes() == continuous.step(np.array(action))[0].tobytes()


# -- observations -----------------------------------------------------------------------------------------------------


def test_the_scan_is_the_shortest_range_of_each_sector(envs: dict[str, DrivingEnv]) -> None:
    env = envs["navigation"]
    seen = values(env, env.reset(seed=3)[0])
    scan = car(env).lidar
    assert scan is not None
    assert seen["scan_age"] == 0.0
    for sector in range(36):
        rays = [(10 * sector + by) % 360 for by in range(-5, 5)]
        shortest = min(float(scan.ranges[ray]) for ray in rays)
        assert seen[f"range_{10 * sector}"] == np.float32(min(shortest, 12.0))
    assert env.step(np.zeros(2))[0][7] == pytest.approx(0.05)  # the scan is 50 ms old: the next one is due at 143 ms


def test_the_goal_and_the_boxes_are_seen_from_the_vehicle() -> None:
    env = make("navigation", observation="state")
    seen = values(env, env.reset(seed=4)[0])
    x, y, _ = car(env).pose.position
    heading = yaw_from_quaternion(car(env).pose.orientation)

    def in_vehicle(point: Any) -> tuple[float, float]:
        turn = complex(point[0] - x, point[1] - y) * np.exp(-1j * heading)
        return turn.real, turn.imag

    for name, box in env.frame.objects.items():
        assert (seen[f"{name}_x"], seen[f"{name}_y"]) == pytest.approx(in_vehicle(box.pose.position), abs=1e-6)
    forward, left = seen["goal_x"], seen["goal_y"]
    goal = complex(forward, left) * np.exp(1j * heading) + complex(x, y)
    assert goal.real == pytest.approx(2.0, abs=1e-5)
    assert goal.imag == pytest.approx(round(goal.imag), abs=1e-5)
    assert seen["goal_cos"] ** 2 + seen["goal_sin"] ** 2 == pytest.approx(1.0)


# -- the tasks --------------------------------------------------------------------------------------------------------


def test_the_reward_of_lane_keeping_is_the_progress_near_the_centre_line(envs: dict[str, DrivingEnv]) -> None:
    env = envs["lane_keeping"]
    lanes = load_map("tiny_town").lane_graph
    line = shapely.LineString(lanes.path(lanes.loops()[-1]))
    observation, _ = env.reset(seed=1)
    for _ in range(40):
        x, y = observation[8:10]
        before = car(env).pose.position
        observation, reward, has_ended, _, _ = env.step([1.0, 2.0 * y / (x * x + y * y) / 4.0])
        now = car(env).pose.position
        away = line.distance(shapely.Point(now[:2]))
        assert abs(values(env, observation)["offset"]) == pytest.approx(away, abs=1e-4)  # from points 2 cm apart
        way = math.hypot(*(now - before)[:2])
        assert reward == pytest.approx(
            way * (1.0 - away / 0.15), rel=0.15, abs=2e-4
        )  # way is a chord, not along the line
        assert not has_ended


def test_leaving_the_lane_ends_the_episode(envs: dict[str, DrivingEnv]) -> None:
    env = envs["lane_keeping"]
    env.reset(seed=1)
    observation, *rest = last_step(env, lambda: [1.0, 1.0])
    assert rest == [-1.0, True, False, {"is_success": False, "red_lights": 0, "stop_signs": 0}]
    seen = values(env, observation)
    assert abs(seen["offset"]) > 0.15 or seen["direction_cos"] < 0.0


@pytest.mark.parametrize("task", ["parking", "navigation"])
def test_the_goal_is_reached_by_a_car_that_is_placed_before_it(envs: dict[str, DrivingEnv], task: str) -> None:
    env = envs[task]
    seen = values(env, env.reset(seed=6)[0])
    heading = yaw_from_quaternion(car(env).pose.orientation)
    goal = complex(*car(env).pose.position[:2]) + complex(seen["goal_x"], seen["goal_y"]) * np.exp(1j * heading)
    heading += math.atan2(seen["goal_sin"], seen["goal_cos"])
    distance = math.hypot(seen["goal_x"], seen["goal_y"])
    place = goal - 0.1 * np.exp(1j * heading) if task == "parking" else goal
    env.rendered.world.teleport("V1", place.real, place.imag, heading)
    rewards: list[float] = []
    is_far = task == "parking"
    *_, info = last_step(env, lambda: [1.0 if is_far and len(rewards) < 5 else 0.0, 0.0], rewards)
    total = sum(rewards)
    assert info == {"is_success": True, **NO_OFFENCES[task]}
    turn = 0.2 * (1.0 - seen["goal_cos"]) if task == "parking" else 0.0
    assert total == pytest.approx(1.0 + distance + turn, abs=0.06)  # it stops within 5 cm, or was placed at the goal


@pytest.mark.parametrize("task", ["parking", "navigation"])
def test_a_collision_ends_the_episode(envs: dict[str, DrivingEnv], task: str) -> None:
    env = envs[task]
    env.reset(seed=COLLIDES[task])
    _, reward, has_ended, _, info = last_step(env, lambda: [1.0, 0.0])
    assert car(env).collision_count == 1
    assert has_ended
    assert reward == pytest.approx(-1.0, abs=0.1)  # with the progress of that step
    assert info == {"is_success": False, **NO_OFFENCES[task]}


def test_an_unstable_physics_ends_the_episode(envs: dict[str, DrivingEnv]) -> None:
    env = envs["parking"]
    env.reset(seed=1)
    env.rendered.world.compiled.state.qvel[0] = math.nan
    observation, reward, has_ended, _, _ = env.step([1.0, 0.0])
    assert (reward, has_ended) == (-1.0, True)
    assert observation in env.observation_space
    assert env.reset(seed=1)[0].tobytes() == make("parking").reset(seed=1)[0].tobytes()


# -- the page ---------------------------------------------------------------------------------------------------------


def test_the_page_shows_the_car(capsys: pytest.CaptureFixture[str]) -> None:
    env = make("navigation", render_mode="human")
    url = capsys.readouterr().out.split()[-1]
    with autodrive.Client(url) as client:
        env.reset(seed=1)
        plain = make("navigation")
        plain.reset(seed=1)
        for _ in range(4):
            shown, expected = env.step([1.0, 0.3]), plain.step([1.0, 0.3])
            assert shown[0].tobytes() == expected[0].tobytes()
        while client.frame.tick < 20:
            client.wait(timeout=60.0)
        with pytest.raises(autodrive.AutodriveError, match=r"this is an environment.*Reset is refused"):
            client.reset()
        assert set(client.status.refused) >= {"Reset", "LoadScenario", "Place", "UseMap", "ConnectBridge"}
        assert "Pause" not in client.status.refused
        assert client.frame.vehicles["V1"].pose.position.tolist() == car(plain).pose.position.tolist()
        assert client.status.episode is not None
        assert (client.status.episode.number, client.status.episode.cars) == (1, {"V1": "drives"})
        env.reset(seed=2)

        def is_second() -> bool:
            status = client.connection.view.status
            return status is not None and status.episode is not None and status.episode.number == 2

        client.connection.until(is_second, 60.0, "Status")
        assert client.status.episode is not None
        assert (client.status.episode.succeeded, client.status.episode.ended) == (0, 1)
    assert env.render() is None
    env.close()
    env.close()


@pytest.mark.parametrize("kind", [DrivingEnv, DrivingParallelEnv, CrossingParallelEnv, DuelParallelEnv, RoboRacerEnv])
@pytest.mark.parametrize("name", ["threads", "autoreset_mode", "num_envs", "fogg"])
def test_an_environment_of_one_world_refuses_a_setting_that_it_does_not_have(kind: Any, name: str) -> None:
    with pytest.raises(TypeError, match=rf"^{kind.__name__}\(\) has no argument '{name}'\. (?!.*(num_envs|Vector))"):
        kind(**{name: 2})
