"""Lane keeping: follow a lane around Tiny Town, without leaving it or touching anything.

- Start: at rest, anywhere on the lane, up to 0.05 m beside its centre line and up to 0.2 rad off its direction.
- Reward of a step: s (1 - |d| / w) with the distance s along the centre line in the step [m], the distance d of the
  centre of the rear axle from the centre line [m] and half the width of the lane, w = 0.15 m; -1 if the episode ends.
- End: |d| > w, more than 90 degrees off the direction of the lane, or a collision.
- Success: a whole lap of 18.5 m; the episode continues.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import shapely

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import atan2, cos, sin
from autodrive.base.errors import SpecError
from autodrive.base.jit import jit
from autodrive.experiments.envs.path import DRIVEN, PLACE, beside, follow, line_features, look_ahead, table
from autodrive.experiments.envs.task import (
    MOTION,
    CarReadings,
    Start,
    StepOutcome,
    Task,
    uniform,
    wrapped,
    write_motion,
)
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import Map, load_map

MAP = "tiny_town"
HALF_WIDTH = 0.15
"""Half the width of the lane [m]."""
SPACING = 0.02
"""Distance between the points of the centre line [m], about."""
PREVIEW = (0.2, 0.4, 0.8)
"""Distances along the lane of the points ahead that are observed [m]."""
TOP_SPEED = 0.6
"""A car is not faster [m/s]."""
START_OFFSET, START_ANGLE = 0.05, 0.2
"""Largest distance from the centre line and largest angle from its direction at the start [m], [rad]."""
AHEAD, ROOM = 0.07, 0.2
"""Start on a map of the user: the middle of the car is `AHEAD` of the rear axle, and `ROOM` from any obstacle [m]."""
FAILURE = -1.0
"""Reward of a step that ends an episode."""

KNOWN = len(MOTION)


class CentreLine:
    """The longest loop of lanes of a map, as points at equal distances. Raises `SpecError` if there is none."""

    def __init__(self, map_: str) -> None:
        lane_map = load_map(map_)
        lanes = lane_map.lane_graph
        if lane_map.track is not None:
            raise SpecError([f"map: '{map_}' is a race track: RoboRacer-v0 drives on it, with track={map_!r}"])
        if not lanes.loops():
            raise SpecError([f"map: '{map_}' has no closed way of lanes. Close its roads, or write a task of your own"])
        points = lanes.path(lanes.loops()[-1])
        along = np.concatenate([[0.0], np.cumsum(np.sqrt(np.sum(np.diff(points, axis=0) ** 2, axis=1)))])
        self.length = float(along[-1])
        """Length of the line [m]."""
        self.count = round(self.length / SPACING)
        self.spacing = self.length / self.count
        """Distance between two points [m]."""
        self.table = table(along, points, self.count)
        """x, y [m], cosine and sine of the direction at each point, shape (count, 4); see `path.table`."""
        self.free = np.arange(self.count) if map_ == MAP else self._free(lane_map)
        """Numbers of the points where a car may start."""
        if len(self.free) == 0:
            raise SpecError([f"map: '{map_}' has no place on its lanes where a car fits between the obstacles"])

    def _free(self, map_: Map) -> Integers:
        """Numbers of the points around which nothing stands."""
        solids = shapely.unary_union([solid.plan for solid in (*map_.statics, *map_.boxes)])
        middles = self.table[:, :2] + AHEAD * self.table[:, 2:]
        is_near = shapely.distance(shapely.points(middles), solids) <= ROOM  # False for NaN: the map has no obstacles
        return np.flatnonzero(~is_near)

    def pose(self, place: int) -> tuple[float, float, float]:
        """x, y [m] and yaw [rad] of a point."""
        x, y, c, s = self.table[place].tolist()
        return x, y, atan2(s, c)


class LaneKeeping(Task):
    """The task of keeping a lane, which the text of the module describes."""

    name = "lane_keeping"
    features = (
        *MOTION,
        *line_features(PREVIEW, "lane", 2.0, most_offset=1.0),
    )
    known = KNOWN
    observation = "state"
    memory_size = 3

    def __init__(self, frame_skip: int, cars: int = 1, map: str | Path = MAP) -> None:
        """`map`: name or file of one with a closed way of lanes. Raises `SpecError`."""
        self.line = line = CentreLine(str(map))
        starts = [line.pose(int(line.free[k * len(line.free) // cars])) for k in range(cars)]
        self.scenario = ScenarioSpec(
            map=str(map),
            vehicles={
                f"V{k + 1}": VehiclePlacement(x=x, y=y, yaw_deg=math.degrees(yaw))
                for k, (x, y, yaw) in enumerate(starts)
            },
        )
        self._preview = np.array([round(distance / line.spacing) for distance in PREVIEW])
        self._reach = math.ceil(TOP_SPEED * self.scenario.tick * frame_skip / line.spacing) + 2

    def start(self, rng: np.random.Generator) -> Start:
        """A place on the lane."""
        return self.starts(rng)[0]

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """A place on the lane for each car, at about equal distances."""
        names = list(self.scenario.vehicles)
        free = self.line.free
        first = int(rng.integers(len(free)))
        starts = []
        for k, name in enumerate(names):
            place = int(free[(first + k * len(free) // len(names)) % len(free)])
            x, y, yaw = self.line.pose(place)
            aside, turn = uniform(rng, (START_OFFSET, START_ANGLE))
            x, y = x - aside * sin(yaw), y + aside * cos(yaw)
            starts.append(Start({name: (x, y, wrapped(yaw + turn))}, (float(place), 0.0, 0.0)))
        return starts

    def measures(self, cars: CarReadings, memory: Floats) -> dict[str, Floats]:
        """`distance`, `offset` and `angle` of each car; see `Task.measures` and `path.beside`."""
        return {
            "distance": memory[:, DRIVEN].copy(),
            **beside(cars, self.line.table[memory[:, PLACE].astype(np.int64)]),
        }

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats, outcome: StepOutcome) -> None:
        """Judge the last step; see `Task.evaluate`.

        The nearest point is sought around the last one, so that crossings do not matter.
        """
        line = self.line
        _judge(cars, line.table, line.spacing, line.length, self._reach, self._preview, memory, features, outcome)


@jit
def _judge(
    cars: CarReadings,
    line: Floats,
    spacing: float,
    length: float,
    reach: int,
    preview: Integers,
    memory: Floats,
    features: Floats,
    outcome: StepOutcome,
) -> None:
    """`line`: see `CentreLine.table`."""
    count = len(line)
    for i in range(len(memory)):
        progress, offset, direction_cos, direction_sin = follow(cars, i, line, count, spacing, reach, memory[i])
        write_motion(cars, i, features)
        if features.shape[1] > KNOWN:
            features[i, 3], features[i, 4], features[i, 5] = offset, direction_cos, direction_sin
            look_ahead(cars, i, line, count, int(memory[i, PLACE]), preview, features[i, 6:])
        has_ended = abs(offset) > HALF_WIDTH or direction_cos < 0.0 or cars.collision_count[i] > 0
        outcome.has_ended[i] = has_ended
        outcome.reward[i] = FAILURE if has_ended else progress * (1.0 - abs(offset) / HALF_WIDTH)
        outcome.is_success[i] = memory[i, DRIVEN] >= length
