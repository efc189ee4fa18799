"""Navigation: drive to a goal among boxes, which the LIDAR sees.

- Start: a square of 5 m x 5 m with cells of 1 m. The car starts at rest in a cell of the first column, with any
  heading. Eight boxes of 0.4 m x 0.4 m stand in 8 of the 15 cells of the next three columns, up to 0.15 m from the
  middle of their cell, with any heading. The goal is the middle of a cell of the last column, with a heading up to
  45 degrees from the x axis.
- Reward of a step: how much the distance to the goal has decreased [m]; +1 for success, -1 if the episode ends
  otherwise.
- Success and end: within 0.2 m of the goal and 45 degrees of its heading.
- End without success: a collision, or more than 7 m from the goal.
"""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.jit import jit
from autodrive.experiments.envs.goal import GOAL, goal_memory, to_goal, write_goal, write_outcome
from autodrive.experiments.envs.task import (
    MOTION,
    CarReadings,
    Feature,
    Start,
    StepOutcome,
    Task,
    heading,
    turned,
    write_motion,
)
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement

CELLS = 5
"""Cells along each side of the square."""
BOXES, BOX_SIZE, BOX_MASS, JITTER = 8, (0.4, 0.4, 0.25), 0.5, 0.15
"""Number, size [m] and mass [kg] of the boxes, and greatest distance from the middle of a cell [m].

They are higher than the plane of the scan."""
NEAR, ALIGNED = 0.2, math.sqrt(0.5)
"""Limits of success: greatest distance to the goal [m], least cosine of the angle between the headings."""
FAR = 7.0
"""Greatest distance to the goal [m]; beyond it the episode fails."""
PLACES = [(float(column - CELLS // 2), float(row - CELLS // 2)) for column in range(1, 4) for row in range(CELLS)]
"""Middles of the cells for boxes [m]."""
KNOWN = len(MOTION) + len(GOAL)
NAMES = [f"box_{k + 1}" for k in range(BOXES)]


class Navigation(Task):
    """The task of reaching a goal between boxes, which the text of the module describes."""

    name = "navigation"
    features = (
        *MOTION,
        *GOAL,
        *(
            Feature(f"{name}_{axis}", -8.0, 8.0, f"{axis} of {name} in the vehicle frame [m]")
            for name in NAMES
            for axis in "xy"
        ),
    )
    known = KNOWN
    observation = "lidar"
    memory_size = 5

    def __init__(self, frame_skip: int) -> None:
        boxes = {
            name: BoxSpec(x=x, y=y, size=BOX_SIZE, mass=BOX_MASS) for name, (x, y) in zip(NAMES, PLACES, strict=False)
        }
        self.scenario = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(x=-float(CELLS // 2))}, boxes=boxes)

    def start(self, rng: np.random.Generator) -> Start:
        """Car, boxes and goal."""
        rows = rng.integers(CELLS, size=2).tolist()
        cells = rng.permutation(len(PLACES))[:BOXES].tolist()
        numbers = (2.0 * rng.random(2 + 3 * BOXES) - 1.0).tolist()
        edge, middle = float(CELLS // 2), CELLS // 2
        poses = {"V1": (-edge, float(rows[0] - middle), math.pi * numbers[0])}
        for k, (name, cell) in enumerate(zip(NAMES, cells, strict=True)):
            x, y = PLACES[cell]
            dx, dy, turn = numbers[2 + 3 * k : 5 + 3 * k]
            poses[name] = (x + JITTER * dx, y + JITTER * dy, math.pi * turn)
        return Start(poses, goal_memory(edge, float(rows[1] - middle), 0.25 * math.pi * numbers[1]))

    def measures(self, cars: CarReadings, memory: Floats) -> dict[str, Floats]:
        """`goal_distance` and `goal_cos` of each car; see `Task.measures` and `goal.to_goal`."""
        return to_goal(cars, memory)

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`."""
        _judge(cars, memory, features, outcome)


@jit
def _judge(cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
    for i in range(len(memory)):
        write_motion(cars, i, features)
        away, aligned = write_goal(cars, i, memory, features)
        has_failed = cars.collision_count[i] > 0 or away > FAR
        write_outcome(outcome, i, memory[i, 4] - away, away < NEAR and aligned > ALIGNED, has_failed)
        memory[i, 4] = away
        if features.shape[1] > KNOWN:
            c, s = heading(cars, i)
            for k in range(BOXES):
                x, y = cars.objects[i, k, 0] - cars.position[i, 0], cars.objects[i, k, 1] - cars.position[i, 1]
                features[i, KNOWN + 2 * k], features[i, KNOWN + 2 * k + 1] = turned(x, y, c, s)
