"""A wheel that rolls over the edge of a box: its axle follows the circle around the edge."""

import math

import numpy as np
import pytest

from autodrive import Command
from autodrive.base.transforms import rotate
from autodrive.physics.model import BOX
from autodrive.physics.ray import MISS, cast_ray
from autodrive.physics.wheel_edge import CLIMBABLE, edge_support
from autodrive.scenario import BoxSpec
from tests.support.cars import OBEYS_AT_ONCE
from tests.support.physics import ROLLS_FREELY, WorldWith, drive

RADIUS = 0.0325


def plate(height: float, mass: float = 20.0) -> BoxSpec:
    return BoxSpec(x=0.6, y=0.0, size=(0.4, 0.4, height), mass=mass)


def test_the_axle_of_a_rolling_wheel_follows_the_circle_around_an_edge(world_with: WorldWith) -> None:
    world = world_with(boxes={"plate": plate(0.005)})
    hub = world.compiled.model.wheels[0]["hub"]
    on_edge = 0
    while world.time < 6.0:
        frame = world.step({"V1": Command(0.4, 0.0)})
        car, top = frame.vehicles["V1"], float(frame.objects["plate"].pose.position[2]) + 0.0025
        up = np.array(rotate(car.pose.orientation, (0.0, 0.0, 1.0)))
        hub_in_map = car.pose.position + rotate(car.pose.orientation, tuple(hub))
        x, _, z = hub_in_map + car.wheels.compression[0] * up
        edge = min(max(x, 0.4), 0.8)  # the nearest point of the top
        expected = RADIUS
        if abs(x - edge) < RADIUS:
            expected = max(RADIUS, top + math.sqrt(RADIUS**2 - (x - edge) ** 2))
            on_edge += edge != x and expected > RADIUS
        if car.wheels.normal_load[0] > 0.0:  # it may lift off for an instant behind an edge
            # the compression was found 1 ms before this pose: 0.1 mm at 0.1 m/s; pitch: r (1 - cos 0.04) = 0.03 mm
            assert z == pytest.approx(expected, abs=2e-4)
        if x > 1.0:
            break
    assert on_edge > 15


def test_a_low_edge_hardly_shakes_the_car(world_with: WorldWith) -> None:
    """Figures of docs/vehicle.md; a single ray below the axle gives 4.1 mm and 19 m/s^2."""
    world = world_with(boxes={"plate": plate(0.005)})
    heights, accelerations = [], []
    for _ in range(350):
        car = world.step({"V1": Command(1.0, 0.0)}).vehicles["V1"]
        heights.append(float(car.pose.position[2]) - RADIUS - 0.005)
        accelerations.append(abs(float(car.imu.linear_acceleration[2])))
    assert max(heights) < 0.0018
    assert max(accelerations) < 11.0


@pytest.mark.parametrize("height", [0.002, 0.005, 0.008])
@pytest.mark.parametrize("throttle", [1.0, -1.0])
def test_an_edge_gives_no_energy_to_a_coasting_car(world_with: WorldWith, height: float, throttle: float) -> None:
    free = {**ROLLS_FREELY, **OBEYS_AT_ONCE, "drivetrain.brake_torque": 0.0, "wheels.suspension.damping": 0.0}
    side = math.copysign(1.0, throttle)
    world = world_with(changes=free, boxes={"plate": plate(height, 200.0).model_copy(update={"x": 0.8 * side})})
    drive(world, 0.6, throttle)
    before = abs(world.frame.vehicles["V1"].speed)
    for _ in range(400):
        car = world.step({"V1": Command(0.0, 0.0)}).vehicles["V1"]
        assert abs(car.speed) < before + 0.09  # while it rolls down, by v dv = g dz / 2
    assert abs(world.frame.vehicles["V1"].speed) < before


@pytest.mark.parametrize(("height", "is_climbed"), [(0.008, True), (0.014, False)])
def test_an_edge_of_two_fifths_of_the_radius_stops_the_car(
    world_with: WorldWith, height: float, is_climbed: bool
) -> None:
    world = world_with(boxes={"plate": plate(height)})
    assert (drive(world, 3.0, 1.0).vehicles["V1"].pose.position[0] > 1.0) == is_climbed


def test_the_wheel_rests_on_the_highest_point_below_its_circle() -> None:
    """Against vertical rays along the circle, for level boxes of any size and heading."""
    rng = np.random.default_rng(0)
    across = np.linspace(-RADIUS, RADIUS, 401)
    edges = 0
    for _ in range(200):
        size = np.array([*rng.uniform(0.002, 0.05, 2), 0.02])
        yaw = rng.uniform(-math.pi, math.pi)
        c, s = math.cos(yaw), math.sin(yaw)
        turned = np.array([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0])
        centre = np.array([*rng.uniform(-0.05, 0.05, 2), rng.uniform(-1.0, -CLIMBABLE) * RADIUS - 0.02])

        def top(a: float, size=size, centre=centre, turned=turned) -> float:
            distance = cast_ray(BOX, size, centre, turned, a, 0.0, 1.0, 0.0, 0.0, -1.0)[0]
            return -MISS if distance == MISS else 1.0 - distance

        expected = max(top(a) + math.sqrt(RADIUS**2 - a * a) for a in across)
        hub, heading = -centre @ turned.reshape(3, 3), (c, -s, 0.0)
        found, ahead = edge_support(size, tuple(hub), heading, (0.0, 0.0, 1.0), RADIUS)
        below = top(0.0) + RADIUS
        if found > below:
            edges += expected > -RADIUS
            # rays are 0.163 mm apart; the slope of the circle is ahead / below the axle
            spacing = 1.63e-4 * abs(ahead) / math.sqrt(RADIUS**2 - ahead**2)
            assert expected - 1e-12 <= found
            assert expected < -RADIUS or found == pytest.approx(expected, abs=1.2 * spacing)
        else:
            assert below == pytest.approx(expected, abs=1e-12)
    assert edges > 50
