"""The driver that is included in the simulator: it follows the lanes of a map, or races by the included policy."""

from __future__ import annotations

import math
import random
from typing import TYPE_CHECKING, Protocol

import numpy as np

from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.base.transforms import yaw_from_quaternion
from autodrive.protocol.messages import Command, SetDrivingMode, TrafficLightState
from autodrive.scenario.maps.roads import resampled, stop_line_on

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.protocol.messages import Frame, VehicleFrame
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.stop_lines import StopLine
    from autodrive.scenario.vehicles.spec import VehicleSpec
    from autodrive.world import World
    from autodrive.world.simulation import Simulation

SPACING = 0.02
"""Distance between the points of a way, about [m]."""
SPEED = 0.22
"""[m/s]."""
AHEAD = 3.0
"""The way is known so far ahead [m]."""
LOOK = 0.32
"""The car steers to the point of its way at this distance [m]."""
LOST = 0.3
"""A car farther from its way looks for another one [m]."""
NEAR = 100
"""The nearest point is sought so many points before and after the last one."""
STOPPED = 0.02
"""A slower car has stopped [m/s]."""
APPROACH = 0.8
"""Speed over the distance to where the car stops [1/s]."""
MARGIN = 0.04
"""Distance from the front to a stop line [m]."""
GAP = 0.15
"""Distance to a vehicle ahead at which the car stops [m]."""
WAIT = 2.0
"""Time that the car waits at a sign [s]."""


class VehicleDriver(Protocol):
    """Drives one vehicle."""

    def command(self, frame: Frame) -> Command | None:
        """What the vehicle is to do after that Frame; None: nothing new."""
        ...


