"""The drive of each included vehicle with shorter and longer substeps: errors of first order, and the documents."""

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.base.arrays import Floats
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import names
from autodrive.world import World
from tests.support.cars import top_tread_speed
from tests.support.physics import drive
from tests.support.tables import cells

DOCUMENT = Path(__file__).parents[2] / "docs" / "vehicle.md"
TABLE = cells(DOCUMENT.read_text(encoding="utf-8"), "| vehicle | longest stable substep |")
RACE_CARS = ("roboracer", "roboracer_physical", "roboracer_f1tenth", "neoracer")
FINE = 0.00003125
EACH = pytest.mark.parametrize("vehicle", [name for name in names("vehicle") if f"`{name}`" in TABLE])


def world_of(vehicle: str, substep: float) -> World:
    return autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, substep=substep))


@cache
def end_of_slalom(vehicle: str, substep: float) -> Floats:
    """Position after 3 s from rest with at most half of the lock; at 2 m/s, or with a throttle of 0.8."""
    world = world_of(vehicle, substep)
    throttle = 2.0 / top_tread_speed(vehicle) if vehicle in RACE_CARS else 0.8
    for k in range(300):
        world.step({"V1": Command(throttle, 0.5 * math.sin(0.02 * k))})
    return world.compiled.state.vehicle_position[0].copy()


@cache
def braking_distance(vehicle: str, substep: float) -> float:
    """From 8 m/s at the treads, or from full speed."""
    world = world_of(vehicle, substep)
    for _ in range(500):
        world.step({"V1": Command(min(1.0, 8.0 / top_tread_speed(vehicle)))})
    start = world.compiled.state.vehicle_position[0].copy()
    for _ in range(300):
        world.step({"V1": Command()})
    return float(np.linalg.norm(world.compiled.state.vehicle_position[0] - start))


@cache
def end_of_slide(vehicle: str, substep: float) -> Floats:
    """Position of a vehicle with locked wheels that slid with a slip angle of 0.5 rad and a yaw rate of 2 rad/s."""
    world = world_of(vehicle, substep)
    for _ in range(100):  # it comes to rest on its wheels
        world.step()
    speed = 6.0 if vehicle in RACE_CARS else 0.27 if vehicle == "nigel_2023" else 0.44
    state = world.compiled.state
    state.qvel[:2] = speed * math.cos(0.5), speed * math.sin(0.5)
    state.qvel[5] = 2.0
    for _ in range(300):
        world.step()
    return state.vehicle_position[0].copy()


@EACH
def test_the_end_of_a_slalom_converges_with_first_order_in_the_substep(vehicle: str) -> None:
    substeps = np.array([0.00025, 0.0005, 0.001, 0.002])
    fine = end_of_slalom(vehicle, FINE)
    errors = np.array([float(np.linalg.norm(end_of_slalom(vehicle, h) - fine)) for h in substeps.tolist()])
    constant = errors / (substeps - FINE)  # of the error h - FINE of a result of first order
    # the second order contributes, most with 2 ms
    assert constant[1:3] == pytest.approx(constant[0], rel=0.25)
    assert constant[3] == pytest.approx(constant[0], rel=0.4 if vehicle in ("roboracer", "neoracer") else 0.25)
    assert figures(vehicle, 3) == pytest.approx(1e3 * errors, rel=0.06, abs=0.006)  # two digits


@EACH
def test_braking_distance_and_slide_are_those_of_the_documents(vehicle: str) -> None:
    substeps = (0.001, 0.002, 0.0025)
    longer = [braking_distance(vehicle, h) / braking_distance(vehicle, 0.0002) - 1.0 for h in substeps]
    assert figures(vehicle, 1) == pytest.approx([100.0 * share for share in longer], abs=0.06)  # [%], one decimal
    fine = end_of_slide(vehicle, 0.0002)
    away = [1e3 * float(np.linalg.norm(end_of_slide(vehicle, h) - fine)) for h in substeps]
    assert figures(vehicle, 2) == pytest.approx(away, rel=0.06, abs=0.06)  # [mm]


def figures(vehicle: str, column: int) -> list[float]:
    """The numbers of a column of the table in the document."""
    return [float(number) for number in re.findall(r"-?[\d.]+", TABLE[f"`{vehicle}`"][column])]


def test_stiff_springs_without_dampers_do_not_hop_with_short_substeps() -> None:
    """nigel_2023 on full lock: the look-ahead of its springs, their only damping, is a time."""
    radii = []
    for substep in (0.0001, 0.001):
        world = world_of("nigel_2023", substep)
        drive(world, 1.0, throttle=1.0, steering=1.0)
        for _ in range(300):
            world.step({"V1": Command(1.0, 1.0)})
            assert world.compiled.state.wheel_normal_load.min() > 0.0
        car = world.frame.vehicles["V1"]
        radii.append(car.speed / car.angular_velocity[2])
    assert radii[0] == pytest.approx(radii[1], rel=1e-3)
