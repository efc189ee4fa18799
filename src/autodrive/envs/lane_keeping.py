"""Lane keeping: follow a lane around Tiny Town, without leaving it or touching anything.

- Start: at rest, anywhere on the lane, up to 0.05 m beside its centre line and up to 0.2 rad off its direction.
- Reward of a step: s (1 - |d| / w) with the distance s along the centre line in the step [m], the distance d of the
  centre of the rear axle from the centre line [m] and half the width of the lane, w = 0.15 m; -1 if the episode ends.
- End: |d| > w, more than 90 degrees off the direction of the lane, or a collision.
- Success: a whole lap of 18.5 m; the episode goes on.
"""

from __future__ import annotations

import math

import numpy as np

from autodrive.arrays import Floats
from autodrive.envs.task import (
    MOTION,
    CarReadings,
    Feature,
    Outcome,
    Start,
    Task,
    heading,
    turned,
    uniform,
    wrapped,
    write_motion,
)
from autodrive.maps.map import load_map
from autodrive.scenario import ScenarioSpec, VehiclePlacement

MAP = "tiny_town"
HALF_WIDTH = 0.15
"""Of the lane [m]."""
SPACING = 0.02
"""Of the points of the centre line [m], about."""
PREVIEW = (0.2, 0.4, 0.8)
"""Distances along the lane of the points ahead that are observed [m]."""
TOP_SPEED = 0.6
"""A car is not faster [m/s]."""
START_OFFSET, START_ANGLE = 0.05, 0.2
"""Largest of a start [m], [rad]."""
FAILURE = -1.0
"""Reward of a step that ends an episode."""

PLACE, BEYOND, DRIVEN = 0, 1, 2
"""Columns of the memory: number of the nearest point of the centre line; distance beyond it, from the start [m]."""


class CentreLine:
    """The longest loop of lanes of a map, as points at equal distances."""

    def __init__(self, map_: str) -> None:
        lanes = load_map(map_).lane_graph
        points = lanes.path(lanes.loops()[-1])
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self.length = float(along[-1])
        """[m]."""
        self.count = round(self.length / SPACING)
        self.spacing = self.length / self.count
        """[m]."""
        at = np.arange(self.count) * self.spacing
        self.x, self.y = (np.interp(at, along, points[:, axis]) for axis in (0, 1))
        dx, dy = (np.roll(values, -1) - np.roll(values, 1) for values in (self.x, self.y))
        length = np.hypot(dx, dy)
        self.cos, self.sin = dx / length, dy / length
        """Direction of the lane at each point."""

    def pose(self, place: int) -> tuple[float, float, float]:
        """x, y [m] and yaw [rad] of a point."""
        return float(self.x[place]), float(self.y[place]), math.atan2(self.sin[place], self.cos[place])


class LaneKeeping(Task):
    """See the module."""

    name = "lane_keeping"
    features = (
        *MOTION,
        Feature("offset", -1.0, 1.0, "distance from the centre line [m], left of it positive"),
        Feature("direction_cos", -1.0, 1.0, "cosine of the angle from the car to the direction of the lane"),
        Feature("direction_sin", -1.0, 1.0, "sine of that angle, left positive"),
        *(
            Feature(f"ahead_{distance:g}_{axis}", -2.0, 2.0, f"{axis} of the lane {distance:g} m on, vehicle frame [m]")
            for distance in PREVIEW
            for axis in "xy"
        ),
    )
    known = len(MOTION)
    observation = "state"
    memory_size = 3

    def __init__(self, frame_skip: int, cars: int = 1) -> None:
        self.line = line = CentreLine(MAP)
        self.scenario = ScenarioSpec(
            map=MAP,
            vehicles={
                f"V{k + 1}": VehiclePlacement(x=x, y=y, yaw_deg=math.degrees(yaw))
                for k, (x, y, yaw) in enumerate(line.pose(k * line.count // cars) for k in range(cars))
            },
        )
        self._preview = np.array([round(distance / line.spacing) for distance in PREVIEW])
        reach = math.ceil(TOP_SPEED * self.scenario.tick * frame_skip / line.spacing) + 2
        self._window = np.arange(-reach, reach + 1)

    def start(self, rng: np.random.Generator) -> Start:
        """A place on the lane."""
        return self.starts(rng)[0]

    def starts(self, rng: np.random.Generator) -> list[Start]:
        """A place on the lane for each car, at about equal distances."""
        names = list(self.scenario.vehicles)
        first = int(rng.integers(self.line.count))
        starts = []
        for k, name in enumerate(names):
            place = (first + k * self.line.count // len(names)) % self.line.count
            x, y, yaw = self.line.pose(place)
            aside, turn = uniform(rng, (START_OFFSET, START_ANGLE))
            x, y = x - aside * float(self.line.sin[place]), y + aside * float(self.line.cos[place])
            starts.append(Start({name: (x, y, wrapped(yaw + turn))}, (float(place), 0.0, 0.0)))
        return starts

    def evaluate(self, cars: CarReadings, memory: Floats, features: Floats) -> Outcome:
        """See `Task.evaluate`. The nearest point is sought around the last one, so that crossings do not matter."""
        line = self.line
        x, y = cars.position[:, 0], cars.position[:, 1]
        before = memory[:, PLACE].astype(np.intp)
        near = (before[:, None] + self._window) % line.count
        dx, dy = line.x[near] - x[:, None], line.y[near] - y[:, None]
        nearest = (dx * dx + dy * dy).argmin(axis=1)
        moved = self._window[nearest]
        place = (before + moved) % line.count
        dx, dy = x - line.x[place], y - line.y[place]
        beyond, offset = turned(dx, dy, line.cos[place], line.sin[place])
        c, s = heading(cars.orientation)
        direction_cos, direction_sin = turned(line.cos[place], line.sin[place], c, s)

        progress = moved * line.spacing + beyond - memory[:, BEYOND]
        driven = memory[:, DRIVEN] + progress
        memory[:, PLACE], memory[:, BEYOND], memory[:, DRIVEN] = place, beyond, driven
        write_motion(cars, features)
        if features.shape[1] > self.known:
            features[:, 3], features[:, 4], features[:, 5] = offset, direction_cos, direction_sin
            for i, steps in enumerate(self._preview.tolist()):
                there = (place + steps) % line.count
                features[:, 6 + 2 * i], features[:, 7 + 2 * i] = turned(line.x[there] - x, line.y[there] - y, c, s)
        away = np.abs(offset)
        has_ended = (away > HALF_WIDTH) | (direction_cos < 0.0) | (cars.collision_count > 0)
        reward = np.where(has_ended, FAILURE, progress * (1.0 - away / HALF_WIDTH))
        return Outcome(reward, has_ended, driven >= line.length)
