"""The observation 'camera': single, parallel and vector environments show the same world."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.driving_env import DrivingEnv
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.lane_keeping import LaneKeeping
from autodrive.experiments.envs.parallel_env import DrivingParallelEnv
from autodrive.experiments.envs.roboracer_env import RoboRacerVectorEnv
from autodrive.physics.sensors.settings import SensorSettings


def assert_alike(image: NDArray[np.uint8], expected: NDArray[np.uint8]) -> None:
    """Batch and single camera round differently; see `tests/graphics/cameras/test_batch_camera.py`."""
    assert image.std() > 5.0
    assert np.abs(image.astype(int) - expected).max() <= 1


def last_images(env: DrivingEnv | DrivingVectorEnv, action: Any, steps: int) -> NDArray[np.uint8]:
    """The image of the first car after so many steps of an episode."""
    env.reset(seed=4)
    images = [env.step(action)[0]["image"] for _ in range(steps)]
    return images[-1].reshape(-1, 96, 128, 3)[0]


@pytest.mark.parametrize(
    "settings",
    [{"traffic": 4, "map": "tiny_town"}, {"traffic": 2, "map": "tiny_town", "fog": 0.4, "rain": 0.8, "snow": 0.5}],
    ids=["traffic", "weather"],
)
def test_a_vector_environment_shows_what_a_single_one_shows(gl: str, settings: dict[str, Any]) -> None:
    single, many = (kind(observation="camera", **settings) for kind in (DrivingEnv, DrivingVectorEnv))
    assert_alike(last_images(many, [[1.0, 0.1]], 20), last_images(single, [1.0, 0.1], 20))
    single.close()
    many.close()


def test_a_vector_environment_shows_the_hour_of_the_scenario(gl: str) -> None:
    """At 22:00 in Tiny Town, where the traffic has its headlights on."""
    images = []
    for kind in (DrivingVectorEnv, DrivingEnv):
        task = LaneKeeping(5, map="tiny_town")
        task.scenario = task.scenario.model_copy(update={"time_of_day": 79200.0})
        env = kind(task=task, observation="camera", traffic=4)
        action = [1.0, 0.1]
        images.append(last_images(env, [action] if kind is DrivingVectorEnv else action, 5))
        env.close()
    assert_alike(*images)
    assert images[0].mean() < 60.0  # by day it is about 130


def test_cars_of_a_parallel_environment_see_the_traffic(gl: str) -> None:
    """All start in the same lane; the traffic of one seed stands elsewhere than that of another."""
    cars = DrivingParallelEnv(2, observation="camera", traffic=3)
    first, other = (cars.reset(seed=seed)[0] for seed in (1, 2))
    assert [*first] == ["V1", "V2"]
    assert first["V1"]["image"].shape == (96, 128, 3)
    assert (first["V1"]["image"] != first["V2"]["image"]).mean() > 0.1
    assert (first["V1"]["image"] != other["V1"]["image"]).mean() > 0.01
    cars.close()


def test_each_car_of_a_race_has_its_own_image(gl: str) -> None:
    races = RoboRacerVectorEnv(4, cars=2, tracks=1, observation="camera")
    images = races.reset(seed=1)[0]["image"]
    assert images.shape == (4, 96, 128, 3)
    assert (images[0] != images[1]).mean() > 0.1
    races.close()


def test_cameras_that_cannot_be_drawn_are_refused_in_words() -> None:
    def task(settings: SensorSettings) -> LaneKeeping:
        made = LaneKeeping(5)
        placed = {
            name: place.model_copy(update={"sensors": {"front": settings}})
            for name, place in made.scenario.vehicles.items()
        }
        made.scenario = made.scenario.model_copy(update={"vehicles": placed})
        return made

    for kind in (DrivingEnv, DrivingVectorEnv):
        with pytest.raises(SpecError, match="needs a camera 'front' that is on; vehicle 'V1' has none"):
            kind(task=task(SensorSettings(is_on=False)), observation="camera")
    with pytest.raises(SpecError, match=r"camera 'front' of vehicle 'V1' have noise 'ideal', or use gymnasium\.make"):
        DrivingVectorEnv(task=task(SensorSettings(noise="realistic")), observation="camera")
