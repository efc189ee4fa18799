"""Metrics: numbers of a run, computed from its Frames while it runs."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import shapely
from shapely.affinity import affine_transform

from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.campaigns.scene import Scene
from autodrive.protocol.messages import Collision, Frame, LapCompleted, OffRoad, VehicleFrame

PERIOD = 0.05
"""Time between two samples of a metric that is too slow for each tick [s]."""


class Metric:
    """A number of a run; `observe` receives each Frame, the first one at time 0."""

    every_tick: ClassVar[bool] = True
    """False: `observe` receives a Frame each `PERIOD` only."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.amount = 0.0

    def observe(self, frame: Frame) -> None:
        """Take a Frame into account."""
        raise NotImplementedError

    def value(self) -> float:
        """The number at the end of the run; nan if there is none."""
        return self.amount

    def vehicle(self, frame: Frame) -> VehicleFrame:
        """The vehicle of the campaign."""
        return frame.vehicles[self.scene.vehicle]


class Distance(Metric):
    """Path length of the rear axle centre [m]."""

    def observe(self, frame: Frame) -> None:  # noqa: D102
        if frame.tick:
            self.amount += math.hypot(*self.vehicle(frame).velocity[:2].tolist()) * self.scene.scenario.tick


class Collisions(Metric):
    """Collisions of the vehicle."""

    kind: type[Collision | OffRoad | LapCompleted] = Collision

    def observe(self, frame: Frame) -> None:  # noqa: D102
        for event in frame.events:
            self.amount += isinstance(event, self.kind) and event.vehicle == self.scene.vehicle


class Departures(Collisions):
    """How often the vehicle left the drivable area."""

    kind = OffRoad


class Laps(Collisions):
    """Laps that the vehicle completed; needs a race track."""

    kind = LapCompleted


