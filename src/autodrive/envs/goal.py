"""The pose that a car has to reach: features and memory that parking and navigation share."""

from __future__ import annotations

import math

from autodrive.arrays import Floats
from autodrive.envs.task import MOTION, CarReadings, Feature, distance, heading, turned

GOAL = (
    Feature("goal_x", -8.0, 8.0, "x of the goal in the vehicle frame [m]"),
    Feature("goal_y", -8.0, 8.0, "y of the goal in the vehicle frame [m]"),
    Feature("goal_cos", -1.0, 1.0, "cosine of the angle from the heading of the car to that of the goal"),
    Feature("goal_sin", -1.0, 1.0, "sine of that angle, left positive"),
)
"""The features after `MOTION`."""


def goal_memory(x: float, y: float, yaw: float) -> tuple[float, ...]:
    """The memory of a goal: x, y [m], cosine and sine of its heading, and a column for what is left to do."""
    return x, y, math.cos(yaw), math.sin(yaw), 0.0


def write_goal(cars: CarReadings, memory: Floats, features: Floats) -> tuple[Floats, Floats]:
    """Write the features of `GOAL`; the distance to the goal [m] and the cosine of the angle between the headings."""
    c, s = heading(cars.orientation)
    x, y = memory[:, 0] - cars.position[:, 0], memory[:, 1] - cars.position[:, 1]
    ahead, left = turned(x, y, c, s)
    aligned, turn = turned(memory[:, 2], memory[:, 3], c, s)
    for i, values in enumerate((ahead, left, aligned, turn), len(MOTION)):
        features[:, i] = values
    return distance(x, y), aligned
