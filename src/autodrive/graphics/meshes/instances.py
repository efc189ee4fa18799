"""The objects with an instance number in images: vehicles, boxes, signs, traffic lights and buildings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from autodrive.scenario.maps.props import SIGNS

if TYPE_CHECKING:
    from autodrive.scenario.maps.map import Map

CLASSES = ("vehicle", "box", "traffic_light", "building", *(f"{sign}_sign" for sign in SIGNS))
"""Classes of objects, in the order of their numbers in datasets."""


class Instance(NamedTuple):
    """An object with an instance number; a sign or traffic light is its plate or housing, without the post."""

    name: str
    """Name of the vehicle, the box or the part of the map."""
    kind: str
    """One of `CLASSES`."""


def instances_of(map_: Map, vehicles: Iterable[str], boxes: Iterable[str]) -> tuple[Instance, ...]:
    """The objects with the instance numbers 1, 2, ...: those of the map, then vehicles and boxes as in a Frame."""
    moving = [*(Instance(name, "vehicle") for name in vehicles), *(Instance(name, "box") for name in boxes)]
    return (*map_instances(map_), *moving)


def map_instances(map_: Map) -> Iterator[Instance]:
    """The signs, traffic lights and buildings of a map."""
    kinds: Mapping[str, str] = {prop.name: prop.kind for prop in map_.props}
    for shape in map_.statics:
        name, _, part = shape.name.rpartition(".")
        if shape.material == "block":
            yield Instance(shape.name, "building")
        elif shape.material == "housing":
            yield Instance(name, "traffic_light")
        elif part == shape.material == "plate":
            yield Instance(name, f"{kinds[name]}_sign")
