"""Worlds with a changed car, for tests with a known answer."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

import autodrive
from autodrive.descriptions import find
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World

WorldWith = Callable[..., World]


@pytest.fixture
def world_with(tmp_path: Path) -> WorldWith:
    """Makes a world on the plane; `changes`: places in the vehicle's file, as 'wheels.damping_rate', to values."""

    def make(
        vehicle: str = "nigel",
        changes: dict[str, Any] | None = None,
        boxes: dict[str, BoxSpec] | None = None,
        substep: float = 0.001,
    ) -> World:
        tree = yaml.safe_load(find("vehicle", vehicle).read_text())
        for place, value in (changes or {}).items():
            *path, last = place.split(".")
            branch = tree
            for part in path:
                branch = branch[part]
            branch[last] = value
        file = tmp_path / "car.yaml"
        file.write_text(yaml.safe_dump(tree))
        return autodrive.make(
            ScenarioSpec(vehicles={"V1": VehiclePlacement(type=str(file))}, boxes=boxes or {}, substep=substep)
        )

    return make


NO_DELAYS = {
    "steering.dead_time": 0.0,
    "steering.time_constant": 0.0,
    "drivetrain.dead_time": 0.0,
    "drivetrain.time_constant": 0.0,
}
"""Actuators that obey at once."""

ROLLS_FREELY = {"wheels.damping_rate": 0.0, "body.drag": 0.0, "body.angular_drag": 0.0}
"""A car that nothing but its tyres holds back."""