class IncludedDriver:
    """Lets vehicles of a simulation be driven, until a person drives them, a reset, or another world.

    As a sink it gives a command for each Frame. All methods may be called in any thread.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._driven: tuple[World, str, VehicleDriver] | None = None
        self._time = 0.0
        """Simulated time of the latest Frame [s]."""

    def let_drive(self, vehicle: str, is_on: bool) -> None:
        """Drive a vehicle from now on, in autonomous mode, or give it back to the person. Raises `AutodriveError`."""
        self._driven = None
        world = self._simulation.world
        if vehicle not in world.spec.vehicles:
            raise AutodriveError(f"vehicle '{vehicle}' is not known. {suggest(vehicle, list(world.spec.vehicles))}")
        driver = driver_of(world, vehicle, self._simulation.frame) if is_on else None
        self._simulation.request(SetDrivingMode(vehicle, is_on)).result()
        if driver is not None:
            self._driven = world, vehicle, driver

    def publish(self, frame: Frame) -> None:
        """Give the command for the next tick."""
        is_reset, self._time = frame.time < self._time, frame.time
        if (driven := self._driven) is None:
            return
        world, vehicle, driver = driven
        is_driven = world is self._simulation.world and not is_reset and frame.vehicles[vehicle].is_autonomous
        if not is_driven:
            self._driven = None
        elif command := driver.command(frame):
            self._simulation.submit(vehicle, command)


def driver_of(world: World, vehicle: str, frame: Frame) -> VehicleDriver:
    """The driver for a vehicle of a world. Raises `AutodriveError` if there is none."""
    spec = world.vehicle_specs[vehicle]
    if world.race is not None:
        from autodrive.experiments.policies.policy import Policy
        from autodrive.experiments.policies.racer import PolicyRacer

        racer = RaceDriver(PolicyRacer(Policy.find("race")), vehicle)
        racer.command(frame)  # raises if the readings are not those of the policy
        return racer
    if not world.map.lane_graph.lanes:
        raise AutodriveError("the included driver follows lanes, and this map has none")
    return LaneDriver(world.map, spec, vehicle)


class RaceDriver:
    """Races by a policy: one command for each scan of the LIDAR."""

    def __init__(self, racer: Racer, vehicle: str) -> None:
        self._racer, self._vehicle = racer, vehicle
        self._scanned = -math.inf

    def command(self, frame: Frame) -> Command | None:
        """What the policy says about a new scan."""
        car = frame.vehicles[self._vehicle]
        if car.lidar is not None and car.lidar.time == self._scanned:
            return None
        command = self._racer.act(car)
        assert car.lidar is not None  # the racer needs it
        self._scanned = car.lidar.time
        return command


class Racer(Protocol):
    """What drives a race car."""

    def act(self, car: VehicleFrame) -> Command:
        """The command for a Frame of one car."""
        ...


class LaneDriver:
    """Follows lanes, at each branch one by chance; stops for vehicles ahead, red lights and signs.

    Steering: pure pursuit (Coulter: Implementation of the pure pursuit path tracking algorithm, CMU-RI-TR-92-01, 1992).
    """

    def __init__(self, map_: Map, spec: VehicleSpec, vehicle: str, seed: int = 0) -> None:
        self._graph = map_.lane_graph
        self._lines = [*map_.stop_lines, *map_.give_way_lines]
        self._spec, self._vehicle = spec, vehicle
        self._front = spec.wheelbase / 2.0 + spec.size[0] / 2.0
        self._random = random.Random(seed)
        self._way: Floats = np.empty((0, 2))
        self._at = 0
        """Number of the nearest point of the way."""
        self._lane = -1
        """The last lane of the way."""
        self._stops: list[tuple[int, StopLine]] = []
        """Lines ahead, each with the number of its point of the way."""
        self._stopped = -math.inf
        """Time at which the car has stopped at the sign before it [s]; -inf: it has not."""

    def command(self, frame: Frame) -> Command:
        """Throttle and steering for the next tick."""
        car = frame.vehicles[self._vehicle]
        position, yaw = car.pose.position[:2], yaw_from_quaternion(car.pose.orientation)
        if not self._follow(position, yaw):
            return Command()
        speed = min(SPEED, self._spec.full_throttle_speed)
        speed = min(speed, self._behind(frame), self._before_line(frame, car))
        target = self._way[min(self._at + round(LOOK / SPACING), len(self._way) - 1)] - position
        aside = math.cos(yaw) * target[1] - math.sin(yaw) * target[0]
        angle = math.atan2(2.0 * self._spec.wheelbase * aside, float(target @ target))
        return Command(
            max(speed, 0.0) / self._spec.full_throttle_speed, _clipped(float(self._spec.steering.commands(angle)))
        )

    def _follow(self, position: Floats, yaw: float) -> bool:
        """Find the nearest point of the way, and make the way longer; False if there is no lane here."""
        first = max(self._at - NEAR, 0)
        near = np.hypot(*(self._way[first : self._at + NEAR] - position).T)
        if not len(near) or near.min() > LOST:
            start = self._graph.nearest(float(position[0]), float(position[1]), yaw)
            if start is None:
                return False
            self._way, self._lane, self._at, self._stops = np.empty((0, 2)), -1, 0, []
            self._append(start.lane)
            near, first = np.hypot(*(self._way - position).T), 0
        self._at = first + int(near.argmin())
        while len(self._way) - self._at < AHEAD / SPACING and (lane := self._next()) is not None:
            self._append(lane)
        return True

    def _next(self) -> int | None:
        """The lane after the last one; a lane that leads to a dead end only if there is no other."""
        following = self._graph.lanes[self._lane].successors
        endless = [lane for lane in following if self._graph.loop(lane) is not None]
        choices = endless or following
        return self._random.choice(choices) if choices else None

    def _append(self, lane: int) -> None:
        points = self._graph.lanes[lane].points
        if stop := stop_line_on(points, self._lines):
            self._stops.append((len(self._way) + round(stop[0] / SPACING), stop[1]))
        self._way = np.vstack([self._way, resampled(points)])
        self._lane = lane

    def _behind(self, frame: Frame) -> float:
        """The greatest speed behind the next vehicle or box on the way [m/s]."""
        way = self._way[self._at : self._at + round(1.2 / SPACING)]
        others = [other.pose.position[:2] for name, other in frame.vehicles.items() if name != self._vehicle]
        others += [box.pose.position[:2] for box in frame.objects.values()]
        if not others:
            return math.inf
        distance = np.hypot(*(way[:, None] - np.array(others)[None]).transpose(2, 0, 1))
        is_near = (distance < 0.5 * self._spec.size[1] + 0.12).any(axis=1)
        if not is_near.any():
            return math.inf
        return APPROACH * (int(is_near.argmax()) * SPACING - self._front - GAP)

    def _before_line(self, frame: Frame, car: VehicleFrame) -> float:
        """The greatest speed before the next stop line [m/s]."""
        while self._stops and (self._stops[0][0] - self._at) * SPACING < self._front - MARGIN:
            self._stops.pop(0)
            self._stopped = -math.inf
        if not self._stops:
            return math.inf
        point, line = self._stops[0]
        distance = (point - self._at) * SPACING - self._front - MARGIN
        if line.kind == "traffic_light":
            is_free = frame.traffic_lights[line.prop].state not in (TrafficLightState.RED, TrafficLightState.YELLOW)
        else:
            if car.speed < STOPPED and distance < 2.0 * MARGIN and self._stopped == -math.inf:
                self._stopped = frame.time
            is_free = frame.time > self._stopped + WAIT > -math.inf
        return math.inf if is_free else APPROACH * max(distance, 0.0)


def _clipped(value: float) -> float:
    return min(max(value, -1.0), 1.0)
