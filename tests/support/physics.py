"""Worlds on a plane with a modified vehicle, for tests with a known answer."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import autodrive
from autodrive import Command, Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from tests.support.cars import car_file

WorldWith = Callable[..., World]

ROLLS_FREELY = {"wheels.damping_rate": 0.0, "body.drag": 0.0, "body.angular_drag": 0.0}
"""Changes of a vehicle file: no resistance except the tyres."""


def world_with_car(
    folder: Path,
    vehicle: str = "nigel",
    changes: dict[str, Any] | None = None,
    boxes: dict[str, BoxSpec] | None = None,
    substep: float = 0.001,
    engine: Literal["auto", "always"] = "auto",
) -> World:
    """A world on the plane. `changes`: keys in the vehicle's file, such as 'wheels.damping_rate', and their values."""
    car = car_file(folder, changes or {}, vehicle)
    spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car)}, boxes=boxes or {}, substep=substep)
    return autodrive.make(spec, engine=engine)


def drive(world: World, seconds: float, throttle: float = 0.0, steering: float = 0.0) -> Frame:
    """Drives vehicle V1 with a constant command; returns the last Frame."""
    frame = world.frame
    for _ in range(round(seconds / world.tick_duration)):
        frame = world.step({"V1": Command(throttle=throttle, steering=steering)})
    return frame


def magic_formula(slip: float, friction: float, stiffness: float, shape: float, curvature: float) -> float:
    """Force per load by Pacejka (4.6), with D, C, E and B = K / (C D)."""
    x = stiffness / (shape * friction) * slip
    return friction * math.sin(shape * math.atan(x - curvature * (x - math.atan(x))))
