"""The environments of races: 2 to 8 cars RoboRacer in each world, which end one by one or when one has won."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.experiments.envs.driving_vector_env import of_one_world
from autodrive.experiments.envs.roboracer_env import RoboRacerVectorEnv
from autodrive.experiments.envs.settings import checked_cars
from autodrive.experiments.envs.several_cars import SeveralCarsParallelEnv, SeveralCarsVectorEnv
from autodrive.experiments.envs.task import CarReadings, Observation, StepOutcome
from autodrive.experiments.envs.time_trial import DRIVEN, TimeTrial


class RaceTask(TimeTrial):
    """The time trial against others: the first car that has driven all laps has won, and ends the race for all."""

    name = "race"

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`. The cars of a world follow each other."""
        super().evaluate(cars, memory, features, outcome)
        has_won = outcome.is_success & ~outcome.has_ended & (self.ranks(memory) == 1)
        outcome.is_success[:] = has_won
        count = len(self.scenario.vehicles)
        outcome.has_ended[:] |= np.repeat(has_won.reshape(-1, count).any(axis=1), count)

    def ranks(self, memory: Floats) -> NDArray[np.int64]:
        """Places of the cars in their race, from 1, shape (n,)."""
        driven = memory[:, DRIVEN].reshape(-1, len(self.scenario.vehicles))
        order = np.argsort(-driven, axis=1, kind="stable")
        return np.argsort(order, axis=1, kind="stable").ravel() + 1


class RaceVectorEnv(SeveralCarsVectorEnv, RoboRacerVectorEnv):
    """Many races, with the settings of `RoboRacerVectorEnv`; a car that collides is an obstacle for the others."""

    task_type = RaceTask
    task: RaceTask

    def _values(self, outcome: StepOutcome) -> dict[str, NDArray[Any]]:
        return {
            **super()._values(outcome),
            "rank": self.task.ranks(self._episodes.memory),
            "distance": self.distance,
        }


class RaceParallelEnv(SeveralCarsParallelEnv):
    """A race of `laps` laps from a grid; observations, rewards and ends are those of `envs.time_trial`.

    Agents are 'V1', 'V2', ... The race ends for all of them when the first one has driven all laps; it has
    `info["is_success"]`. A car that collides is no longer in `agents`; it brakes and is an obstacle. `info["rank"]` is
    the place in the race, from 1; `info["distance"]` is the distance since the start line [m].
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "name": "roboracer_race_v0",
        "render_modes": [],
        "is_parallelizable": True,
    }
    vector: RaceVectorEnv

    def __init__(
        self,
        cars: int = 4,
        *,
        laps: int = 2,
        max_episode_steps: int | None = 4800,
        observation: Observation = "lidar",
        **settings: Any,
    ) -> None:
        """`settings`: of `RoboRacerVectorEnv`. Raises `SpecError` for wrong settings."""
        if observation == "camera":
            raise SpecError(["observation: a race has no images. Known: state, lidar"])
        settings |= {"laps": laps, "max_episode_steps": max_episode_steps, "observation": observation}
        count = checked_cars(cars)
        super().__init__(of_one_world(self, RaceVectorEnv, count, cars=count, **settings))

    @property
    def distance(self) -> Floats:
        """Distance of all cars along the centre line since the start line [m], shape (cars,)."""
        return self.vector.distance
