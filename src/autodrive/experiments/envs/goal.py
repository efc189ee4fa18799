"""The pose that a car has to reach: features and memory that parking and navigation share."""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import jit
from autodrive.experiments.envs.task import CarReadings, Feature, StepOutcome, heading, turned

GOAL = (
    Feature("goal_x", -8.0, 8.0, "x of the goal in the vehicle frame [m]"),
    Feature("goal_y", -8.0, 8.0, "y of the goal in the vehicle frame [m]"),
    Feature("goal_cos", -1.0, 1.0, "cosine of the angle from the heading of the car to that of the goal"),
    Feature("goal_sin", -1.0, 1.0, "sine of the angle from the heading of the car to that of the goal, left positive"),
)
"""The features after `MOTION`."""


def goal_memory(x: float, y: float, yaw: float) -> tuple[float, ...]:
    """The memory of a goal: x, y [m], cosine and sine of its heading, and a column for what is left to do."""
    return x, y, cos(yaw), sin(yaw), 0.0


def to_goal(cars: CarReadings, memory: Floats) -> dict[str, Floats]:
    """`goal_distance` [m] and `goal_cos`, the cosine of the angle between the headings of car and goal."""
    distance, aligned = np.empty(len(memory)), np.empty(len(memory))
    _write_to_goal(cars, memory, distance, aligned)
    return {"goal_distance": distance, "goal_cos": aligned}


@jit
def _write_to_goal(cars: CarReadings, memory: Floats, distance: Floats, aligned: Floats) -> None:
    for i in range(len(memory)):
        c, s = heading(cars, i)
        x, y = memory[i, 0] - cars.position[i, 0], memory[i, 1] - cars.position[i, 1]
        distance[i] = math.sqrt(x * x + y * y)
        aligned[i], _ = turned(memory[i, 2], memory[i, 3], c, s)


@jit
def write_goal(cars: CarReadings, i: int, memory: Floats, features: Floats) -> tuple[float, float]:
    """Write the features of `GOAL`; the distance to the goal [m] and the cosine of the angle between the headings."""
    c, s = heading(cars, i)
    x, y = memory[i, 0] - cars.position[i, 0], memory[i, 1] - cars.position[i, 1]
    features[i, 3], features[i, 4] = turned(x, y, c, s)
    features[i, 5], features[i, 6] = turned(memory[i, 2], memory[i, 3], c, s)
    return math.sqrt(x * x + y * y), features[i, 5]


@jit
def write_outcome(outcome: StepOutcome, i: int, progress: float, is_success: bool, has_failed: bool) -> None:
    """The reward is the progress [m], +1 for success, -1 for a failure; both end the episode."""
    outcome.is_success[i] = is_success and not has_failed
    outcome.has_ended[i] = is_success or has_failed
    outcome.reward[i] = progress + (-1.0 if has_failed else 1.0 if is_success else 0.0)
