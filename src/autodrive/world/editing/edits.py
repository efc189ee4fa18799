"""Applies an edit to a ScenarioSpec."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, TypeAlias

from autodrive.base.errors import CommandError
from autodrive.base.specs import checked
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import AddBox, Place, RemoveBox, RemoveTraffic, SetSensor
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.solids import BoxPlacement

ObjectEdit: TypeAlias = Place | AddBox | RemoveBox | SetSensor | RemoveTraffic


def edited(spec: ScenarioSpec, boxes: Mapping[str, BoxPlacement], edit: ObjectEdit) -> ScenarioSpec:
    """The scenario after an edit; `boxes` are all boxes of the world, also those of the map.

    Raises `AutodriveError` for a name that is not known and for values that a scenario cannot have.
    """
    tree = spec.model_dump()
    match edit:
        case Place(name=name) if name in spec.vehicles:
            tree["vehicles"][name] |= _pose(edit)
        case Place(name=name):
            _check_known(name, [*spec.vehicles, *boxes])
            _replace_box(tree, boxes[name], _pose(edit))
        case AddBox(name=name):
            if name in spec.vehicles or name in boxes:
                raise CommandError(f"the name '{name}' is taken; a box needs a name of its own")
            tree["boxes"][name] = _pose(edit) | {"size": edit.size, "mass": edit.mass}
        case RemoveBox(name=name):
            if name in spec.vehicles:
                raise CommandError(f"'{name}' is a vehicle; only boxes can be removed")
            _check_known(name, boxes)
            is_of_map = name not in tree["boxes"] and name not in spec.removed_boxes
            tree["boxes"].pop(name, None)
            if is_of_map:
                tree["removed_boxes"] = (*spec.removed_boxes, name)
        case RemoveTraffic():
            if not spec.traffic.cars:
                raise CommandError("the scenario has no traffic")
            for name in spec.traffic.names:
                tree["vehicles"].pop(name, None)
            tree["traffic"] = {}
        case SetSensor(vehicle=vehicle, sensor=sensor):
            _check_known(vehicle, spec.vehicles)
            settings = {"is_on": edit.is_on, "rate": edit.rate, "noise": edit.noise}
            tree["vehicles"][vehicle]["sensors"][sensor] = settings
    return checked(tree, ScenarioSpec)


def name_of(edit: ObjectEdit) -> str:
    """The edit in a few words, for the button that undoes it."""
    match edit:
        case Place(name=name):
            return f"place {name}"
        case AddBox(name=name):
            return f"add {name}"
        case RemoveBox(name=name):
            return f"remove {name}"
        case RemoveTraffic():
            return "remove the traffic"
        case SetSensor(vehicle=vehicle, sensor=sensor):
            return f"set {sensor} of {vehicle}"


def _pose(edit: Place | AddBox) -> dict[str, float]:
    """Values of a scenario file, to 1 um and 1e-6 degrees."""
    if not all(math.isfinite(value) for value in (edit.x, edit.y, edit.yaw)):
        raise CommandError(
            f"'{edit.name}' cannot be placed at x={edit.x}, y={edit.y}, yaw={edit.yaw}: x, y and yaw must be finite "
            "numbers"
        )
    yaw_deg = math.degrees(math.remainder(edit.yaw, 2.0 * math.pi))
    return {"x": round(edit.x, 6), "y": round(edit.y, 6), "yaw_deg": round(yaw_deg, 6)}


def _replace_box(tree: dict[str, Any], box: BoxPlacement, pose: dict[str, float]) -> None:
    """Give a box another pose on the ground; one of the map becomes one of the scenario."""
    if box.name not in tree["boxes"]:
        tree["removed_boxes"] = (*tree["removed_boxes"], box.name)
    tree["boxes"][box.name] = {**pose, "size": box.size, "mass": box.mass}


def _check_known(name: str, known: Collection[str]) -> None:
    if name not in known:
        raise CommandError(f"'{name}' is not in this world. {suggest(name, list(known))}")
