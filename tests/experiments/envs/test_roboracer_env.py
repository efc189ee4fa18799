"""The time trial and the race of the car RoboRacer: single, vector and PettingZoo environments on random tracks."""

from __future__ import annotations

import itertools
import math
import tempfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.conditions import Conditions
from autodrive.experiments.envs.crossing_env import CrossingParallelEnv
from autodrive.experiments.envs.duel_env import DuelParallelEnv
from autodrive.experiments.envs.episodes import observed
from autodrive.experiments.envs.race_env import RaceParallelEnv
from autodrive.experiments.envs.race_tracks import APART, AREA, ROWS, RaceTracks
from autodrive.experiments.envs.registration import IDS, ROBORACER, SEVERAL_CARS
from autodrive.experiments.envs.roboracer_env import RoboRacerEnv
from autodrive.experiments.envs.time_trial import FAILURE
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.tracks.generate import generate_track

BEARINGS = np.linspace(-132.5, 132.5, 54)
"""Of the sectors of the observation 'lidar' [deg]."""
SPEED, SCAN = 0, 6
"""Where an observation has the forward speed, and the first range."""


def made(**settings: Any) -> RoboRacerEnv:
    env = gymnasium.make("autodrive:RoboRacer-v0", **settings).unwrapped
    assert isinstance(env, RoboRacerEnv)
    return env


def action_for(observation: np.ndarray, top_speed: float = 2.5) -> np.ndarray:
    """A driver that steers into the widest gap ahead, away from the nearer wall."""
    ranges = observation[SCAN:]
    left, right = (ranges[(side * BEARINGS > 40) & (side * BEARINGS < 100)].min() for side in (1, -1))
    free = np.minimum.reduce([np.roll(ranges, k) for k in range(-4, 5)])
    free = np.where(np.abs(BEARINGS) < 75, free, 0.0)
    gap = math.radians(BEARINGS[free >= free.max() - 0.3].mean())
    speed = min(0.6 + 0.6 * ranges[np.abs(BEARINGS) < 8].min(), top_speed)
    steering = (0.9 * gap + 0.25 * (left - right)) / 0.5236
    return np.array([speed / 25.252, min(max(steering, -1.0), 1.0)], np.float32)


@pytest.mark.slow
def test_a_driver_of_a_few_lines_drives_a_lap_on_every_track() -> None:
    env, tracks = made(), set()
    for seed in range(4):
        observation, _ = env.reset(seed=seed)
        tracks.add(round(env.vector.batch.readings.position[0, 0, 1] / (AREA[1] + APART)))
        total, info = 0.0, {"is_success": False}
        for _ in range(1000):
            observation, reward, terminated, _, info = env.step(action_for(observation))
            total += reward
            assert not terminated, "a collision"
            if info["is_success"]:
                break
        assert info["is_success"]
        assert total == pytest.approx(env.distance)
        assert total == pytest.approx(40.0, rel=0.06)  # a lap
    assert len(tracks) > 1


def test_an_observation_begins_with_the_speed_and_ends_with_the_scan() -> None:
    names = [feature.name for feature in observed(made().vector.task, "lidar")]
    assert (names[SPEED], names[SCAN], names[-1]) == ("speed", "range_-132.5", "range_132.5")


def after(steps: int, throttle: float, **settings: Any) -> RoboRacerEnv:
    env = made(**settings)
    env.reset(seed=2)
    for _ in range(steps):
        env.step(np.array([throttle, 0.0], np.float32))
    return env


def test_each_condition_changes_what_it_names() -> None:
    speed = {
        name: after(8, 1.0, **settings).vector.batch.readings.velocity[0, 0, 0]
        for name, settings in {
            "as it is": {},
            "slippery": {"friction": 0.2},
            "heavy": {"mass": 2.0},
            "late": {"latency": 0.05},
        }.items()
    }
    assert speed["slippery"] < 0.5 * speed["as it is"]
    # the wheels spin, so that the force grows as the mass
    assert speed["heavy"] == pytest.approx(speed["as it is"], rel=0.01)
    # 0.05 s are two of the eight actions
    assert speed["late"] == pytest.approx(after(6, 1.0).vector.batch.readings.velocity[0, 0, 0], rel=1e-9)
    scans = [made(noise=noise).reset(seed=2)[0][SCAN:] for noise in (0.0, 0.0, 3.0)]
    assert (scans[0] == scans[1]).all()
    assert 0.001 < np.abs(scans[2] - scans[0]).max() < 2.0


def test_conditions_may_change_from_episode_to_episode() -> None:
    env = made()
    env.conditions = Conditions(mass=(2.0, 2.0))
    env.reset(seed=2)
    batch = env.vector.batch
    assert (batch.worlds.wheels["sprung_mass"] == 2.0 * batch.compiled.model.wheels["sprung_mass"]).all()


