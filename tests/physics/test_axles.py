"""Drive layouts: driven wheels get the motors' torque, braked wheels the brakes', and the car moves accordingly."""

import math

import numpy as np
import pytest

from autodrive.base.yaml_files import parse
from autodrive.scenario.vehicles.spec import AxlesSpec
from tests.support.cars import OBEYS_AT_ONCE
from tests.support.physics import ROLLS_FREELY, WorldWith, drive

MASS, RADIUS = 1.75, 0.0325
WHEEL_INERTIA = 0.5 * 0.034 * RADIUS**2
TORQUE = 0.02  # N m at each driven wheel: a tenth of what the tyres can transmit
LAYOUTS = {
    "rear": {},
    "front": {"axles.front.is_driven": True, "axles.rear.is_driven": False},
    "all": {"axles.front.is_driven": True},
}
DRIVEN = {"rear": [False, False, True, True], "front": [True, True, False, False], "all": [True] * 4}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_acceleration_follows_from_the_torque_of_the_driven_wheels(world_with: WorldWith, layout: str) -> None:
    torque_control = {
        "drivetrain.control": "torque",
        "drivetrain.torque_limit": TORQUE,
        "drivetrain.speed_limit_rpm": 1000.0,
    }
    world = world_with(changes={**LAYOUTS[layout], **OBEYS_AT_ONCE, **ROLLS_FREELY, **torque_control})
    before = drive(world, 0.2, throttle=1.0).vehicles["V1"]
    car = drive(world, 0.2, throttle=1.0).vehicles["V1"]
    driven = np.array(DRIVEN[layout])
    # rolling without slip: n T / r = (m + 4 I / r^2) a
    expected = driven.sum() * TORQUE / RADIUS / (MASS + 4 * WHEEL_INERTIA / RADIUS**2)
    acceleration = (car.speed - before.speed) / 0.2
    assert acceleration == pytest.approx(expected, rel=0.02)  # the slip of the driven wheels grows with the speed
    # each wheel: I dw/dt = T - r F
    force = world.compiled.state.wheel_force[:, 0]
    assert force == pytest.approx(
        (driven * TORQUE - WHEEL_INERTIA * acceleration / RADIUS) / RADIUS, rel=0.03, abs=0.005
    )


@pytest.mark.parametrize("layout", LAYOUTS)
def test_driven_wheels_reach_the_speed_of_the_throttle_and_the_car_turns_left(
    world_with: WorldWith, layout: str
) -> None:
    world = world_with(changes={**LAYOUTS[layout], **ROLLS_FREELY})
    car = drive(world, 3.0, throttle=0.5, steering=0.3).vehicles["V1"]
    spin = car.wheels.angular_velocity[np.array(DRIVEN[layout])]
    assert spin.mean() == pytest.approx(0.5 * 130 * 2 * math.pi / 60, rel=1e-3)  # the servo's gain is finite
    assert car.speed == pytest.approx(spin.mean() * RADIUS, rel=0.04)  # front wheels run on a larger circle: 1 / cos
    radius = 0.14154 / math.tan(math.radians(9.0))
    assert car.angular_velocity[2] == pytest.approx(car.speed / radius, rel=0.04)  # less by the slip


@pytest.mark.parametrize("braked", ["front", "rear"])
def test_only_braked_wheels_lock(world_with: WorldWith, braked: str) -> None:
    other = "rear" if braked == "front" else "front"
    world = world_with(changes={f"axles.{other}.is_braked": False, **OBEYS_AT_ONCE, **ROLLS_FREELY})
    drive(world, 1.5, throttle=1.0)
    car = drive(world, 0.01, throttle=0.0).vehicles["V1"]
    rows = {"front": slice(0, 2), "rear": slice(2, 4)}
    assert car.wheels.angular_velocity[rows[braked]] == pytest.approx(0.0, abs=1e-6)
    assert car.wheels.angular_velocity[rows[other]] * RADIUS == pytest.approx(car.speed, rel=0.1)
    assert drive(world, 1.0, throttle=0.0).vehicles["V1"].speed == pytest.approx(0.0, abs=1e-3)


def test_axles_may_be_omitted() -> None:
    axles = parse("{}", AxlesSpec)
    assert (axles.front.is_driven, axles.rear.is_driven) == (False, True)
