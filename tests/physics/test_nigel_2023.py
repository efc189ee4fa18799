"""nigel_2023 against drives recorded with the original simulator (AutoDRIVE-Nigel-Dataset, 2023)."""

import math
from functools import cache

import numpy as np
import pytest

import autodrive
from autodrive import Command, VehicleFrame
from autodrive.scenario import ScenarioSpec, VehiclePlacement

WHEELBASE = 0.14154
SPEEDS = dict(
    enumerate((0.02867, 0.05685, 0.08457, 0.11185, 0.13871, 0.16516, 0.19122, 0.21688, 0.24215, 0.26703), start=1)
)
"""Tenths of full throttle -> steady speed [m/s]."""
CURVATURES = {0.07: 0.90, 0.13: 0.912, 0.17: 0.918, 0.21: 0.927, 0.24: 0.945, 0.26: 0.961, 0.31: 0.971, 0.36: 0.973}
"""Steering angle [rad] -> curvature of the path, in units of tan(angle) / wheelbase."""
SPEED_RATIOS = {0.0: 1.111, 0.17: 1.13, 0.21: 1.15, 0.24: 1.19, 0.26: 1.23, 0.31: 1.28, 0.36: 1.32}
"""Steering angle [rad] -> speed of the rear treads divided by speed over ground, at full throttle."""


@cache
def steady(throttle: float, angle: float) -> VehicleFrame:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type="nigel_2023")}))
    for _ in range(300):
        world.step({"V1": Command(throttle, angle / math.radians(30))})
    return world.frame.vehicles["V1"]


# The tolerances of the next three tests are the figures of docs/vehicle.md.


@pytest.mark.parametrize("tenths", SPEEDS)
def test_steady_speed_is_the_recorded_one(tenths: int) -> None:
    assert steady(tenths / 10, 0.0).speed == pytest.approx(SPEEDS[tenths], rel=0.0015)


@pytest.mark.parametrize("angle", CURVATURES)
def test_curvature_is_the_recorded_one(angle: float) -> None:
    car = steady(1.0, angle)
    curvature = car.angular_velocity[2] / math.hypot(*car.velocity[:2])
    assert curvature * WHEELBASE / math.tan(angle) == pytest.approx(CURVATURES[angle], rel=0.020)


@pytest.mark.parametrize("angle", SPEED_RATIOS)
def test_rear_wheels_slip_as_recorded(angle: float) -> None:
    car = steady(1.0, angle)
    tread = 0.0325 * float(np.mean(car.wheels.angular_velocity[2:]))
    assert tread / math.hypot(*car.velocity[:2]) == pytest.approx(SPEED_RATIOS[angle], rel=0.027)


def test_steering_unwinds_as_fast_as_recorded() -> None:
    """Two rows of a recorded drive: 0.307 rad, and 44 ms later straight."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type="nigel_2023")}, tick=0.004))
    for _ in range(100):
        world.step({"V1": Command(1.0, 0.307 / math.radians(30))})
    assert world.frame.vehicles["V1"].steering == pytest.approx(0.307)
    for _ in range(11):
        world.step({"V1": Command(1.0, 0.0)})
    assert world.frame.vehicles["V1"].steering == 0.0
