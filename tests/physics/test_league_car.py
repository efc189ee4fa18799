"""The league's car against an independent integration of its published values: four wheels on a plane.

The planar model below shares no code with the simulator. Its values are those of the published project, as in
`roboracer.yaml`; its formulas are those of PhysX 4.1 (`PxVehicleUpdate.cpp`) for the slips, Unity's friction curve, and
statics for the loads.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve, root_scalar

import autodrive
from autodrive import Command
from autodrive.base.arrays import Floats
from autodrive.protocol.devkit import telemetry
from autodrive.protocol.devkit_profile import PROFILES
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world import World
from tests.support.maps import map_file
from tests.support.tables import cells

G = 9.81
MASS, DRAG, RADIUS, WHEEL_MASS, DAMPING = 3.470, 0.273, 0.059, 0.109, 0.25
TORQUE, BRAKE = 428.0 / 4, 428.0
AHEAD, UP, HUB_AHEAD, HUB_UP, TRACK, WHEELBASE = 0.15532, 0.01434, 0.330, 0.010, 0.236, 0.324
FORWARD, SIDEWAYS = (0.15, 0.72, 0.25, 0.464, 2.43), (0.01, 1.0, 0.10, 0.5, 1.0)
YAW_INERTIA, SPRING = 0.04372, 500.0
FULL = TORQUE / DAMPING * RADIUS
"""Speed of the treads at full throttle [m/s]."""


def curve(slip: float, extremum: float, peak: float, asymptote: float, rest: float, slope: float) -> float:
    """Force divided by load: cubic Hermite pieces through (0, 0), the extremum and the asymptote."""
    if slip >= asymptote:
        return rest
    if slip >= extremum:
        t = (slip - extremum) / (asymptote - extremum)
        return peak + (rest - peak) * (3 * t**2 - 2 * t**3)
    t = slip / extremum
    return peak * (slope * (t**3 - 2 * t**2 + t) + 3 * t**2 - 2 * t**3)


def forces(
    forward: float, side: float, turn: float, acceleration: tuple[float, float], throttle: float, steering: float
) -> tuple[float, float, float]:
    """Tyre forces forward and to the left [N] and their yaw moment [N m].

    For the velocity of the centre of mass in the axes of the body [m/s], the yaw rate and the steering angle [rad].
    """
    totals = np.zeros(3)
    for w, load in enumerate(loads(*acceleration, forward, side)):
        x, y = (HUB_AHEAD if w < 2 else 0.0) - AHEAD, TRACK / 2 * (-1) ** w
        t = math.tan(steering) if w < 2 else 0.0
        angle = math.atan(WHEELBASE * t / (WHEELBASE - y * t))  # Ackermann
        c, s = math.cos(angle), math.sin(angle)
        vx, vy = forward - turn * y, side + turn * x
        f, g = wheel(c * vx + s * vy, c * vy - s * vx, load, throttle)
        ux, uy = c * f - s * g, s * f + c * g
        totals += ux, uy, x * uy - y * ux
    return float(totals[0]), float(totals[1]), float(totals[2])


def loads(ax: float, ay: float, forward: float, side: float) -> list[float]:
    """Loads of equal springs at the corners [N], which carry the weight and the moment of the tyre forces.

    `ax` and `ay`: acceleration of the centre of mass [m/s^2]. It is `height` above the ground; when the body leans, the
    weight leans with it.
    """
    height = RADIUS + UP - AHEAD * HUB_UP / HUB_AHEAD
    force_x, force_y = MASS * (ax + DRAG * forward), MASS * (ay + DRAG * side)
    back = force_x * height / (SPRING * HUB_AHEAD**2 - MASS * G * height)
    right = force_y * height / (SPRING * TRACK**2 - MASS * G * height)
    front_share = AHEAD / HUB_AHEAD
    loads_of_wheels = []
    for w in range(4):
        rest = 0.5 * MASS * G * (front_share if w < 2 else 1.0 - front_share)
        x, y = HUB_AHEAD / 2 * (1 if w < 2 else -1), TRACK / 2 * (-1) ** w
        loads_of_wheels.append(max(0.0, rest - SPRING * (back * x + right * y)))
    return loads_of_wheels


def wheel(along: float, across: float, load: float, throttle: float) -> tuple[float, float]:
    """Forces of a wheel along and across [N], at the spin at which its torques balance."""

    def tyre(spin: float) -> tuple[float, float]:
        tread = RADIUS * spin
        ratio = (tread - along) / (max(abs(along), abs(tread)) + 0.1) / FORWARD[0]
        slide = math.atan(across / (abs(along) + 1.0)) / SIDEWAYS[0]
        length = max(math.hypot(ratio, slide), 1e-12)
        f = load * curve(length * FORWARD[0], *FORWARD) * ratio / length
        return f, -load * curve(length * SIDEWAYS[0], *SIDEWAYS) * slide / length

    if throttle == 0.0:  # 428 N m lock the wheel
        return tyre(0.0)
    balance = root_scalar(lambda spin: DAMPING * spin + RADIUS * tyre(spin)[0] - throttle * TORQUE, bracket=(-900, 900))
    return tyre(balance.root)


def steady(throttle: float, steering: float = 0.0) -> tuple[float, float, float]:
    """Velocity of the centre of mass forward and to the left, and yaw rate, at which nothing changes any more."""

    def changes(state: Floats) -> list[float]:
        u, v, r = state.tolist()
        fx, fy, moment = forces(u, v, r, (-r * v, r * u), throttle, steering)
        return [fx / MASS - DRAG * u + r * v, fy / MASS - DRAG * v - r * u, moment / YAW_INERTIA]

    turn = math.tan(steering) / HUB_AHEAD
    speed = 0.9 * FULL * throttle
    (u, v, r), _, found, text = fsolve(changes, [speed, AHEAD * turn * speed, turn * speed], full_output=True)
    assert found == 1, text
    return float(u), float(v), float(r)


def straight(speed: float, throttle: float, end: float) -> tuple[float, float]:
    """Time [s] and distance [m] from a speed to another one."""
    time = distance = acceleration = 0.0
    rises = end > speed
    while (speed < end) == rises:
        acceleration = forces(speed, 0.0, 0.0, (acceleration, 0.0), throttle, 0.0)[0] / MASS - DRAG * speed
        speed, time, distance = speed + 5e-4 * acceleration, time + 5e-4, distance + 5e-4 * speed
    return time, distance


@cache
def car() -> World:
    return autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type="roboracer")}))


class Driven:
    """The simulator's car, from rest."""

    def __init__(self) -> None:
        self.world = car()
        self.world.reset()
        self.drive(0.0, 1.0)

    def drive(self, throttle: float, seconds: float, steering: float = 0.0) -> None:
        for _ in range(round(100 * seconds)):
            self.world.step({"V1": Command(throttle, steering)})

    @property
    def speed(self) -> float:
        """Forward speed of the rear axle [m/s]; without a turn, that of the centre of mass."""
        return float(np.linalg.norm(self.world.compiled.state.vehicle_velocity[0]))

    @property
    def position(self) -> Floats:
        return self.world.compiled.state.vehicle_position[0].copy()