def test_a_latency_that_is_no_whole_number_of_steps_delays_by_ticks() -> None:
    env = made(latency=0.015, frame_skip=5)  # three ticks
    env.reset(seed=2)
    env.step(np.array([1.0, 1.0], np.float32))
    steered = made(frame_skip=2)
    steered.reset(seed=2)
    steered.step(np.array([1.0, 1.0], np.float32))
    assert env.vector.batch.readings.steering[0, 0] == pytest.approx(steered.vector.batch.readings.steering[0, 0])


def test_a_collision_ends_the_episode() -> None:
    env = made()
    env.reset(seed=1)
    for _ in range(400):
        _, reward, terminated, _, _ = env.step(np.array([0.2, 1.0], np.float32))
        if terminated:
            assert reward == FAILURE
            return
    pytest.fail("no collision")


def test_tracks_have_curves_of_the_radius_that_was_asked_for() -> None:
    """By the circle through points 0.3 m apart."""
    for radius in (0.8, 1.5):
        tracks = RaceTracks(2, 0, (1.0, 1.1), (55.0, 60.0), (radius, radius))
        for line, count in zip(tracks.lines, tracks.count.tolist(), strict=True):
            b = line[:count, :2]
            a, c = np.roll(b, 6, axis=0), np.roll(b, -6, axis=0)
            (x, y), (u, v) = (b - a).T, (c - a).T
            area = 0.5 * np.abs(x * v - y * u)
            sides = [np.hypot(*(wall - other).T) for wall, other in ((a, b), (b, c), (c, a))]
            least = (np.prod(sides, axis=0) / np.maximum(4.0 * area, 1e-9)).min()
            assert 0.98 * radius < least < 1.6 * radius


@pytest.mark.parametrize(("area", "length"), [(AREA, 40.0), ((30.0, 12.0), 65.0)])
def test_tracks_lie_apart_in_rows_and_columns(area: tuple[float, float], length: float) -> None:
    tracks = RaceTracks(ROWS + 1, 0, (1.4, 1.4), (length, length), None, area)
    corners = [(line[:count, :2].min(0), line[:count, :2].max(0)) for line, count in zip(tracks.lines, tracks.count)]  # noqa: B905
    extents = np.array([high - low for low, high in corners])
    assert (extents < area).all()
    assert (extents.max(axis=0) > 0.8 * np.array(area)).all(), "the ground is used"
    for (low, high), (other_low, other_high) in itertools.combinations(corners, 2):
        assert np.maximum(other_low - high, low - other_high).max() > APART
    assert load_map(tracks.file).track is not None  # it is not too large


def test_a_length_that_does_not_fit_is_drawn_again() -> None:
    """Of seed 10, the first draw has no track on its ground."""
    tracks = RaceTracks(1, 10, (0.9, 1.3), (45.0, 70.0), None)
    first = np.random.default_rng([10, 0, 1]).random(2)
    with pytest.raises(SpecError, match="no track of"):
        generate_track(10, width=round(0.9 + 0.4 * first[0], 3), length=round(45.0 + 25.0 * first[1], 3), area=AREA)
    assert 43.0 < tracks.length[0] < 69.0


def test_an_image_of_the_front_camera_is_rendered(gl: str) -> None:
    env = made(render_mode="rgb_array")
    env.reset(seed=1)
    image = env.render()
    assert image is not None
    assert image.shape == (360, 640, 3)
    assert image.std() > 10.0
    env.close()


# -- the race ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_race_ends_when_the_first_car_has_driven_all_laps() -> None:
    race = RaceParallelEnv(3, laps=1)
    observations, _ = race.reset(seed=3)
    assert race.distance.max() == pytest.approx(-1.0, abs=0.05), "the first place is behind the start line"
    grid = [race.possible_agents[k] for k in np.argsort(-race.distance)]
    infos, terminated = {}, {}
    for step in range(1200):
        # the cars start one after the other, so that a driver without overtaking hits no other car
        tops = {agent: (2.5 - 0.5 * k) * (step >= 60 * k) for k, agent in enumerate(grid)}
        actions = {agent: action_for(observations[agent], tops[agent]) for agent in race.agents}
        observations, _, terminated, _, infos = race.step(actions)
        if not race.agents:
            break
        assert not any(terminated.values()), "a collision"
    assert terminated == dict.fromkeys(race.possible_agents, True)
    assert [infos[agent]["rank"] for agent in grid] == [1, 2, 3]
    assert [infos[agent]["is_success"] for agent in grid] == [True, False, False]
    assert infos[grid[0]]["distance"] == pytest.approx(40.0, rel=0.06)


