"""Copies of vehicle files with changed values."""

from pathlib import Path
from typing import Any

import yaml

from autodrive.scenario.kinds import find
from autodrive.scenario.vehicles.spec import load_vehicle

IDENTIFIED = ("dart", "f1tenth_mocap")
"""Vehicles that were identified from logs of real cars: these logs judge them, not the tables of docs/vehicle.md."""

OBEYS_AT_ONCE = {
    "steering.dead_time": 0.0,
    "steering.time_constant": 0.0,
    "drivetrain.dead_time": 0.0,
    "drivetrain.time_constant": 0.0,
}
"""Changes of a vehicle file: actuators without dead time and lag; the rate limit of the steering remains."""


def small_images(width: int, height: int) -> dict[str, int]:
    """Changes of a vehicle file: both cameras have images of that size [pixels]."""
    names = ("front", "rear")
    return {f"cameras.{name}.{edge}": size for name in names for edge, size in (("width", width), ("height", height))}


def top_tread_speed(vehicle: str) -> float:
    """Speed of the treads of an included vehicle at full throttle [m/s]."""
    return load_vehicle(vehicle).full_throttle_speed


def car_file(folder: Path, changes: dict[str, Any], vehicle: str = "nigel") -> str:
    """Path of a changed copy of an included vehicle file; `changes`: keys such as 'steering.dead_time', and values."""
    tree = yaml.safe_load(find("vehicle", vehicle).read_text(encoding="utf-8"))
    for place, value in changes.items():
        *path, last = place.split(".")
        branch = tree
        for part in path:
            branch = branch[part]
        branch[last] = value
    file = folder / "car.yaml"
    file.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(file)
