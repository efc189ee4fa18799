"""Parking: drive forward into a bay of the parking lot of Tiny Town and stop there.

- Start: at rest in the aisle of the lot, up to 0.05 m beside its centre line, in a part of 0.5 m of it, up to 0.3 rad
  off its direction. The bay is one of ten.
- Reward of a step: how much D has decreased in the step [m], with D = d + 0.2 m (1 - cos a), the distance d to the goal
  [m] and the angle a between the headings of car and goal; +1 for success, -1 if the episode ends otherwise.
- Success and end: d < 0.05 m, |a| < 10 degrees and slower than 0.05 m/s.
- End without success: a collision, or d > 3 m.
"""

from __future__ import annotations

import math

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import jit
from autodrive.experiments.envs.goal import GOAL, goal_memory, to_goal, write_goal, write_outcome
from autodrive.experiments.envs.task import MOTION, CarReadings, Start, StepOutcome, Task, uniform, write_motion
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.vehicles.spec import load_vehicle

MAP, LOT = "tiny_town", "parking_lot"
AISLE = (2.2, 3.1, 0.5 * math.pi)
"""The middle of the starts: x, y [m] and yaw [rad]."""
SPREAD = (0.05, 0.25, 0.3)
"""Largest distances of a start from the middle of the starts [m, m, rad]."""
TURN_WEIGHT = 0.2
"""Weight of 1 - cosine of the angle between the headings in what is left to do [m]."""
NEAR, ALIGNED, SLOW = 0.05, cos(math.radians(10.0)), 0.05
"""Limits of success: greatest distance [m], least cosine of the angle between the headings, greatest speed [m/s]."""
FAR = 3.0
"""Greatest distance to the goal [m]; beyond it the episode fails."""


class Parking(Task):
    """The task of parking in a bay, which the text of the module describes."""

    name = "parking"
    features = (*MOTION, *GOAL)
    known = len(MOTION) + len(GOAL)
    observation = "state"
    memory_size = 5

    def __init__(self, frame_skip: int) -> None:
        x, y, yaw = AISLE
        self.scenario = ScenarioSpec(map=MAP, vehicles={"V1": VehiclePlacement(x=x, y=y, yaw_deg=math.degrees(yaw))})
        bays = [bay.pose for bay in load_map(MAP).bays if bay.name.startswith(LOT)]
        behind = 0.5 * load_vehicle(self.scenario.vehicles["V1"].type).wheelbase
        self.goals = [(x - behind * cos(yaw), y - behind * sin(yaw), yaw) for x, y, yaw in bays]
        """Poses of the centre of the rear axle in each bay [m, m, rad]."""

    def start(self, rng: np.random.Generator) -> Start:
        """A place in the aisle, and a bay."""
        goal = self.goals[int(rng.integers(len(self.goals)))]
        x, y, yaw = (middle + by for middle, by in zip(AISLE, uniform(rng, SPREAD), strict=True))
        return Start({"V1": (x, y, yaw)}, goal_memory(*goal))

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
        left = away + TURN_WEIGHT * (1.0 - aligned)
        is_success = away < NEAR and aligned > ALIGNED and abs(cars.velocity[i, 0]) < SLOW
        has_failed = cars.collision_count[i] > 0 or away > FAR
        write_outcome(outcome, i, memory[i, 4] - left, is_success, has_failed)
        memory[i, 4] = left