PAGE = (Path(__file__).parents[2] / "docs" / "race_car.md").read_text(encoding="utf-8")
TABLE = cells(PAGE, "| figure of `roboracer` |")


def agrees(row: str, here: float, computed: float, relative: float = 0.01) -> None:
    """Both figures agree within 1 %, and the table of the documents has them."""
    assert here == pytest.approx(computed, rel=relative)
    stated = [float(text.split()[0]) for text in TABLE[row]]
    digits = len(TABLE[row][0].split()[0].partition(".")[2])
    assert stated == pytest.approx([here, computed], abs=0.51 * 10**-digits)


@pytest.mark.parametrize("throttle", [0.2, 0.3, 0.5])
def test_steady_speed(throttle: float) -> None:
    driven = Driven()
    driven.drive(throttle, 25.0)
    agrees(f"steady speed at throttle {throttle}", driven.speed, steady(throttle)[0])


def test_top_speed_is_that_of_the_guide() -> None:
    """With a throttle that keeps the tyres below their peak; at once, they spin, and the car reaches 16.7 m/s."""
    driven = Driven()
    for throttle in np.arange(0.02, 1.0, 0.001).tolist():
        driven.drive(throttle, 0.02)
    driven.drive(1.0, 25.0)
    agrees("top speed, throttle raised slowly", driven.speed, steady(1.0)[0])
    assert driven.speed == pytest.approx(22.88, rel=0.01)
    driven = Driven()
    driven.drive(1.0, 30.0)
    agrees("top speed, full throttle from rest", driven.speed, 0.464 * G / DRAG)


def test_acceleration() -> None:
    driven = Driven()
    start = driven.world.time
    while driven.speed < 5.0:
        driven.drive(0.3, 0.01)
    time = straight(0.0, 0.3, 5.0)[0]
    agrees("0 to 5 m/s at throttle 0.3", driven.world.time - start, time, 0.01 + 0.01 / time)  # a tick


