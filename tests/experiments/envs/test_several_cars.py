"""Environments of several cars: the tests of PettingZoo, the bits of one world, and the published rewards by hand."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
import shapely
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from gymnasium.wrappers.vector import RecordEpisodeStatistics

from autodrive.base.errors import CommandError, SpecError
from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.envs import porto
from autodrive.experiments.envs.crossing import LANES, NEAR
from autodrive.experiments.envs.crossing_env import CrossingParallelEnv, CrossingVectorEnv
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.duel import CHECKPOINTS
from autodrive.experiments.envs.duel_env import DuelParallelEnv, DuelVectorEnv
from autodrive.experiments.envs.registration import IDS, ROBORACER, SEVERAL_CARS

FAST, HALF_FAST = 4, 1
"""Published actions of the crossing: straight on with throttle 1 and 0.5."""


def test_one_car_alone_is_refused() -> None:
    for id_ in SEVERAL_CARS:
        with pytest.raises(SpecError, match=r"several cars: use gymnasium.make_vec"):
            gymnasium.make(f"autodrive:{id_}")


@pytest.mark.parametrize("id_", [*IDS, ROBORACER, *SEVERAL_CARS])
def test_what_gymnasium_says_of_vector_environments(id_: str) -> None:
    """Spaces, metadata, seeds and the wrapper that counts episodes."""
    envs = gymnasium.make_vec(f"autodrive:{id_}", 4, max_episode_steps=5)
    assert envs.num_envs == 4
    assert envs.observation_space == batch_space(envs.single_observation_space, 4)
    assert envs.action_space == batch_space(envs.single_action_space, 4)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert envs.spec is not None
    worlds = envs.unwrapped.batch.n  # pyright: ignore[reportAttributeAccessIssue]
    first = rollout(envs, 3)
    assert rollout(envs, [3 + k for k in range(worlds)]) == first
    assert rollout(gymnasium.make_vec(f"autodrive:{id_}", 4, max_episode_steps=5), 3) == first
    assert rollout(envs, 4) != first
    counted = RecordEpisodeStatistics(envs)
    counted.reset(seed=1)
    for _ in range(5):
        *_, truncated, info = counted.step(envs.action_space.sample())
    ended = truncated  # pyright: ignore[reportPossiblyUnboundVariable]
    assert (info["episode"]["l"][ended] == 5).all()  # pyright: ignore[reportPossiblyUnboundVariable]
    assert ended.any()


@pytest.mark.parametrize(
    "make",
    [
        lambda: gymnasium.make("autodrive:NigelParking-v0"),
        lambda: gymnasium.make("autodrive:RoboRacer-v0"),
        lambda: gymnasium.make_vec("autodrive:NigelParking-v0", 2),
        lambda: gymnasium.make_vec("autodrive:NigelCrossing-v0", 4),
    ],
)
def test_an_unknown_option_of_a_reset_is_named(make: Any) -> None:
    env = make()
    known = "Known: reset_mask. Did you mean 'reset_mask'" if hasattr(env, "num_envs") else "This environment has none"
    with pytest.raises(SpecError, match=f"options: 'reset_maks' is not known. {known}"):
        env.reset(options={"reset_maks": np.ones(2, np.bool_)})
    env.reset(options={})
    env.close()


def rollout(envs: Any, seed: Any) -> bytes:
    """The bits of some steps with the same actions; all is in the spaces, and has the types, of Gymnasium."""
    observations, info = envs.reset(seed=seed)
    assert isinstance(info, dict)
    envs.action_space.seed(1)
    bits = [observations.tobytes()]
    for _ in range(8):
        observations, reward, terminated, truncated, info = envs.step(envs.action_space.sample())
        assert observations in envs.observation_space
        assert (reward.dtype, terminated.dtype, truncated.dtype) == (np.float64, np.bool_, np.bool_)
        assert reward.shape == terminated.shape == truncated.shape == (envs.num_envs,)
        for name in info:
            if not name.startswith("_"):
                assert info[f"_{name}"].shape == (envs.num_envs,)
        bits += [values.tobytes() for values in (observations, reward, terminated, truncated)]
    return b"".join(bits)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_the_ids_make_vector_environments_in_every_autoreset_mode(mode: str) -> None:
    for id_, (_, steps) in SEVERAL_CARS.items():
        envs = gymnasium.make_vec(f"autodrive:{id_}", 4, autoreset_mode=mode, max_episode_steps=3)
        assert isinstance(envs, DrivingVectorEnv)
        assert gymnasium.spec(id_).max_episode_steps == steps
        assert envs.reset(seed=1)[0] in envs.observation_space
        for _ in range(2):
            envs.step(envs.action_space.sample())
        observations, *_, truncated, info = envs.step(envs.action_space.sample())
        assert observations in envs.observation_space
        assert truncated.all()
        assert ("final_obs" in info) == (mode == "SameStep")


def test_the_published_spaces_are_those_of_the_benchmark() -> None:
    crossing, duel = CrossingVectorEnv(4, variant="published"), DuelVectorEnv(2, variant="published")
    assert (crossing.single_observation_space.shape, duel.single_observation_space.shape) == ((14,), (55,))
    six = [(0.5, 1.0), (0.5, 0.0), (0.5, -1.0), (1.0, 1.0), (1.0, 0.0), (1.0, -1.0)]
    assert crossing.single_action_space == gymnasium.spaces.Discrete(6)
    assert crossing.settings.choices.tolist() == [[*choice] for choice in six]
    assert duel.single_action_space == gymnasium.spaces.Discrete(9)
    nine = [[throttle, steering] for throttle in (0.1, 0.5, 1.0) for steering in (1.0, 0.0, -1.0)]
    assert duel.settings.choices.tolist() == nine


def goals(right: Any) -> np.ndarray:
    """Points of the goals of the four cars, `right` of the middle of the road."""
    return np.array([(-1.6, right), (-right, -1.6), (1.6, -right), (right, 1.6)])


@pytest.mark.parametrize(
    ("actions", "arrive"),
    [
        ([FAST] * 4, False),
        ([FAST, HALF_FAST] * 2, True),  # two opposite cars are through when the others come
    ],
)
def test_the_published_crossing_rewards_what_the_table_says(actions: list[int], arrive: bool) -> None:
    envs = CrossingVectorEnv(4, variant="published", max_episode_steps=None, autoreset_mode="Disabled")
    envs.reset(seed=1)
    info: dict[str, Any] = {}
    while envs.is_live.any():
        before = envs.is_live.copy()
        _, reward, _, _, info = envs.step(np.array(actions))
        places = envs.batch.readings.position[0, :, :2]
        away = np.linalg.norm(places - goals(np.mean(LANES)), axis=1)
        ended = before & ~envs.is_live
        assert reward[before & ~ended] == pytest.approx(0.01 / (0.001 + away[before & ~ended]), rel=1e-12)
        assert not reward[~before].any()
        assert reward[ended] == pytest.approx(np.ones(ended.sum()) if arrive else -0.425 * away[ended], rel=1e-12)
        for row in np.flatnonzero(ended if arrive else np.zeros(4)):
            near = [np.linalg.norm(places[row] - goals(right)[row]) for right in LANES]
            assert NEAR - 0.03 < min(near) <= NEAR  # 0.44 m/s for 0.05 s
    assert (envs.batch.readings.collision_count > 0).all() == (not arrive)
    assert info["is_success"].tolist() == [arrive] * 4


def test_the_published_observation_of_the_crossing_is_that_of_the_poses() -> None:
    env = CrossingParallelEnv(variant="published")
    observations, _ = env.reset(seed=2)
    for _ in range(30):
        observations, *_ = env.step(dict.fromkeys(env.agents, FAST))
    readings = env.vector.batch.readings
    places = readings.position[0, :, :2]
    yaws = np.array([yaw_from_quaternion(orientation) for orientation in readings.orientation[0]]) % (2.0 * math.pi)
    for i, agent in enumerate(env.possible_agents):
        others = [(i + k) % 4 for k in (1, 2, 3)]
        expected = [*(goals(np.mean(LANES))[i] - places[i])]
        for j in others:
            expected += [*(places[j] - places[i]), yaws[j] - yaws[i], np.nan]
        seen = observations[agent].astype(float)
        assert np.round(1000.0 * seen) == pytest.approx(1000.0 * seen, abs=1e-3)  # whole thousandths, as float32
        speeds = seen[[5, 9, 13]]
        assert seen[np.isfinite(expected)] == pytest.approx(np.array(expected)[np.isfinite(expected)], abs=6e-4)
        # the encoders turn as fast as the car drives, but for the slip; a pulse is 2 pi / 1920 rad of 32.5 mm: 2 mm/s
        assert speeds == pytest.approx(readings.velocity[0, others, 0], abs=0.01)


def test_the_throttle_of_a_published_car_has_the_factor_of_its_episode() -> None:
    envs = CrossingVectorEnv(400, variant="published")
    envs.reset(seed=3)
    for _ in range(30):
        envs.step(np.full(400, HALF_FAST))
    speeds = envs.batch.readings.velocity[..., 0].ravel()
    factors = speeds / (0.5 * 0.4403)  # speed limit of 130 rpm, see vehicles/nigel.yaml
    assert 0.895 < factors.min() < 0.905
    assert 0.99 < factors.max() < 1.005
    assert np.histogram(factors, 4, (0.9, 1.0))[0].min() > 60  # uniform: 100 each, with a deviation of 9


def test_lost_messages_leave_what_was_heard_last() -> None:
    envs = CrossingVectorEnv(400, loss=0.3)
    observations, _ = envs.reset(seed=4)
    names = [feature.name for feature in envs.task.features]
    age = [names.index(f"peer_{k}_age") for k in (1, 2, 3)]
    peers = observations[:, 8:].reshape(400, 3, 6)
    is_silent = peers[..., 5] == 1.0
    assert not peers[is_silent, :5].any()
    assert not peers[~is_silent, 5].any()
    assert is_silent.mean() == pytest.approx(0.3, abs=0.05)  # 1,200 draws: 4 sigma
    counts = np.zeros(6)
    for step in range(50):
        before = observations
        observations, *_ = envs.step(np.zeros((400, 2), np.float32))
        ages = np.rint(20.0 * observations[:, age]).astype(int)
        older = np.minimum(np.rint(20.0 * before[:, age]).astype(int) + 1, 20)
        assert ((ages == 0) | (ages == older)).all()
        if step >= 10:  # nobody is silent any more
            counts += np.bincount(ages.ravel(), minlength=100)[:6]
    share = counts / (40 * 400 * 3)
    # an age of k steps: k messages lost after one that was not, a geometric distribution; 48,000 draws
    assert share[:4] == pytest.approx([0.7 * 0.3**k for k in range(4)], abs=0.01)


@pytest.mark.parametrize("frame_skip", [5, 7])
def test_the_cars_of_a_crossing_hear_each_other_over_the_channel(frame_skip: int) -> None:
    """What a car sees of another is what that one was when it sent; `delay` and `rate` are those of the channel."""
    for delay, rate in ((0.0, None), (0.12, None), (0.02, 4.0)):
        env = CrossingParallelEnv(loss=0.0, delay=delay, rate=rate, frame_skip=frame_skip)
        env.reset(seed=2)
        duration, compared = 0.01 * frame_skip, 0
        were: dict[float, tuple[Any, Any, Any]] = {}
        for step in range(1, 20):
            observations, *_ = env.step({agent: np.array([1.0, 0.1]) for agent in env.agents})
            now = env.vector.batch.readings
            were[step] = now.position[0].copy(), now.orientation[0].copy(), now.velocity[0].copy()
            for k in (1, 2, 3):
                x, y, c, s, speed, age = observations["V1"][2 + 6 * k : 8 + 6 * k].tolist()
                if rate is None and step > 5:  # sent at the end of the step before the delay
                    assert 20.0 * age == pytest.approx(math.ceil(delay / duration - 1e-9), abs=1e-4)
                sent = step - 20.0 * age
                if abs(sent - round(sent)) > 1e-3 or round(sent) not in were:
                    continue
                position, orientation, velocity = were[round(sent)]
                own = yaw_from_quaternion(now.orientation[0, 0])
                dx, dy = position[k, :2] - now.position[0, 0, :2]
                expected = [
                    (math.cos(own) * dx + math.sin(own) * dy) / 4.0,
                    (math.cos(own) * dy - math.sin(own) * dx) / 4.0,
                    math.cos(yaw_from_quaternion(orientation[k]) - own),
                    math.sin(yaw_from_quaternion(orientation[k]) - own),
                    velocity[k, 0] / 0.5,
                ]
                assert [x, y, c, s, speed] == pytest.approx(expected, abs=1e-6)  # numbers of 32 bits
                compared += 1
        assert compared > 5 or rate is not None


def test_an_own_crossing_has_a_reward_of_the_way_and_ends_beside_the_road() -> None:
    env = CrossingParallelEnv(loss=0.0)
    env.reset(seed=5)
    left = {agent: np.array([1.0, 1.0]) for agent in env.agents}
    start = env.vector.batch.readings.position[0, 0, 0]
    total, ended = 0.0, False
    infos: dict[str, Any] = {}
    while not ended:
        _, rewards, terminated, _, infos = env.step({agent: left[agent] for agent in env.agents})
        total, ended = total + rewards["V1"] + 0.002, terminated["V1"]
    x, y = env.vector.batch.readings.position[0, 0, :2]
    yaw = yaw_from_quaternion(env.vector.batch.readings.orientation[0, 0])
    assert not infos["V1"]["is_success"]
    assert total == pytest.approx(start - x - 2.0, abs=1e-9)  # V1 heads for -x
    assert y < 0.0 or -math.cos(yaw) < 0.5
    assert env.vector.batch.readings.collision_count[0, 0] == 0


def test_the_published_duel_rewards_what_the_table_says() -> None:
    env = DuelParallelEnv(variant="published", max_episode_steps=None)
    best, rewards_seen = math.inf, []
    for seed in (1, None):
        env.reset(seed=seed)
        passed, length = 0, float(env.vector.task.tracks.length[0])
        while "V1" in env.agents:
            observations, rewards, _, _, infos = env.step({agent: act(env, agent) for agent in env.agents})
            speed = abs(env.vector.batch.readings.velocity[0, 0, 0])
            driven, collisions = env.vector.distance[0], env.vector.batch.readings.collision_count[0, 0]
            assert observations["V1"][-1] == pytest.approx(round(speed, 2), abs=1e-6)
            rewards_seen.append(rewards["V1"])
            now = math.floor(driven * CHECKPOINTS / length)
            if collisions:
                expected = -1.0
            elif driven >= length:
                expected = 0.7 if env.vector.batch.readings.time[0] < best else 0.1
                best = min(best, env.vector.batch.readings.time[0])
            else:
                expected = 0.01 if now > passed else 0.01 * speed
            passed = max(now, passed)
            assert rewards["V1"] == pytest.approx(expected, rel=1e-9)
            assert infos["V1"]["is_success"] == (expected in (0.7, 0.1) and driven >= length)
    assert 0.7 in rewards_seen
    assert best < math.inf


def pursuit(env: DuelParallelEnv, agent: str, right: float = 0.0) -> float:
    """Steering, left positive, towards the point 0.8 m ahead on the centre line, or `right` of it [m]."""
    row = env.possible_agents.index(agent)
    pose = env.vector.batch.readings
    line = env.vector.task.tracks.lines[0, : env.vector.task.tracks.count[0]]
    place = pose.position[0, row, :2]
    x, y, c, s = line[(int(np.argmin(np.linalg.norm(line[:, :2] - place, axis=1))) + 16) % len(line)]
    ahead = complex(x + right * s - place[0], y - right * c - place[1])
    ahead *= np.exp(-1j * yaw_from_quaternion(pose.orientation[0, row]))
    return math.atan(2.0 * 0.33 * ahead.imag / abs(ahead) ** 2) / 0.42


def act(env: DuelParallelEnv, agent: str) -> int:
    """A published action with half throttle."""
    steering = pursuit(env, agent, 0.3 if agent == "V1" else -0.3)
    return 3 if steering > 0.3 else 5 if steering < -0.3 else 4


def test_the_rays_of_the_published_duel_end_at_the_walls_in_the_order_of_ml_agents() -> None:
    """The order is that of `GetRayAngles` of ML-Agents: 90, 90 - d, 90 + d, 90 - 2 d, ... with x to the right."""
    env = DuelParallelEnv(variant="published")
    observations, _ = env.reset(seed=1)
    walls = shapely.MultiLineString([shapely.LinearRing(wall) for wall in porto.track().walls])
    delta = 135.0 / 13
    angles = [90.0, *(90.0 + side * k * delta for k in range(1, 14) for side in (-1, 1))]
    (x, y), yaw = env.vector.batch.readings.position[0, 0, :2], -math.pi / 2
    x, y = x + 0.2733 * math.cos(yaw), y + 0.2733 * math.sin(yaw)
    hits = 0
    for k, angle in enumerate(angles):
        bearing = yaw + math.radians(angle) - math.pi / 2
        ray = shapely.LineString([(x, y), (x + 10.0 * math.cos(bearing), y + 10.0 * math.sin(bearing))])
        away = ray.intersection(walls).distance(shapely.Point(x, y)) / 10.0 if ray.intersects(walls) else 1.0
        is_hit, distance = observations["V1"][2 * k : 2 * k + 2].tolist()
        # walls are simplified by 3 mm; a ray that meets them at 5 degrees sees that 12 times as far away
        assert (is_hit, distance) == (float(away == 1.0), pytest.approx(away, abs=4e-3))
        hits += away < 1.0
    assert 20 < hits < 27  # those ahead end on the straight


def test_the_published_duel_has_the_car_the_starts_and_the_steps_of_the_published_scene() -> None:
    env = DuelParallelEnv(variant="published")
    env.reset(seed=3)
    readings, track = env.vector.batch.readings, porto.track()
    for car, (x, y, yaw) in enumerate([(14.8, -7.0, -90.0), (11.0, -15.0, 60.0)]):
        at, heading = readings.position[0, car, :2], yaw_from_quaternion(readings.orientation[0, car])
        ahead = np.array([math.cos(heading), math.sin(heading)])
        assert math.degrees(heading) == pytest.approx(yaw, abs=1e-6)
        assert at + 0.16 * ahead == pytest.approx((x, y), abs=1e-6)  # the root is 0.16 m before the rear axle
        s, aside = track.project(x, y)
        assert abs(aside) < 0.1
        assert math.cos(track.pose_at(s)[2] - heading) > math.cos(math.radians(15.0))
    fast = 7  # throttle 1, straight on
    before = 0.0
    for step in range(1, 451):
        before = readings.encoder_angles[0, 0, 0]
        env.step({"V1": fast, "V2": 1})
        assert readings.time[0] == pytest.approx(0.004 * step, abs=1e-9)
    # the drag of the air of 0.273/s at 5 m/s takes 0.4 % of what the damping of the wheels takes
    spin = (readings.encoder_angles[0, 0, 0] - before) / 0.004
    assert spin == pytest.approx((21.4 - 0.059 * 3.470 * 0.273 * readings.velocity[0, 0, 0] / 4.0) / 0.25, rel=5e-3)
    assert readings.collision_count[0, 0] == 0


def test_an_own_duel_ends_for_both_when_one_has_won() -> None:
    env = DuelParallelEnv(laps=1, tracks=1, max_episode_steps=None)
    env.reset(seed=1)
    length, before, totals = env.vector.task.tracks.length[0], env.vector.distance, np.zeros(2)
    sides = {"V1": 0.3, "V2": -0.3}
    infos: dict[str, Any] = {}
    while env.agents:
        live = list(env.agents)
        speeds = {"V1": 0.08, "V2": 0.05}
        _, rewards, _, _, infos = env.step(
            {agent: np.array([speeds[agent], pursuit(env, agent, sides[agent])]) for agent in live}
        )
        totals += [rewards.get(agent, 0.0) for agent in env.possible_agents]
    gains = env.vector.distance - before
    winner = int(np.argmax(env.vector.distance))
    assert env.vector.distance[winner] >= length
    assert [infos[agent]["is_success"] for agent in env.possible_agents] == [winner == 0, winner == 1]
    expected = gains - gains[::-1] + 0.2 * gains + np.where(np.arange(2) == winner, 5.0, -5.0)
    assert totals == pytest.approx(expected, abs=1e-9)


def test_a_missing_or_wrong_action_is_named() -> None:
    env = CrossingParallelEnv(variant="published")
    env.reset(seed=1)
    with pytest.raises(CommandError, match="actions: the action of V4 is missing"):
        env.step(dict.fromkeys(("V1", "V2", "V3"), FAST))
    with pytest.raises(CommandError, match="actions must be from 0 to 5"):
        env.step(dict.fromkeys(env.agents, 6))
