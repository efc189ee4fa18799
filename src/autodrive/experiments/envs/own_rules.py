"""Rewards and ends of the user: functions of what n cars did in a step, for one environment and for many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.base.suggest import suggest
from autodrive.experiments.envs.task import Bools, CarReadings, StepOutcome, Task


@dataclass(frozen=True)
class Step:
    """What n cars did in the last step, and what the task thinks of it.

    It also has the measures of the task as attributes, shape (n,) each: see `Task.measures`. Of a distance `distance`,
    `progress` is the part of the last step [m]. The arrays may change with the next step.
    """

    cars: CarReadings
    """All readings at the end of the step."""
    actions: Floats
    """Throttle and steering of the step, each from -1 to 1, left positive, shape (n, 2)."""
    last_actions: Floats
    """Actions of the step before, shape (n, 2); zeros in the first step of an episode."""
    steps: Integers
    """Number of the step in its episode, from 1, shape (n,)."""
    task_reward: Floats
    """Reward of the task, shape (n,)."""
    has_ended: Bools
    """Whether the task ends the episode, shape (n,)."""
    is_success: Bools
    """Whether the task is accomplished, shape (n,)."""
    measures: dict[str, Floats] = field(repr=False)
    """Measures of the task by name, shape (n,) each."""

    @property
    def speed(self) -> Floats:
        """Forward speed [m/s], shape (n,)."""
        return self.cars.velocity[:, 0]

    @property
    def has_collided(self) -> Bools:
        """Whether the car has touched anything in this episode, shape (n,)."""
        return self.cars.collision_count > 0

    @property
    def is_off_road(self) -> Bools:
        """Whether a wheel is outside the drivable area of the map, shape (n,)."""
        return self.cars.is_off_road

    def __getattr__(self, name: str) -> Floats:
        """A measure of the task."""
        measures: dict[str, Floats] = self.__dict__.get("measures", {})
        if name in measures:
            return measures[name]
        own = [*self.__dataclass_fields__, "speed", "has_collided", "is_off_road"]
        raise AttributeError(f"a step of this task has no {name!r}. {suggest(name, [*measures, *own])}")


Reward: TypeAlias = Callable[[Step], Any]
"""Returns the reward of each car, numbers of the shape (n,)."""
End: TypeAlias = Callable[[Step], Any]
"""Returns whether the episode of each car ends, bools of the shape (n,)."""


class OwnRules:
    """Replaces reward and ends of a task by those of the user; None keeps that of the task."""

    def __init__(self, task: Task, count: int, reward: Reward | None, end: End | None) -> None:
        """`count`: number of cars. Raises `SpecError` for what cannot be called."""
        errors = [
            f"{name}: must be a function of a Step, not {function!r}"
            for name, function in (("reward", reward), ("end", end))
            if not (function is None or callable(function))
        ]
        if errors:
            raise SpecError(errors)
        self._task, self._reward, self._end = task, reward, end
        self._steps = np.zeros(count, np.int64)
        self._actions = np.zeros((count, 2))
        self._distance = np.zeros(count)

    def begin(self, rows: NDArray[np.intp], cars: CarReadings, memory: Floats) -> None:
        """Start the episodes of these cars, whose readings and memory these are."""
        self._steps[rows] = 0
        self._actions[rows] = 0.0
        self._distance[rows] = self._task.measures(cars, memory).get("distance", 0.0)

    def judge(
        self, cars: CarReadings, memory: Floats, actions: Floats, outcome: StepOutcome, is_unstable: Bools
    ) -> None:
        """Replace rewards and ends of a step. Raises `SpecError` for what is no reward and no end.

        The rewards of cars whose physics diverged mean nothing.
        """
        self._steps += 1
        actions = np.clip(actions, -1.0, 1.0)
        measures = self._task.measures(cars, memory)
        if "distance" in measures:
            measures["progress"] = measures["distance"] - self._distance
            self._distance = measures["distance"].copy()
        step = Step(
            cars,
            actions,
            last_actions=self._actions,
            steps=self._steps.copy(),
            task_reward=outcome.reward.copy(),
            has_ended=outcome.has_ended.copy(),
            is_success=outcome.is_success.copy(),
            measures=measures,
        )
        if self._reward is not None:
            outcome.reward[:] = _rewards(self._reward(step), is_unstable)
        if self._end is not None:
            outcome.has_ended[:] = _checked("end", self._end(step), "b", "True or False", len(is_unstable))
        self._actions = actions.copy()  # `begin` writes it


def _rewards(returned: Any, is_unstable: Bools) -> NDArray[Any]:
    rewards = _checked("reward", returned, "fiub", "a number", len(is_unstable))
    wrong = np.flatnonzero(~np.isfinite(rewards) & ~is_unstable)
    if len(wrong):
        raise SpecError([f"reward: must be finite, but that of environment {wrong[0]} is {rewards[wrong[0]]}"])
    return rewards


def _checked(name: str, returned: Any, kinds: str, expected: str, count: int) -> NDArray[Any]:
    """The array that a function has returned."""
    try:
        values = np.asarray(returned)
    except ValueError:  # rows of different lengths
        values = np.empty(0, object)
    if values.shape != (count,) or values.dtype.kind not in kinds:
        actual = f"{values.dtype} of the shape {values.shape}" if values.dtype != object else repr(returned)
        raise SpecError(
            [f"{name}: must return {expected} for each car, an array of the shape ({count},), not {actual}"]
        )
    return values
