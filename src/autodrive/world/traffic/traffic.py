"""The drivers of the traffic of a world."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.jit import resolved
from autodrive.physics.model import Model
from autodrive.physics.sensors.random_stream import new_stream
from autodrive.physics.sensors.sensor import random_generator
from autodrive.physics.state import State
from autodrive.protocol.messages import Headlights, Indicators, TrafficLightFrame
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.roads import NO_ROADS, roads
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.controls import VehicleControls
from autodrive.world.traffic.drive import NONE, UNREGULATED, Bodies, Drivers, Seen, drive, new_drivers, new_plan
from autodrive.world.traffic.start import chosen_places, clearance, reach, start_places

INDICATORS = {1: Indicators.LEFT, 0: Indicators.OFF, -1: Indicators.RIGHT}
SLOWEST = 0.85
"""Each driver likes to drive at a speed from this share of that of the scenario to all of it."""


class Fleet:
    """The traffic of a scenario: what does not change, for one world or for many. It may have no vehicles."""

    def __init__(
        self,
        spec: ScenarioSpec,
        map_: Map,
        vehicles: Mapping[str, VehicleSpec],
        boxes: Sequence[tuple[int, tuple[float, float, float]]],
        model: Model,
    ) -> None:
        """`vehicles`: all of a world, in the order of the rows of `model`.

        `boxes`: where the pose of each box is in `State.qpos`, and its size [m].
        """
        self.names = names = spec.traffic.names
        self.roads = NO_ROADS
        self._places: list[tuple[float, float, float]] = []
        self._length = 0.0
        if names:
            vehicle = vehicles[names[0]]
            self.roads = roads(map_, clearance(vehicle))
            self._places = start_places(self.roads, vehicle)
            self._length = sum(reach(vehicle))
        self._speed = spec.traffic.speed
        order = list(vehicles)
        top = [model.vehicles[i]["drive_speed_limit"] * one.wheels.radius for i, one in enumerate(vehicles.values())]
        self.bodies = Bodies(
            row=np.array([order.index(name) for name in names], np.int64),
            driver=np.array([names.index(one) if one in names else NONE for one in order], np.int64),
            front=np.array([reach(one)[0] for one in vehicles.values()]),
            rear=np.array([reach(one)[1] for one in vehicles.values()]),
            half_width=np.array([one.size[1] / 2.0 for one in vehicles.values()]),
            wheelbase=np.array([one.wheelbase for one in vehicles.values()]),
            steering_limit=np.array(model.vehicles["steering_limit"]),
            box=np.array([at for at, _ in boxes], np.int64),
            box_radius=np.array([0.5 * math.hypot(*size[:2]) for _, size in boxes]),
            top_speed=np.array(top),
        )

    def start_poses(self, seed: int, others: Sequence[tuple[float, float]]) -> dict[str, tuple[float, float, float]]:
        """Where they start with that seed: x, y [m] and heading [rad] by name; away from the points `others` [m]."""
        starts = chosen_places(self._places, self._length, len(self.names), seed, others)
        return dict(zip(self.names, starts, strict=False))

    def begin(self, drivers: Drivers, seed: int) -> None:
        """Let the drivers of a world begin anew, with the random numbers of that seed."""
        d = drivers
        for column in (d.link, d.route, d.behind, d.granted, d.asked):
            column[:] = NONE
        for column in (d.at, d.speed, d.has_stopped, d.signal, d.is_braking):
            column[:] = 0
        for i, name in enumerate(self.names):
            rng = random_generator(seed, name, "route")
            share = SLOWEST + (1.0 - SLOWEST) * rng.random()
            d.desired[i] = share * min(self._speed, float(self.bodies.top_speed[self.bodies.row[i]]))
            d.stream[i] = new_stream(rng)


class Traffic(Fleet):
    """The drivers of the traffic of a single world."""

    def __init__(
        self,
        spec: ScenarioSpec,
        map_: Map,
        vehicles: Mapping[str, VehicleSpec],
        boxes: Sequence[tuple[int, tuple[float, float, float]]],
        model: Model,
        state: State,
    ) -> None:
        """`state`: of the vehicles, which the drivers see; for the rest see `Fleet`."""
        super().__init__(spec, map_, vehicles, boxes, model)
        self._lights = dict.fromkeys(map_.traffic_lights, UNREGULATED)
        self._tick = spec.tick
        self.drivers = new_drivers((len(self.names),))
        self._plan = new_plan(len(self.names))
        self._seen = Seen(state.qpos, state.vehicle_position, state.vehicle_orientation, state.vehicle_velocity)
        self._rows: list[int] = self.bodies.row.tolist()
        self._drive: Any = None

    def reset(self, seed: int) -> None:
        """Let the drivers begin anew, with the random numbers of that seed."""
        self.begin(self.drivers, seed)

    def show(self, vehicles: Sequence[VehicleControls], tick: int, *, is_day: bool) -> None:
        """Switch the lamps of the traffic among all `vehicles`: headlights by night, brake lamps and indicators."""
        headlights = Headlights.OFF if is_day else Headlights.LOW
        signals, brakes = self.drivers.signal.tolist(), self.drivers.is_braking.tolist()
        for row, signal, is_braking in zip(self._rows, signals, brakes, strict=True):
            vehicle = vehicles[row]
            vehicle.headlights, vehicle.is_braking = headlights, is_braking == 1
            vehicle.switch_indicators(INDICATORS[signal], tick)

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        return [column.copy() for column in self.drivers]

    def restore(self, saved: Any) -> None:
        """Go back to the state of `save`."""
        for column, kept in zip(self.drivers, saved, strict=True):
            column[:] = kept

    def continue_from(self, before: Traffic) -> None:
        """Go on from the traffic of a world whose map may differ: each driver looks for its place on the roads."""
        if all(map(np.array_equal, self.roads, before.roads)):
            self.restore(before.save())
        else:
            for name in ("speed", "desired", "stream"):
                getattr(self.drivers, name)[:] = getattr(before.drivers, name)

    def drive(self, tick: int, lights: Mapping[str, TrafficLightFrame], throttle: Floats, steering: Floats) -> None:
        """Write what the vehicles of the traffic obey in this tick, shape (n_vehicle,)."""
        shown = self._lights | {name: int(one.state) for name, one in lights.items() if one.mode in ("program", "set")}
        arguments = (
            self.roads,
            self.bodies,
            self.drivers,
            self._plan,
            self._seen,
            np.array([*shown.values()], np.int64),
            tick,
            self._tick,
            throttle,
            steering,
        )
        if self._drive is None:
            self._drive = resolved(drive, *arguments)
        self._drive(*arguments)
