"""The traffic of a scenario: its roads, its vehicles, and where they start."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.roads import NO_ROADS, roads
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.rules.traffic.drive import CAR, NONE, TrafficTable
from autodrive.world.rules.traffic.start import chosen_places, clearance, reach, start_places

SLOWEST = 0.85
"""Each driver likes to drive at a speed from this share of that of the scenario to all of it."""


class Fleet:
    """The traffic of a scenario: what does not change. It may have no vehicles."""

    def __init__(
        self,
        spec: ScenarioSpec,
        map_: Map,
        vehicles: Mapping[str, VehicleSpec],
        boxes: Sequence[tuple[int, tuple[float, float, float]]],
    ) -> None:
        """`vehicles`: all of a world, in the order of the rows of `Model.vehicles`.

        `boxes`: where the pose of each box is in `State.qpos`, and its size [m].
        """
        self.names = names = spec.traffic.names
        links = NO_ROADS
        self._places: list[tuple[float, float, float]] = []
        self._length = 0.0
        if names:
            vehicle = vehicles[names[0]]
            links = roads(map_, clearance(vehicle))
            self._places = start_places(links, vehicle)
            self._length = sum(reach(vehicle))
        self._speed = spec.traffic.speed
        order = list(vehicles)
        cars = np.zeros(len(order), CAR)
        for car, (name, vehicle) in zip(cars, vehicles.items(), strict=True):
            car["driver"] = names.index(name) if name in names else NONE
            car["front"], car["rear"] = reach(vehicle)
            car["half_width"], car["wheelbase"] = vehicle.size[1] / 2.0, vehicle.wheelbase
            car["steering_limit"] = vehicle.steering.largest_angle
            car["top_speed"] = vehicle.full_throttle_speed
        self.table = TrafficTable(
            roads=links,
            cars=cars,
            rows=np.array([order.index(name) for name in names], np.int64),
            boxes=np.array([at for at, _ in boxes], np.int64),
            box_radius=np.array([0.5 * math.hypot(*size[:2]) for _, size in boxes]),
            tick=spec.tick,
        )

    def start_poses(self, seed: int, others: Sequence[tuple[float, float]]) -> dict[str, tuple[float, float, float]]:
        """Where they start with that seed: x, y [m] and heading [rad] by name; away from the points `others` [m]."""
        starts = chosen_places(self._places, self._length, len(self.names), seed, others)
        return dict(zip(self.names, starts, strict=False))

    def desired_speed(self, driver: int, random: np.random.Generator) -> float:
        """Speed at which a driver likes to drive [m/s]."""
        share = SLOWEST + (1.0 - SLOWEST) * random.random()
        return share * min(self._speed, float(self.table.cars["top_speed"][self.table.rows[driver]]))