class LapTime(Metric):
    """Time of the best lap [s]; missing without a complete lap."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.amount = math.nan

    def observe(self, frame: Frame) -> None:  # noqa: D102
        for event in frame.events:
            if isinstance(event, LapCompleted) and event.vehicle == self.scene.vehicle:
                self.amount = min(event.lap_time, self.amount) if self.amount == self.amount else event.lap_time


class MeanSpeed(Metric):
    """Mean of the speed along the vehicle [m/s]."""

    count = 0

    def observe(self, frame: Frame) -> None:  # noqa: D102
        self.amount += self.vehicle(frame).speed
        self.count += 1

    def value(self) -> float:  # noqa: D102
        return self.amount / self.count


class MaxSpeed(Metric):
    """Greatest speed along the vehicle [m/s]."""

    def observe(self, frame: Frame) -> None:  # noqa: D102
        self.amount = max(self.amount, self.vehicle(frame).speed)


class Energy(Metric):
    """Work that accelerates the vehicle [J]: the sum of all increases of its kinetic energy."""

    last = 0.0

    def observe(self, frame: Frame) -> None:  # noqa: D102
        speed = self.vehicle(frame).speed
        kinetic = 0.5 * self.scene.vehicles[self.scene.vehicle].body.mass * speed * speed
        if frame.tick:
            self.amount += max(0.0, kinetic - self.last)
        self.last = kinetic


class SteeringRms(Metric):
    """Root mean square of the rate of the steering angle [rad/s]."""

    last, count = 0.0, 0

    def observe(self, frame: Frame) -> None:  # noqa: D102
        angle = self.vehicle(frame).steering
        if frame.tick:
            self.amount += ((angle - self.last) / self.scene.scenario.tick) ** 2
            self.count += 1
        self.last = angle

    def value(self) -> float:  # noqa: D102
        return math.sqrt(self.amount / self.count) if self.count else 0.0


class LateralErrorRms(Metric):
    """Root mean square of the distance from the nearest lane that leads in the direction of the vehicle [m]."""

    every_tick = False
    count = 0

    def observe(self, frame: Frame) -> None:  # noqa: D102
        error = _lateral_error(self.scene, self.vehicle(frame))
        if not math.isnan(error):
            self.amount += error * error
            self.count += 1

    def value(self) -> float:  # noqa: D102
        return math.sqrt(self.amount / self.count) if self.count else math.nan


class LateralErrorMax(Metric):
    """Greatest distance from the nearest lane that leads in the direction of the vehicle [m]."""

    every_tick = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.amount = math.nan

    def observe(self, frame: Frame) -> None:  # noqa: D102
        error = abs(_lateral_error(self.scene, self.vehicle(frame)))
        if not self.amount >= error:
            self.amount = error


class MinClearance(Metric):
    """Least distance of the vehicle, seen from above, from walls, boxes and other vehicles [m]."""

    every_tick = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self.amount = math.inf
        self._outlines = {name: _outline(spec) for name, spec in scene.vehicles.items()}
        boxes = {box.name: box.size for box in scene.map.boxes}
        boxes |= {name: box.size for name, box in scene.scenario.boxes.items()}
        self._boxes = {name: shapely.box(-a / 2, -b / 2, a / 2, b / 2) for name, (a, b, _) in boxes.items()}

    @cached_property
    def _walls(self) -> shapely.STRtree:
        return shapely.STRtree([shape.plan for shape in self.scene.map.statics])

    def observe(self, frame: Frame) -> None:  # noqa: D102
        own = _placed(self._outlines[self.scene.vehicle], self.vehicle(frame).pose)
        others = [_placed(self._boxes[name], one.pose) for name, one in frame.objects.items()]
        others += [
            _placed(self._outlines[name], one.pose)
            for name, one in frame.vehicles.items()
            if name != self.scene.vehicle
        ]
        if others:
            self.amount = min(self.amount, float(shapely.distance(own, np.array(others, dtype=object)).min()))
        if len(self._walls):
            _, distance = self._walls.query_nearest(own, return_distance=True, all_matches=False)
            self.amount = min(self.amount, float(distance[0]))


class FunctionMetric(Metric):
    """A function of the user: it receives the list of all Frames and returns a number."""

    def __init__(self, scene: Scene, function: Callable[[list[Frame]], Any]) -> None:
        super().__init__(scene)
        self._function = function
        self._frames: list[Frame] = []

    def observe(self, frame: Frame) -> None:  # noqa: D102
        self._frames.append(frame)

    def value(self) -> float:  # noqa: D102
        value = self._function(self._frames)
        return math.nan if value is None else float(value)


METRICS: dict[str, type[Metric]] = {
    "collisions": Collisions,
    "departures": Departures,
    "distance": Distance,
    "energy": Energy,
    "lap_time": LapTime,
    "laps": Laps,
    "lateral_error_max": LateralErrorMax,
    "lateral_error_rms": LateralErrorRms,
    "max_speed": MaxSpeed,
    "mean_speed": MeanSpeed,
    "min_clearance": MinClearance,
    "steering_rate_rms": SteeringRms,
}
"""The metrics by name."""


def _lateral_error(scene: Scene, vehicle: VehicleFrame) -> float:
    """Signed distance from the nearest lane [m]; nan without one."""
    x, y = vehicle.pose.position[:2].tolist()
    point = scene.map.lane_graph.nearest(x, y, yaw_from_quaternion(vehicle.pose.orientation))
    return math.nan if point is None else point.offset


def _outline(spec: Any) -> shapely.Polygon:
    """The box around chassis and wheels, seen from above, in the vehicle frame."""
    low, high = [], []
    for box in spec.platforms:
        low.append([box.position[i] - box.size[i] / 2 for i in (0, 1)])
        high.append([box.position[i] + box.size[i] / 2 for i in (0, 1)])
    for hub in spec.hubs:
        half = spec.wheels.radius, spec.wheels.width / 2
        low.append([hub[i] - half[i] for i in (0, 1)])
        high.append([hub[i] + half[i] for i in (0, 1)])
    return shapely.box(*np.min(low, axis=0).tolist(), *np.max(high, axis=0).tolist())


def _placed(outline: shapely.Polygon, pose: Any) -> shapely.Polygon:
    angle = yaw_from_quaternion(pose.orientation)
    c, s = math.cos(angle), math.sin(angle)
    return affine_transform(outline, [c, -s, s, c, *pose.position[:2].tolist()])