@pytest.mark.parametrize("throttle", [0.0, 0.01])
def test_way_to_slow_down(throttle: float) -> None:
    """With a small throttle the damping of the wheels slows the car down as the brakes do: it never coasts."""
    driven = Driven()
    driven.drive(0.35, 25.0)
    while driven.speed > 8.0:
        driven.drive(throttle, 0.01)
    speed, start = driven.speed, driven.position
    while driven.speed > 1.0:
        driven.drive(throttle, 0.01)
    distance = straight(speed, throttle, driven.speed)[1]
    agrees(f"8 to 1 m/s at throttle {throttle:g}", float(np.linalg.norm(driven.position - start)), distance)


@pytest.mark.parametrize(("degrees", "throttle"), [(30, 0.02), (30, 0.08), (10, 0.05), (10, 0.12)])
def test_circle(degrees: int, throttle: float) -> None:
    driven = Driven()
    driven.drive(throttle, 10.0, degrees / 30.0)
    radius = driven.speed / float(driven.world.compiled.state.vehicle_angular_velocity[0, 2])
    u, v, r = steady(throttle, math.radians(degrees))
    agrees(f"circle with {degrees} degrees, throttle {throttle}", radius, math.hypot(u, v - r * AHEAD) / r)


def test_it_stands_nose_down_and_its_scan_is_level() -> None:
    """10 mm over 330 mm. Pitched rays would hit the ground 5 m ahead; level ones hit nothing on a plane."""
    driven = Driven()
    frame = driven.world.frame.vehicles["V1"]
    pitch = math.atan2(0.010, 0.330)
    lean = MASS * G * (RADIUS + UP) * pitch / (SPRING * HUB_AHEAD**2)  # of the weight, which leans forward
    assert frame.imu.euler[1] == pytest.approx(pitch + lean, rel=0.01)
    assert frame.lidar is not None
    assert len(frame.lidar.ranges) == 1081
    assert frame.lidar.angle_min + 1080 * frame.lidar.angle_increment == pytest.approx(math.radians(135.0))
    assert np.isposinf(frame.lidar.ranges).all()


def test_a_pitched_lidar_that_is_level_measures_horizontal_distances(tmp_path: Path) -> None:
    """The walls of a room around a car with another heading, by the closed form of a box."""
    corners = [[-4.01, -3.01], [4.01, -3.01], [4.01, 3.01], [-4.01, 3.01], [-4.01, -3.01]]
    walls = [{"name": "room", "points": corners, "thickness": 0.02, "height": 0.3}]
    vehicle = VehiclePlacement(type="roboracer", x=0.5, yaw_deg=40.1)
    world = autodrive.make(ScenarioSpec(map=map_file(tmp_path, walls=walls), vehicles={"V1": vehicle}))
    car = world.frame.vehicles["V1"]
    assert car.lidar is not None
    pitch, yaw = car.imu.euler[1], math.radians(40.1)
    ahead = 0.2733 * math.cos(pitch) + 0.096 * math.sin(pitch)
    x, y = 0.5 + ahead * math.cos(yaw), ahead * math.sin(yaw)
    bearings = yaw + np.radians(np.linspace(-135.0, 135.0, 1081))
    c, s = np.cos(bearings), np.sin(bearings)
    expected = np.minimum((np.where(c > 0, 4.0, -4.0) - x) / c, (np.where(s > 0, 3.0, -3.0) - y) / s)
    assert car.lidar.ranges == pytest.approx(expected, abs=1e-9)


def test_devkit_velocity_is_that_of_the_centre_of_mass() -> None:
    driven = Driven()
    driven.drive(0.08, 3.0, 1.0)
    frame = driven.world.frame
    car = frame.vehicles["V1"]
    sent = telemetry(frame, PROFILES["roboracer"])["V1 Linear Velocity"]
    centre = np.array([AHEAD, 0.00008, UP])
    expected = car.velocity + np.cross(car.angular_velocity, centre)
    assert [float(text) for text in sent.split()] == pytest.approx(expected.tolist(), abs=6e-5)
    assert abs(expected[1] - car.velocity[1]) > 0.3


def test_image_has_the_angles_of_the_lens() -> None:
    """3.04 mm and 3.68 mm of the sensor, which the width of the image fills."""
    camera = load_vehicle("roboracer").cameras["front"]
    k = camera.intrinsics
    assert (camera.width, camera.height) == (192, 108)
    assert k.fx == pytest.approx(192 * 3.04 / 3.68)
    assert k.fy == pytest.approx(k.fx)
    assert math.degrees(2 * math.atan(54 / k.fy)) == pytest.approx(37.60, abs=0.01)
    assert math.degrees(2 * math.atan(96 / k.fx)) == pytest.approx(62.37, abs=0.01)
