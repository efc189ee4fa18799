"""Episodes of n cars with the same task: what they remember, and their observations as one block of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit
from autodrive.experiments.envs.own_rules import End, OwnRules, Reward
from autodrive.experiments.envs.settings import IMAGE_HEIGHT, IMAGE_WIDTH
from autodrive.experiments.envs.task import Bools, CarReadings, Feature, Observation, ScanView, Start, StepOutcome, Task

FAILURE = -1.0
"""Reward of a step in which the physics became unstable."""


def scan_features(scan: ScanView) -> tuple[Feature, ...]:
    """Features of the observation 'lidar' after those of the task; a range is 0: too near, the greatest: no return."""
    return (
        Feature("scan_age", 0.0, 1.0, "time since the scan [s]"),
        *(
            Feature(
                f"range_{bearing:g}",
                0.0,
                scan.range_max,
                f"shortest range near a bearing of {bearing:g} degrees, left positive [m]",
            )
            for bearing in scan.bearings
        ),
    )


def observed(task: Task, observation: Observation) -> tuple[Feature, ...]:
    """The numbers of an observation, in order."""
    if observation == "state":
        return task.features
    return task.features[: task.known] + (scan_features(task.scan) if observation == "lidar" else ())


def observation_space(task: Task, observation: Observation) -> spaces.Space[Any]:
    """The space of the observations of one car."""
    numbers = observed(task, observation)
    low, high = (np.array([getattr(feature, limit) for feature in numbers], np.float32) for limit in ("low", "high"))
    state = spaces.Box(low, high)
    if observation != "camera":
        return state
    return spaces.Dict({"image": spaces.Box(0, 255, (IMAGE_HEIGHT, IMAGE_WIDTH, 3), np.uint8), "state": state})


class Episodes:
    """The episodes of n cars: `begin` starts some of them, `advance` judges a step of all, `numbers` observes them."""

    def __init__(
        self,
        task: Task,
        observation: Observation,
        count: int,
        offence_cost: float = 0.0,
        reward: Reward | None = None,
        end: End | None = None,
    ) -> None:
        """`offence_cost`: see `Settings`. `reward`, `end`: instead of those of the task. Raises `SpecError`."""
        self._task, self._offence_cost = task, offence_cost
        self._own = None if reward is end is None else OwnRules(task, count, reward, end)
        self._offences = np.zeros(count, np.int64)
        """Offences of each car up to the step before the last one, shape (n,)."""
        self._has_scan = observation == "lidar"
        numbers = observed(task, observation)
        written = task.features if observation == "state" else task.features[: task.known]
        self._low, self._high = (
            np.array([getattr(feature, limit) for feature in written]) for limit in ("low", "high")
        )
        self.memory = np.zeros((count, task.memory_size))
        """What the task remembers of each episode and writes in each step, shape (n, memory_size)."""
        self._features = np.zeros((count, len(written)))
        self._numbers = np.zeros((count, len(numbers)), np.float32)
        self._scan_time = np.full(count, np.nan)
        self._is_unstable = np.zeros(count, np.bool_)

    def begin(self, rows: NDArray[np.intp], starts: Sequence[Start], cars: CarReadings) -> None:
        """Start the episodes of these cars; `cars` are the readings of all of them at that time."""
        memory = np.array([start.memory for start in starts])
        features = np.zeros((len(rows), self._features.shape[1]))
        self._task.evaluate(cars.rows(rows), memory, features, new_outcome(len(rows)))
        self.memory[rows] = memory
        self._offences[rows] = 0
        self._features[rows] = features
        self._is_unstable[rows] = False
        self._scan_time[rows] = np.nan
        if self._own is not None:
            self._own.begin(rows, cars.rows(rows), memory)
        self._read_scans(cars)

    def advance(
        self, cars: CarReadings, is_unstable: Bools | None = None, actions: Floats | None = None
    ) -> StepOutcome:
        """Judge a step of all cars. `is_unstable`: whether the physics of a car diverged, which ends its episode.

        `actions`: throttle and steering, shape (n, 2), for own rewards. Raises `SpecError` for a wrong one.
        """
        count = len(self.memory)
        outcome = new_outcome(count)
        self._task.evaluate(cars, self.memory, self._features, outcome)
        if self._own is not None:
            commands = np.zeros((count, 2)) if actions is None else np.asarray(actions, np.float64)
            unknown = np.zeros(count, np.bool_) if is_unstable is None else is_unstable
            self._own.judge(cars, self.memory, commands, outcome, unknown)
        self._read_scans(cars)
        if is_unstable is not None and is_unstable.any():
            self._is_unstable[:] = is_unstable
            outcome.reward[is_unstable] = FAILURE
            outcome.has_ended[is_unstable] = True
            outcome.is_success[is_unstable] = False
        if self._offence_cost:
            offences = cars.offences.sum(axis=1)
            outcome.reward[:] -= self._offence_cost * (offences - self._offences)
            self._offences = offences
        return outcome

    def numbers(self) -> NDArray[np.float32]:
        """The observations but for images, shape (n, n_number); a new array. Zeros if the physics diverged."""
        _write_numbers(self._features, self._low, self._high, self._is_unstable, self._numbers)
        return self._numbers.copy()

    def _read_scans(self, cars: CarReadings) -> None:
        if self._has_scan:
            scan = self._task.scan
            numbers = self._numbers[:, -1 - scan.sectors :]
            _write_scans(cars, self._scan_time, numbers, scan.sectors, scan.range_max, scan.is_circle)


def new_outcome(count: int) -> StepOutcome:
    """The outcome of a step of that number of cars, not yet written."""
    return StepOutcome(np.empty(count), np.empty(count, np.bool_), np.empty(count, np.bool_))


@jit
def _write_numbers(
    features: Floats, low: Floats, high: Floats, is_unstable: Bools, numbers: NDArray[np.float32]
) -> None:
    """Write the features within their limits."""
    for i in range(features.shape[0]):
        if is_unstable[i]:
            numbers[i] = 0.0
        else:
            for k in range(features.shape[1]):
                numbers[i, k] = min(max(features[i, k], low[k]), high[k])


@jit
def _write_scans(
    cars: CarReadings,
    scan_time: Floats,
    numbers: NDArray[np.float32],
    sectors: int,
    range_max: float,
    is_circle: bool,
) -> None:
    """Write the numbers of `scan_features`. Scans may be rarer than steps: only those that are new are read."""
    for i in range(len(scan_time)):
        numbers[i, 0] = cars.time[i] - cars.lidar_time[i]
        if cars.lidar_time[i] != scan_time[i]:
            scan_time[i] = cars.lidar_time[i]
            ranges = cars.lidar_ranges[i]
            each = len(ranges) // sectors
            first = each // 2 if is_circle else 0
            for sector in range(sectors):
                shortest = range_max
                for ray in range(sector * each - first, sector * each - first + each):
                    shortest = min(shortest, ranges[ray])  # rays before ray 0 are the last ones
                numbers[i, 1 + sector] = max(shortest, 0.0)
