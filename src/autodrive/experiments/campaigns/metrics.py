"""Metrics: numbers of a run, computed from its Frames while it runs."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import shapely
from shapely.affinity import affine_transform

from autodrive.base.transforms import yaw_from_quaternion
from autodrive.experiments.campaigns.scene import RunScene
from autodrive.protocol.messages import Collision, Frame, LapCompleted, OffRoad

T = TypeVar("T", bound=Collision | OffRoad | LapCompleted)

PERIOD = 0.05
"""Time between two samples of a metric that is too slow for each tick [s]."""


class Metric:
    """A number of a run; `observe` receives each Frame, the first one at time 0."""

    every_tick: bool = True
    """False: `observe` receives a Frame each `PERIOD` only."""

    def __init__(self, scene: RunScene) -> None:
        self.scene = scene
        self.amount = 0.0

    def observe(self, frame: Frame) -> None:
        """Take a Frame into account."""
        raise NotImplementedError

    def value(self) -> float:
        """The number at the end of the run; nan if there is none."""
        return self.amount


@dataclass(frozen=True)
class Kind:
    """Metrics of one number of each Frame: calling it makes one for a run."""

    sample: Callable[[RunScene, Frame, Frame | None], float]
    """A number of a Frame and of the one before, which the first Frame does not have; nan: there is none."""
    take: Callable[[float, float], float] = operator.add
    """The amount with one more sample."""
    start: float = 0.0
    """The amount without samples."""
    end: Callable[[float, int], float] = lambda amount, count: amount
    """The number, from the amount and the count of samples."""
    every_tick: bool = True

    def __call__(self, scene: RunScene) -> Metric:
        """The metric of a run."""
        return _SampledMetric(scene, self)


class _SampledMetric(Metric):
    """A metric of a `Kind`, which samples Frames and combines the numbers."""

    def __init__(self, scene: RunScene, kind: Kind) -> None:
        super().__init__(scene)
        self._kind, self.every_tick, self.amount = kind, kind.every_tick, kind.start
        self._count = 0
        self._before: Frame | None = None

    def observe(self, frame: Frame) -> None:
        sample = self._kind.sample(self.scene, frame, self._before)
        self._before = frame
        if not math.isnan(sample):
            self.amount = self._kind.take(self.amount, sample)
            self._count += 1

    def value(self) -> float:
        return self._kind.end(self.amount, self._count)


class MinClearance(Metric):
    """Least distance of the vehicle, seen from above, from walls, boxes and other vehicles [m]."""

    every_tick = False

    def __init__(self, scene: RunScene) -> None:
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
        own = _placed(self._outlines[self.scene.vehicle], frame.vehicles[self.scene.vehicle].pose)
        others = [_placed(self._boxes[name], body.pose) for name, body in frame.objects.items()]
        others += [
            _placed(self._outlines[name], vehicle.pose)
            for name, vehicle in frame.vehicles.items()
            if name != self.scene.vehicle
        ]
        if others:
            self.amount = min(self.amount, float(shapely.distance(own, np.array(others, dtype=object)).min()))
        if len(self._walls):
            _, distance = self._walls.query_nearest(own, return_distance=True, all_matches=False)
            self.amount = min(self.amount, float(distance[0]))


class FunctionMetric(Metric):
    """A function of the user: it receives the list of all Frames and returns a number."""

    def __init__(self, scene: RunScene, function: Callable[[list[Frame]], Any]) -> None:
        super().__init__(scene)
        self._function = function
        self._frames: list[Frame] = []

    def observe(self, frame: Frame) -> None:  # noqa: D102
        self._frames.append(frame)

    def value(self) -> float:  # noqa: D102
        value = self._function(self._frames)
        return math.nan if value is None else float(value)


def _events(scene: RunScene, frame: Frame, kind: type[T]) -> list[T]:
    """Events of that kind of the vehicle."""
    return [event for event in frame.events if isinstance(event, kind) and event.vehicle == scene.vehicle]


def _count(kind: type[Collision | OffRoad | LapCompleted]) -> Kind:
    return Kind(lambda scene, frame, before: float(len(_events(scene, frame, kind))))


def _lap_time(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    return min((lap.lap_time for lap in _events(scene, frame, LapCompleted)), default=math.nan)


def _speed(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    """Along the vehicle [m/s]."""
    return frame.vehicles[scene.vehicle].speed


def _way(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    """Way of the rear axle centre in a tick [m]."""
    speed = math.hypot(*frame.vehicles[scene.vehicle].velocity[:2].tolist())
    return math.nan if before is None else speed * scene.scenario.tick


def _work(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    """Increase of the kinetic energy [J]."""
    if before is None:
        return math.nan
    mass = scene.vehicles[scene.vehicle].body.mass
    now, then = (
        0.5 * mass * speed * speed for speed in (_speed(scene, each_frame, None) for each_frame in (frame, before))
    )
    return max(0.0, now - then)


def _square_steering_rate(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    """[rad^2/s^2]."""
    if before is None:
        return math.nan
    angle, last = (each_frame.vehicles[scene.vehicle].steering for each_frame in (frame, before))
    return ((angle - last) / scene.scenario.tick) ** 2


def _lateral_error(scene: RunScene, frame: Frame, before: Frame | None) -> float:
    """Distance from the nearest lane that leads in the direction of the vehicle [m]; nan without one."""
    pose = frame.vehicles[scene.vehicle].pose
    x, y = pose.position[:2].tolist()
    point = scene.map.lane_graph.nearest(x, y, yaw_from_quaternion(pose.orientation))
    return math.nan if point is None else abs(point.offset)


def _least(amount: float, sample: float) -> float:
    return amount if amount <= sample else sample


def _greatest(amount: float, sample: float) -> float:
    return amount if amount >= sample else sample


def _root_mean(amount: float, count: int, none: float = math.nan) -> float:
    """The root of the mean of squares whose sum is `amount`."""
    return math.sqrt(amount / count) if count else none


METRICS: dict[str, Callable[[RunScene], Metric]] = {
    "collisions": _count(Collision),
    "departures": _count(OffRoad),
    "distance": Kind(_way),
    "energy": Kind(_work),
    "lap_time": Kind(_lap_time, _least, math.nan),
    "laps": _count(LapCompleted),
    "lateral_error_max": Kind(_lateral_error, _greatest, math.nan, every_tick=False),
    "lateral_error_rms": Kind(
        _lateral_error, lambda amount, sample: amount + sample * sample, 0.0, _root_mean, every_tick=False
    ),
    "max_speed": Kind(_speed, _greatest),
    "mean_speed": Kind(_speed, end=operator.truediv),
    "min_clearance": MinClearance,
    "steering_rate_rms": Kind(_square_steering_rate, end=lambda amount, count: _root_mean(amount, count, 0.0)),
}
"""The metrics by name, see docs/campaigns.md."""


def _outline(spec: Any) -> shapely.Polygon:
    """The box around chassis and wheels, seen from above, in the vehicle frame."""
    low, high = [], []
    for box in (*spec.platforms, *spec.bumpers):
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
