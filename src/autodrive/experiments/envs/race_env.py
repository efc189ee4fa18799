"""The PettingZoo environment of a race: 2 to 8 cars RoboRacer on a random track, in one world of a batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.suggest import with_suggestions
from autodrive.experiments.envs.conditions import Conditions, Drive, Range
from autodrive.experiments.envs.parallel_env import Cars, checked_cars
from autodrive.experiments.envs.settings import Action, Settings
from autodrive.experiments.envs.task import Bools, CarReadings, Observation, Outcome, Start
from autodrive.experiments.envs.time_trial import DRIVEN, TimeTrial
from autodrive.world.batch import BatchWorld

WORLD = np.zeros(1, np.intp)


class RaceParallelEnv(Cars):
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

    @with_suggestions
    def __init__(
        self,
        cars: int = 4,
        *,
        laps: int = 2,
        tracks: int = 3,
        track_seed: int = 0,
        friction: Range = 1.0,
        mass: Range = 1.0,
        noise: Range = 0.0,
        latency: Range = 0.0,
        fog: Range = 0.0,
        rain: Range = 0.0,
        snow: Range = 0.0,
        max_episode_steps: int | None = 4800,
        observation: Observation = "lidar",
        action: Action = "continuous",
        frame_skip: int = 5,
    ) -> None:
        """`friction`, `mass`, `noise`, `latency`, of each car, and `fog`, `rain`, `snow`: see `Conditions`.

        Raises `SpecError` for wrong settings.
        """
        if observation == "camera":
            raise SpecError(["observation: a race has no images. Known: state, lidar"])
        self.conditions = Conditions(friction, mass, noise, latency, fog, rain, snow)
        settings = Settings(TimeTrial.name, observation, action, frame_skip)
        super().__init__(
            TimeTrial(frame_skip, tracks, track_seed, checked_cars(cars), laps), settings, max_episode_steps
        )
        self.batch = BatchWorld(self.task.scenario, 1, threads=1)
        """Its only world is that of the race."""
        self._driver = Drive(self.batch, frame_skip)

    @property
    def distance(self) -> Floats:
        """Of all cars since the start line, along the centre line [m], shape (cars,)."""
        return self._episodes.memory[:, DRIVEN].copy()

    def close(self) -> None:
        """End the threads of the batch."""
        self.batch.close()

    def _start(self, seed: int, starts: Sequence[Start], rng: np.random.Generator) -> CarReadings:
        poses = {name: np.array(pose) for start in starts for name, pose in start.poses.items()}
        drawn = np.array([self.conditions.draw(rng) for _ in self.possible_agents])
        friction, mass, noise, latency = drawn.T[:, None]
        weather = self.conditions.draw_weather(rng)
        self.batch.reset(WORLD, [seed], poses=poses, grip=friction, mass=mass, noise=noise, weather=weather)
        self._driver.reset(WORLD, latency)
        return CarReadings.of_batch(self.batch.readings, len(self.possible_agents))

    def _drive(self, commands: NDArray[np.float64]) -> tuple[CarReadings, Bools]:
        self._driver.step(commands[None])
        readings = self.batch.readings
        return CarReadings.of_batch(readings, len(commands)), np.full(len(commands), readings.is_unstable[0])

    def _judged(self, outcome: Outcome) -> tuple[Bools, list[dict[str, Any]]]:
        driven = self.distance
        rank = np.empty(len(driven), np.int64)
        rank[np.argsort(-driven, kind="stable")] = np.arange(1, len(driven) + 1)
        has_won = outcome.is_success & ~outcome.has_ended & (rank == 1)
        columns = zip(has_won.tolist(), rank.tolist(), driven.tolist(), strict=True)
        return outcome.has_ended | has_won.any(), [
            dict(zip(("is_success", "rank", "distance"), row, strict=True)) for row in columns
        ]
