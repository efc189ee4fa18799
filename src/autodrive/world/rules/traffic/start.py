"""The vehicles of the traffic in the scenario, and where they start."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from autodrive.base.specs import PlaceInFile, Problem
from autodrive.physics.sensors.sensor import random_generator
from autodrive.physics.sensors.settings import SensorSettings
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.map import Map
from autodrive.scenario.maps.roads import Roads, roads
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.rules.traffic.drive import JAM_GAP, SIDE_MARGIN

SPREAD = 2.0
"""Lengths of a vehicle between places on a lane where vehicles may start."""
NEAREST = 1.4
"""Lengths of a vehicle between those that start, at least."""


def with_traffic(spec: ScenarioSpec, map_: Map, vehicle: VehicleSpec) -> tuple[ScenarioSpec, list[Problem]]:
    """The scenario with so many of that vehicle behind the others, at their starts, and problems."""
    at = PlaceInFile("scenario", ("traffic",))
    own = {name: placement for name, placement in spec.vehicles.items() if name not in spec.traffic.names}
    if spec.race is not None:
        return spec, [(at, ": a scenario with a race cannot have traffic; remove one of them")]
    if map_.track is not None:
        return spec, [(at, f": map '{spec.map_name}' is a race track; traffic needs a map with roads")]
    drivetrain = vehicle.drivetrain
    if drivetrain.control != "speed" or drivetrain.coasts:
        text = "set a speed (control: speed), not a torque" if drivetrain.control != "speed" else "brake at 0 (coasts)"
        return spec, [(at, f": the throttle of '{spec.traffic.type}' must {text}")]
    for name in spec.traffic.names:  # in an edit or a recording they are among the vehicles, all sensors off
        placement = spec.vehicles.get(name)
        if placement and (not placement.sensors or any(sensor.is_on for sensor in placement.sensors.values())):
            place = PlaceInFile("scenario", ("vehicles", name))
            return spec, [(place, ": this name belongs to the traffic; choose another name")]
    links = roads(map_, clearance(vehicle))
    taken = [(placement.x, placement.y) for placement in own.values()] + [box.position[:2] for box in map_.boxes]
    taken += [(box.x, box.y) for box in spec.boxes.values()]
    length = sum(reach(vehicle))
    starts = chosen_places(start_places(links, vehicle), length, spec.traffic.cars, spec.seed, taken)
    if len(starts) < spec.traffic.cars:
        text = f"room for {len(starts)} cars" if links.link_count else "no closed way of lanes"
        return spec, [(at, f": map '{spec.map_name}' has {text}; the traffic has {spec.traffic.cars} cars")]
    sensors = [name for name, sensor in vehicle.sensors if sensor is not None]
    is_off = dict.fromkeys([*sensors, *vehicle.cameras], SensorSettings(is_on=False))
    placed = {
        name: VehiclePlacement(type=spec.traffic.type, x=x, y=y, yaw_deg=math.degrees(yaw), sensors=is_off)
        for name, (x, y, yaw) in zip(spec.traffic.names, starts, strict=True)
    }
    return spec.model_copy(update={"vehicles": own | placed}), []


def start_places(links: Roads, vehicle: VehicleSpec) -> list[tuple[float, float, float]]:
    """x, y [m] and heading [rad] of all places on the lanes where a vehicle may start.

    They are behind gates and before stop lines.
    """
    front, rear = reach(vehicle)
    length = front + rear
    apart = SPREAD * length
    places: list[tuple[float, float, float]] = []
    for link in range(links.link_count):
        last = links.stop_at[link] if links.is_gate[link] else links.length[link]
        first = links.point_first[link]
        begin, end = rear + vehicle.wheelbase, last - (front - vehicle.wheelbase) - JAM_GAP
        for at in np.arange(begin, end, apart).tolist():
            x, y, tx, ty = links.points[first + int(at / links.spacing[link])].tolist()
            place = x - vehicle.wheelbase * tx, y - vehicle.wheelbase * ty, math.atan2(ty, tx)
            places.append((round(place[0], 6), round(place[1], 6), round(place[2], 6)))
    return places


def chosen_places(
    places: Sequence[tuple[float, float, float]],
    length: float,
    count: int,
    seed: int,
    taken: Sequence[tuple[float, float]],
) -> list[tuple[float, float, float]]:
    """Up to `count` of these places, by chance; fewer if there is not enough room.

    They are apart and away from the points `taken` [m]; `length` of a vehicle [m].
    """
    chosen: list[tuple[float, float, float]] = []
    near = list(taken)
    for k in random_generator(seed, "traffic", "places").permutation(len(places)).tolist():
        if len(chosen) == count:
            break
        x, y, yaw = places[k]
        if all(math.dist((x, y), point) > NEAREST * length for point in near):
            chosen.append((x, y, yaw))
            near.append((x, y))
    return chosen


def reach(vehicle: VehicleSpec) -> tuple[float, float]:
    """Distances from the origin of a vehicle to its front and to its rear [m]."""
    front = 0.5 * (vehicle.wheelbase + vehicle.size[0])
    return front, vehicle.size[0] - front


def clearance(vehicle: VehicleSpec) -> float:
    """Distance between the centre lines of lanes on which two such vehicles can pass each other [m]."""
    return vehicle.size[1] + SIDE_MARGIN
