"""Episodes of n cars with the same task: what they remember, and their observations as one block of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from autodrive.envs.settings import IMAGE_HEIGHT, IMAGE_WIDTH
from autodrive.envs.task import Bools, CarReadings, Feature, Observation, Outcome, Start, Task

SECTORS = 36
"""Of the observation 'lidar': the shortest range in each 10 degrees."""
RANGE = 12.0
"""No return [m]."""
FAILURE = -1.0
"""Reward of a step in which the physics became unstable."""

SCAN = (
    Feature("scan_age", 0.0, 1.0, "time since the scan [s]"),
    *(
        Feature(f"range_{10 * k}", 0.0, RANGE, f"shortest range near a bearing of {10 * k} degrees, left positive [m]")
        for k in range(SECTORS)
    ),
)
"""Features of the observation 'lidar' after those of the task; 0: too near, 12: no return."""


def observed(task: Task, observation: Observation) -> tuple[Feature, ...]:
    """The numbers of an observation, in order."""
    if observation == "state":
        return task.features
    return task.features[: task.known] + (SCAN if observation == "lidar" else ())


def observation_space(task: Task, observation: Observation) -> spaces.Space[Any]:
    """Of one car."""
    numbers = observed(task, observation)
    low, high = (np.array([getattr(one, limit) for one in numbers], np.float32) for limit in ("low", "high"))
    state = spaces.Box(low, high)
    if observation != "camera":
        return state
    return spaces.Dict({"image": spaces.Box(0, 255, (IMAGE_HEIGHT, IMAGE_WIDTH, 3), np.uint8), "state": state})


class Episodes:
    """The episodes of n cars: `begin` starts some of them, `advance` judges a step of all, `numbers` observes them."""

    def __init__(self, task: Task, observation: Observation, count: int) -> None:
        self._task = task
        self._has_scan = observation == "lidar"
        self._width = len(task.features) if observation == "state" else task.known
        numbers = observed(task, observation)
        self._low, self._high = (np.array([getattr(one, limit) for one in numbers]) for limit in ("low", "high"))
        self._memory = np.zeros((count, task.memory_size))
        self._features = np.zeros((count, len(numbers)))
        self._scan_time = np.full(count, np.nan)
        self._rays: NDArray[np.intp] | None = None
        self._unstable: NDArray[np.intp] | None = None

    def begin(self, rows: NDArray[np.intp], starts: Sequence[Start], cars: CarReadings) -> None:
        """Start the episodes of these cars; `cars` are the readings of all of them at that time."""
        memory = np.array([start.memory for start in starts])
        features = np.zeros((len(rows), self._width))
        self._task.evaluate(cars.rows(rows), memory, features)
        self._memory[rows] = memory
        self._features[rows, : self._width] = features
        self._scan_time[rows] = np.nan
        self._unstable = None
        if self._has_scan:
            self._read_scans(cars)

    def advance(self, cars: CarReadings, is_unstable: Bools | None = None) -> Outcome:
        """Judge a step of all cars. `is_unstable`: whether the physics of a car diverged, which ends its episode."""
        outcome = self._task.evaluate(cars, self._memory, self._features[:, : self._width])
        if self._has_scan:
            self._read_scans(cars)
        self._unstable = None
        if is_unstable is not None and is_unstable.any():
            self._unstable = np.flatnonzero(is_unstable)
            outcome.reward[is_unstable] = FAILURE
            outcome.has_ended[is_unstable] = True
            outcome.is_success[is_unstable] = False
        return outcome

    def numbers(self) -> NDArray[np.float32]:
        """The observations but for images, shape (n, n_number); a new array."""
        values = np.empty(self._features.shape, np.float32)
        np.clip(self._features, self._low, self._high, out=values, casting="unsafe")
        if self._unstable is not None:
            values[self._unstable] = 0.0  # the state may be no number
        return values

    def _read_scans(self, cars: CarReadings) -> None:
        """Scans are rarer than steps: only those that are new are summarised."""
        self._features[:, self._width] = cars.time - cars.lidar_time
        rows = np.flatnonzero(cars.lidar_time != self._scan_time)
        if len(rows):
            if self._rays is None:
                self._rays = _rays_of_sectors(cars.lidar_ranges.shape[1])
            ranges = cars.lidar_ranges[rows]
            self._features[rows, self._width + 1 :] = ranges[:, self._rays].min(axis=2)
            self._scan_time[rows] = cars.lidar_time[rows]


def _rays_of_sectors(count: int) -> NDArray[np.intp]:
    """Numbers of the rays of each sector, shape (SECTORS, rays); sector 0 is around ray 0, straight ahead."""
    each = count // SECTORS
    return (np.arange(SECTORS * each).reshape(SECTORS, each) - each // 2) % count
