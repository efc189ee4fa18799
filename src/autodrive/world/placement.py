"""Checks where a scenario places its vehicles and boxes, for `check`, `run`, `make` and edits alike.

What overlaps is an error: the engine would throw it apart. What only is probably a mistake is a warning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely

from autodrive.base.specs import PlaceInFile, Problem
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import BoxPlacement, Map
from autodrive.scenario.maps.placing import Solid, overlaps
from autodrive.scenario.vehicles.spec import VehicleSpec

LIKELY_INERTIA = 0.27, 2.5
"""Moments of inertia in those of a solid box of the mass and size of the vehicle: less and more are reported."""
SMALL = 0.5
"""Share of the size of a vehicle; colliders that reach over less of it are reported."""


def overlapping_vehicles(vehicles: Mapping[str, VehicleSpec], pairs: Sequence[tuple[str, str]]) -> list[Problem]:
    """A problem for each vehicle that overlaps another object; `pairs`: the names of the objects that overlap."""
    return [
        (
            PlaceInFile("scenario", ("vehicles", [name for name in pair if name in vehicles][-1])),
            f": '{pair[0]}' and '{pair[1]}' overlap at the start; move one of them",
        )
        for pair in sorted({(min(pair), max(pair)) for pair in pairs})
        if set(pair) & set(vehicles)
    ]


def overlapping_boxes(spec: ScenarioSpec, map_: Map, boxes: Sequence[BoxPlacement]) -> list[Problem]:
    """A problem for each box of the scenario that overlaps a box or a fixed object."""
    own = [box for box in boxes if box.name in spec.boxes]
    if not own:
        return []
    others = [solid for solid in (*boxes, *map_.statics) if solid.name not in spec.boxes]
    solids: list[Solid] = [(_at("boxes", box.name), box.plan, *box.span) for box in own]
    solids += [(f"'{other.name}'", other.plan, *other.span) for other in others]
    return [overlap.text for overlap in overlaps(solids, len(own))]


def placement_warnings(
    spec: ScenarioSpec, map_: Map, vehicles: Mapping[str, VehicleSpec], boxes: Sequence[BoxPlacement]
) -> list[Problem]:
    """A problem for each vehicle or box outside the walls, and each vehicle with small colliders or a wrong inertia."""
    places = {name: _at("vehicles", name) for name in spec.vehicles} | {name: _at("boxes", name) for name in spec.boxes}
    positions = {name: (placement.x, placement.y) for name, placement in spec.vehicles.items()}
    positions |= {box.name: box.position[:2] for box in boxes}
    return [
        *(
            (places.get(name, f"box '{name}'"), outside)
            for name, position in positions.items()
            if (outside := _outside(map_, *position))
        ),
        *((places[name], small) for name, vehicle in vehicles.items() if (small := _too_small(vehicle))),
        *((places[name], wrong) for name, vehicle in vehicles.items() if (wrong := _unlikely_inertia(vehicle))),
    ]


def traffic_warnings(spec: ScenarioSpec, vehicles: Mapping[str, VehicleSpec]) -> list[Problem]:
    """A problem for settings of the traffic that have no effect: without cars, or a speed that they cannot drive."""
    traffic = spec.traffic
    if not traffic.cars and traffic.model_fields_set and "cars" not in traffic.model_fields_set:
        return [
            (PlaceInFile("scenario", ("traffic",)), ": without 'cars' there is no traffic; write for example cars: 5")
        ]
    cars = [vehicles[name] for name in traffic.names if name in vehicles]
    top = min((car.full_throttle_speed for car in cars), default=traffic.speed)
    if traffic.speed <= top:
        return []
    text = f": cars of the type '{traffic.type}' drive at most {top:.3g} m/s, not {traffic.speed:g} m/s"
    return [(PlaceInFile("scenario", ("traffic", "speed")), text)]


def warnings_about(name: str, warnings: Sequence[Problem]) -> list[Problem]:
    """The warnings that concern the vehicle or box of that name in the scenario."""
    return [
        warning
        for warning in warnings
        if any(isinstance(part, PlaceInFile) and part.location[-1] == name for part in warning)
    ]


def _at(key: str, name: str) -> PlaceInFile:
    return PlaceInFile("scenario", (key, name), name if key == "vehicles" else f"box '{name}'")


def _outside(map_: Map, x: float, y: float) -> str:
    """Says that a place [m] is outside the walls that enclose the roads; empty if it is not."""
    if map_.enclosure is None or map_.enclosure.covers(shapely.Point(x, y)):
        return ""
    x0, y0, x1, y1 = map_.enclosure.bounds
    text = f" at ({x:g}, {y:g}) is outside the walls of map '{map_.name}'"
    if x0 <= x <= x1 and y0 <= y <= y1:  # in the middle of a ring
        return text
    return f"{text}, which enclose x from {x0:g} to {x1:g} m and y from {y0:g} to {y1:g} m"


def _too_small(vehicle: VehicleSpec) -> str:
    """Says that the colliders of a vehicle reach over a small part of its size; empty if they do not."""
    wheel = np.array([vehicle.wheels.radius, vehicle.wheels.width / 2.0, vehicle.wheels.radius])
    boxes = [(box.position, np.array(box.size) / 2.0) for box in vehicle.colliders.values()]
    boxes += [(hub, wheel) for hub in vehicle.hubs]
    middles, halves = np.array([middle for middle, _ in boxes]), np.array([half for _, half in boxes])
    reach = (middles + halves).max(axis=0) - (middles - halves).min(axis=0)
    if (reach >= SMALL * np.array(vehicle.size)).all():
        return ""
    reached, size = (" x ".join(f"{length:.3g}" for length in lengths) for lengths in (reach, vehicle.size))
    return (
        f": the wheels and colliders of '{vehicle.title}' fill {reached} m, but 'size' is {size} m: other "
        "objects can pass into the body of the vehicle; change 'platforms' or 'size'"
    )


def _unlikely_inertia(vehicle: VehicleSpec) -> str:
    """Says that the inertia of a vehicle does not fit its mass and size, which were perhaps scaled without it."""
    x, y, z = np.square(vehicle.size)
    of_box = vehicle.body.mass / 12.0 * np.array([y + z, x + z, x + y])
    share = np.array(vehicle.body.inertia) / of_box
    least, most = LIKELY_INERTIA
    if least <= share.min() and share.max() <= most:
        return ""
    box = ", ".join(f"{moment:.3g}" for moment in of_box)
    return (
        f": 'inertia' of '{vehicle.title}' does not fit the mass and size of the vehicle: a solid box of that mass and "
        f"size has the inertia [{box}] kg m^2; if you have scaled the vehicle, scale 'inertia' with mass x length^2"
    )