def test_a_car_that_collides_leaves_the_race_and_the_others_go_on() -> None:
    race = RaceParallelEnv(2)
    race.reset(seed=3)
    first = race.possible_agents[int(race.distance.argmax())]
    for _ in range(400):
        actions = {agent: np.array([0.2, 1.0] if agent == first else [0.0, 0.0], np.float32) for agent in race.agents}
        _, rewards, terminated, _, _ = race.step(actions)
        if terminated[first]:
            assert rewards[first] == FAILURE
            assert first not in race.agents
            assert len(race.agents) == 1
            return
    pytest.fail("no collision")


def test_a_car_sees_the_other_ones() -> None:
    race = RaceParallelEnv(2)
    observations, _ = race.reset(seed=3)
    behind = race.possible_agents[int(race.distance.argmin())]
    ahead = observations[behind][SCAN:][np.abs(BEARINGS) < 60]
    assert ahead.min() < 1.0


def races(count: int, **settings: Any) -> Any:
    return gymnasium.make_vec(
        "autodrive:RoboRacer-v0", count, vectorization_mode="vector_entry_point", observation="lidar", **settings
    )


def test_the_cars_of_a_world_are_truncated_together_whatever_steps_were_written() -> None:
    many = races(4, cars=2, autoreset_mode="SameStep", max_episode_steps=9)
    many.reset(seed=1)
    many.steps[:] = 0, 8, 3, 2  # as a learning library does that spreads the ends of the episodes
    *_, truncated, _ = many.step(np.zeros((4, 2)))
    assert truncated.tolist() == [True, True, False, False]
    assert many.steps.tolist() == [0, 0, 4, 3]


def test_a_collision_ends_the_race_of_its_world_only() -> None:
    many = races(4, cars=2, autoreset_mode="SameStep")
    seen, _ = many.reset(seed=1)
    while True:
        actions = np.array([action_for(observation, 1.0) for observation in seen])
        actions[2] = 0.3, 1.0  # the first car of the second world drives into the wall
        seen, reward, terminated, truncated, info = many.step(actions)
        assert many.steps[0] < 400
        if terminated.any():
            break
    assert terminated.tolist() == [False, False, True, False]
    assert truncated.tolist() == [False, False, False, True]
    assert reward[2] == FAILURE
    assert info["_final_obs"].tolist() == [False, False, True, True]
    assert many.steps.tolist()[2:] == [0, 0]
    assert (many.steps[:2] > 0).all()
    assert sorted(many.distance[2:].tolist()) == pytest.approx([-2.0, -1.0], abs=1e-9)


def test_rivalry_rewards_what_a_car_gains_on_the_others() -> None:
    alone, rivals = (races(3, cars=3, rivalry=factor) for factor in (0.0, 0.5))
    for env in (alone, rivals):
        env.reset(seed=2)
    actions = np.array([[0.1, 0.0], [0.06, 0.0], [0.03, 0.0]])
    for step in range(40):
        own, more = (env.step(actions)[1] for env in (alone, rivals))
        others = (own.sum() - own) / 2.0  # without a collision the reward is the distance
        assert more - own == pytest.approx(0.5 * (own - others), abs=1e-12)
        assert own[0] > own[2] > 0.0 or step < 39


def test_a_mask_does_not_separate_the_cars_of_a_world() -> None:
    many = races(4, cars=2, autoreset_mode="Disabled")
    many.reset(seed=1)
    with pytest.raises(ValueError, match="the same for all cars of a world"):
        many.reset(options={"reset_mask": np.array([True, False, False, False])})
    many.reset(options={"reset_mask": np.array([True, True, False, False])})


def test_tracks_need_no_home_that_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual = RaceTracks(1, 4, (1.4, 1.4), (40.0, 40.0), None)
    blocked = tmp_path / "file"
    blocked.write_text("a file where the cache should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for _ in range(2):
        tracks = RaceTracks(1, 4, (1.4, 1.4), (40.0, 40.0), None)
        assert tmp_path in tracks.file.parents
        np.testing.assert_array_equal(tracks.lines, usual.lines)
        assert load_map(tracks.file).track is not None


@pytest.mark.parametrize("id_", [*IDS, ROBORACER, *SEVERAL_CARS])
def test_every_environment_names_its_features(id_: str) -> None:
    """As docs/learning.md shows."""
    parallel: dict[str, Any] = {"NigelCrossing-v0": CrossingParallelEnv, "RoboRacerDuel-v0": DuelParallelEnv}
    env: Any = parallel[id_]() if id_ in parallel else gymnasium.make(f"autodrive:{id_}", observation="state").unwrapped
    space = env.observation_space("V1") if id_ in parallel else env.observation_space
    assert space.shape == (len(observed(env.task, "state")),)
