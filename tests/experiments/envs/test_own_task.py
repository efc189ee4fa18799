"""Own tracks, maps, rewards and ends: docs/own_task.md. Measures are compared with the projection on the track."""

from __future__ import annotations

import io
import re
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.own_rules import Step
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import Track

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs/own_task.md").read_text(encoding="utf-8")
RACER, LANE, PARKING = "autodrive:RoboRacer-v0", "autodrive:NigelLaneKeeping-v0", "autodrive:NigelParking-v0"


@pytest.fixture(scope="module")
def hall() -> Track:
    return generate_track(1, length=30.0, area=(20.0, 10.0))


def reward(step: Step) -> Any:
    jerk = np.abs(step.actions - step.last_actions).sum(axis=1)
    return step.progress * np.cos(step.angle) - 0.1 * jerk - 5.0 * step.has_collided - 0.01 * step.steps


def end(step: Step) -> Any:
    return step.has_ended | (np.abs(step.offset) > 0.12)


def no_reward(step: Step) -> Any:
    return np.zeros(len(step.steps))


def test_the_measures_are_those_of_the_projection_on_the_track(hall: Track) -> None:
    """The centre line of the environment has a point each 5 cm, between which the projection is linear."""
    seen: list[Step] = []

    def watching(step: Step) -> Any:
        seen.append(step)
        return step.progress

    envs: Any = gymnasium.make_vec(RACER, 4, track=hall, reward=watching, end=lambda step: step.steps > 100)
    envs.reset(seed=3)
    starts = [hall.project(*xy)[0] for xy in envs.unwrapped.batch.readings.position[:, 0, :2].tolist()]
    total = np.zeros(4)
    for k in range(40):
        actions = np.tile(np.array([0.3, 0.1], np.float32), (4, 1))
        total += envs.step(actions)[1]
        assert seen[-1].steps.tolist() == [k + 1] * 4
        np.testing.assert_array_equal(seen[-1].actions, actions)
        np.testing.assert_array_equal(seen[-1].last_actions, actions if k else np.zeros((4, 2)))
    readings = envs.unwrapped.batch.readings
    for car, (x, y) in enumerate(readings.position[:, 0, :2].tolist()):
        s, left = hall.project(x, y)
        driven = (s - starts[car]) % hall.length
        assert driven > 0.5
        assert total[car] == pytest.approx(driven, abs=0.06)
        assert seen[-1].distance[car] == pytest.approx(driven, abs=0.06)
        assert seen[-1].offset[car] == pytest.approx(left, abs=0.02)
        q = readings.orientation[car, 0]
        yaw = np.arctan2(2.0 * q[0] * q[3], 1.0 - 2.0 * q[3] ** 2)
        turned = yaw - hall.pose_at(s)[2]
        assert np.sin(seen[-1].angle[car] - turned) == pytest.approx(0.0, abs=0.1)


def test_episodes_are_on_all_of_the_tracks(hall: Track) -> None:
    other = generate_track(2, length=30.0, area=(20.0, 10.0))
    envs: Any = gymnasium.make_vec(RACER, 16, track=[hall, other], reward=no_reward)
    envs.reset(seed=1)
    x = envs.unwrapped.batch.readings.position[:, 0, 0]
    assert 0 < (x < hall.centre_line[:, 0].max() + 1.0).sum() < 16  # the second one is beside the first one
    with pytest.raises(SpecError, match="must have the same barrier"):
        gymnasium.make_vec(RACER, 1, track=[hall, "practice"])


def test_cars_start_where_they_fit_on_a_map_with_obstacles(tmp_path: Path) -> None:
    """Without the choice of places, a reset raises 'overlaps'."""
    file = tmp_path / "yard.yaml"
    oval = (ROOT / "src/autodrive/scenario/data/maps/oval.yaml").read_text(encoding="utf-8")
    file.write_text(oval + "blocks:\n  - {x: 0.6, y: 0.0, length: 0.3, width: 0.3, height: 0.25}\n")
    envs: Any = gymnasium.make_vec(LANE, 256, map=file, reward=lambda step: -1.0 * step.is_off_road)
    envs.reset(seed=1)
    x = envs.unwrapped.batch.readings.position[:, 0, :2]
    assert x.std() > 0.5
    assert np.linalg.norm(x - (0.6, 0.0), axis=1).min() > 0.2


@pytest.mark.parametrize(
    ("id_", "settings", "error"),
    [
        (PARKING, {"reward": 1.0}, "reward: must be a function of a Step, not 1.0"),
        (PARKING, {"reward": lambda _: 1.0}, r"a number for each car, an array of the shape \(3,\), not float64 of"),
        (PARKING, {"reward": lambda _: [1.0, 2.0]}, r"array of the shape \(3,\), not float64 of the shape \(2,\)"),
        (PARKING, {"reward": lambda _: [[1], [2, 3]]}, r"array of the shape \(3,\), not \[\[1\], \[2, 3\]\]"),
        (PARKING, {"reward": lambda _: [0.0, np.nan, 0.0]}, "must be finite, but that of environment 1 is nan"),
        (PARKING, {"end": lambda step: step.speed}, r"end: must return True or False for each car, .* not float64"),
        (PARKING, {"map": "oval"}, "map: only lane keeping accepts another map"),
        (LANE, {"map": "plane"}, "map: 'plane' has no closed way of lanes"),
        (LANE, {"map": "practice"}, "'practice' is a race track: RoboRacer-v0 drives on it, with track='practice'"),
        (RACER, {"track": "practise"}, r"track 'practise' is not known\. .*Did you mean 'practice'\?"),
        (RACER, {"track": []}, "track: must be a track or several"),
        (RACER, {"track": "practice", "tracks": 2}, "track: the settings of random tracks"),
    ],
)
def test_what_is_wrong_is_named(id_: str, settings: dict[str, Any], error: str) -> None:
    def steps() -> None:
        envs = gymnasium.make_vec(id_, 3, **settings)
        envs.reset(seed=1)
        envs.step(np.zeros((3, 2), np.float32))

    with pytest.raises(SpecError, match=error):
        steps()


def test_a_measure_that_the_task_has_not_is_named_with_those_that_it_has() -> None:
    envs = gymnasium.make_vec(PARKING, 1, reward=lambda step: step.progress)
    envs.reset(seed=1)
    with pytest.raises(AttributeError, match=r"has no 'progress'\. Known: goal_distance, goal_cos, cars, actions"):
        envs.step(np.zeros((1, 2), np.float32))


def test_the_programs_of_the_page_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of own_task.md; the commands before them make the files."""
    (tmp_path / "hall.yaml").write_text(generate_track(3, length=30.0, area=(20.0, 10.0)).text())
    oval = (ROOT / "src/autodrive/scenario/data/maps/oval.yaml").read_text(encoding="utf-8")
    (tmp_path / "yard.yaml").write_text(oval)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        if "stable_baselines3" not in code:  # test_stable_baselines3.py runs the example that it is a part of
            with redirect_stdout(io.StringIO()):
                exec(code, names)
    assert isinstance(names["envs"], DrivingVectorEnv)


def test_the_page_names_all_of_a_step() -> None:
    fields = [*Step.__dataclass_fields__, "speed", "has_collided", "is_off_road"]
    fields += ["progress", "distance", "offset", "angle", "goal_distance", "goal_cos"]
    assert [name for name in fields if name != "measures" and f"`{name}`" not in PAGE] == []
