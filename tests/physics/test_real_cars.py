"""What real cars need of the vehicle model, each part against a closed form: linkage, resistances, motor, tyres."""

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive import Command, make
from autodrive.base.arrays import Floats
from autodrive.base.errors import CommandError, SpecError
from autodrive.base.specs import checked
from autodrive.physics.actuators.steering import SteeringSpec, ackermann_angle
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.vehicles.spec import MagicCurve, VehicleSpec, load_vehicle
from autodrive.world.batch import BatchWorld, Readings
from tests.support.cars import car_file
from tests.support.physics import magic_formula

CAR = load_vehicle("roboracer_f1tenth")
"""No resistances, tyres by the magic formula, four driven wheels, no delays."""
OFF = {"lidar": SensorSettings(is_on=False)}
WHEELS_INERTIA = 2.0 * CAR.wheels.mass * CAR.wheels.radius**2
"""About their axles, all four [kg m^2]."""
MASS = CAR.body.mass + WHEELS_INERTIA / CAR.wheels.radius**2
"""With the inertia of the wheels [kg]."""
LINKAGE = {"curve": [[-1.0, -22.0], [0.0, 0.0], [0.5, 10.0], [1.0, 15.0]], "offset_deg": 1.0}


def car(**changes: Any) -> VehicleSpec:
    """The car with other values; a key such as wheels__damping_rate is a place in its file."""
    tree = CAR.model_dump(mode="json")
    for place, value in changes.items():
        *path, last = place.split("__")
        branch = tree
        for part in path:
            branch = branch[part]
        branch[last] = value
    return checked(tree, VehicleSpec)


class Cars:
    """Drives several cars at once, each on a plane of its own."""

    def __init__(self) -> None:
        spec = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type="roboracer_f1tenth", sensors=OFF)})
        self.batch = BatchWorld(spec, 6, threads=1)

    def start(self, cars: Sequence[VehicleSpec], **settings: Any) -> Readings:
        """Start these cars; `settings`: of `BatchWorld.reset`."""
        return self.batch.reset(np.arange(len(cars)), vehicles={"V1": cars}, **settings)

    def drive(self, seconds: float, throttle: Any = 0.0, steering: Any = 0.0) -> Readings:
        """Drive with a constant command, or one for each of the six worlds."""
        commands = np.empty((6, 1, 2))
        commands[:, 0, 0], commands[:, 0, 1] = throttle, steering
        return self.batch.step(commands, ticks=round(seconds / 0.01))

    def speed(self) -> Floats:
        """Forward speed of each car [m/s]."""
        return self.batch.readings.velocity[:, 0, 0].copy()


@pytest.fixture(scope="module")
def cars() -> Iterator[Cars]:
    driven = Cars()
    with closing(driven.batch):
        yield driven


# -- steering ----------------------------------------------------------------------------------------------------


def test_the_wheels_follow_the_linkage_behind_the_servo(cars: Cars) -> None:
    """A servo of 1.5 rad/s with 24 degrees for the command 1; the command is cut at -0.9 and 0.6."""
    changes = {f"steering__{name}": value for name, value in LINKAGE.items()}
    linked = car(**changes, steering__limit_deg=24.0, steering__rate_limit=1.5, steering__command_limits=[-0.9, 0.6])
    assert cars.start([linked] * 3).steering[:3, 0] == pytest.approx([math.radians(1.0)] * 3)
    limit = math.radians(24.0)
    for tick in range(1, 40):
        readings = cars.drive(0.01, steering=[1.0, -1.0, 0.3, 0.0, 0.0, 0.0])
        for k, target in enumerate((0.6, -0.9, 0.3)):
            servo = math.copysign(min(abs(target), 1.5 * 0.01 * tick / limit), target)
            expected = math.radians(np.interp(servo, *np.transpose(LINKAGE["curve"])) + 1.0)
            assert readings.steering[k, 0] == pytest.approx(expected, abs=1e-12)  # rounding of 10 steps
            half = 0.5 * CAR.track
            wheels = [ackermann_angle(expected, CAR.wheelbase, side) for side in (half, -half)]
            assert readings.wheel_steering_angle[k, 0, :2] == pytest.approx(wheels, abs=1e-12)


def test_trim_and_offset_turn_the_wheels_alike(cars: Cars) -> None:
    """Also of a car without a curve; the circle has the radius of the angle (Rajamani (2.1))."""
    trims = [0.02, 0.0, -0.02]
    cars.start([car(), car(steering__offset_deg=math.degrees(0.02)), car()], trim=trims)
    readings = cars.drive(1.0, throttle=0.02)
    assert readings.steering[:3, 0] == pytest.approx([0.02, 0.02, -0.02], abs=1e-15)
    curvature = readings.angular_velocity[:3, 0, 2] / readings.velocity[:3, 0, 0]
    expected = np.tan(readings.steering[:3, 0]) / CAR.wheelbase
    assert curvature == pytest.approx(expected, rel=0.01)  # the slip of the tyres at 0.4 m/s
    np.testing.assert_array_equal(readings.position[0], readings.position[1])


@given(st.floats(-0.9, 0.6))
def test_commands_for_angles_are_the_inverse_of_the_linkage(command: float) -> None:
    linked = SteeringSpec(
        limit_deg=24.0,
        dead_time=0.0,
        time_constant=0.0,
        command_limits=(-0.9, 0.6),
        **LINKAGE,  # pyright: ignore
    )
    assert linked.commands(linked.angles(command)) == pytest.approx(command, abs=1e-12)  # rounding
    assert linked.commands([1.0, -1.0]).tolist() == [0.6, -0.9]  # the nearest ones
    assert linked.largest_angle == pytest.approx(math.radians(0.9 * 22.0 - 1.0))


# -- resistances -------------------------------------------------------------------------------------------------


def test_a_car_that_coasts_keeps_its_speed_and_another_one_brakes(cars: Cars) -> None:
    controls = "speed", "torque", "voltage"
    coasting = [car(drivetrain__control=c, drivetrain__torque_curve=[], drivetrain__coasts=True) for c in controls]
    cars.start([*coasting, car()], motions={"V1": [2.0, 0.0, 0.0, 0.0, 0.0]})
    cars.drive(0.5)
    assert cars.speed()[:3] == pytest.approx([2.0] * 3, abs=1e-6)  # the magic formula at the slip of a rounding error
    assert cars.speed()[3] < 0.1


def test_rolling_resistance_slows_the_car_evenly_and_then_holds_it(cars: Cars) -> None:
    """Coulomb: a = -c g m / (m + J / r^2), at any speed; at rest nothing moves."""
    c = np.array([0.05, 0.1, 0.1, 0.0])
    coasting = [car(wheels__rolling_resistance=value, drivetrain__coasts=True) for value in c.tolist()]
    speeds = np.array([1.0, 1.0, -0.6, 0.7])
    cars.start(coasting, motions={"V1": [[speed, 0.0, 0.0, 0.0, 0.0] for speed in speeds.tolist()]})
    deceleration = c * 9.81 * CAR.body.mass / MASS
    for _ in range(4):
        cars.drive(0.1)
        time = cars.batch.readings.time[0]
        expected = speeds - np.copysign(deceleration * time, speeds)
        assert cars.speed()[:4] == pytest.approx(expected, abs=0.01)  # load transfer, and the slip of the front wheels
    cars.drive(3.0)
    place = cars.batch.readings.position[:3].copy()
    cars.drive(2.0)
    assert np.abs(cars.batch.readings.position[:3] - place).max() < 1e-6  # 0.5 um/s
    assert np.abs(cars.batch.readings.wheel_angular_velocity[:3]).max() == 0.0


def test_steered_wheels_resist_in_proportion_to_their_angle(cars: Cars) -> None:
    """Of a kinematic car with energy E: dE/dt = -sum of c |angle| load x speed of the wheel."""
    c, v, steering = 0.4, 0.5, 0.8
    rolling = {"drivetrain__coasts": True, "drivetrain__differentials": {}}  # each wheel at its own speed
    slow = [car(wheels__steering_resistance=value, **rolling) for value in (0.0, c)]
    angle = steering * CAR.steering.limit
    rate = v * math.tan(angle) / CAR.wheelbase
    cars.start(slow, motions={"V1": [v, 0.0, rate, 0.0, steering]})
    first = cars.drive(0.1, steering=steering)
    before, angles = cars.speed()[:2], np.abs(first.wheel_steering_angle[1, 0, :2])
    cars.drive(0.3, steering=steering)
    lost = (before - cars.speed()[:2]) / 0.3
    hub, _, _ = CAR.hubs[0]
    centre = np.array([1.0, rate / v * CAR.body.center_of_mass[0]])  # velocity of the centre of mass for v = 1
    wheels = np.array([[1.0 - rate / v * y, rate / v * x] for x, y, _ in CAR.hubs])
    spins = np.hypot(*wheels.T) / CAR.wheels.radius
    inertia = CAR.body.mass * centre @ centre + CAR.body.inertia[2] * (rate / v) ** 2
    inertia += WHEELS_INERTIA / 4 * spins @ spins
    x, _, height = np.add(CAR.body.center_of_mass, (0.0, 0.0, CAR.wheels.radius))
    load = 0.5 * CAR.body.mass * (9.81 * x + lost[1] * height) / hub  # with the transfer of a car that slows down
    expected = c * load * angles @ np.hypot(*wheels[:2].T) / inertia
    assert lost[1] - lost[0] == pytest.approx(expected, rel=0.01)  # the tyres' own drag differs with the speed


# -- motors ------------------------------------------------------------------------------------------------------

VOLTAGE = {
    "drivetrain__control": "voltage",
    "drivetrain__torque_curve": [],
    "drivetrain__torque_limit": 0.1,
    "drivetrain__speed_limit_rpm": 800.0,
    "drivetrain__throttle_curve": [[0.15, 0.0], [1.0, 1.0]],
    "drivetrain__coasts": True,
}


def test_a_motor_with_a_threshold_and_back_emf_accelerates_exponentially(cars: Cars) -> None:
    """m dv/dt = 4 T f (1 - v / (r w)) / r with f = (throttle - 0.15) / 0.85, for batteries of 100 and 80 %."""
    motor = car(**VOLTAGE)
    throttle = np.array([1.0, 0.5, 1.0, 0.1, -0.5, -0.5])
    only_forward = car(**VOLTAGE, drivetrain__has_reverse=False)
    cars.start([motor] * 5 + [only_forward], drive=[1.0, 1.0, 0.8, 1.0, 1.0, 1.0])
    radius, top = CAR.wheels.radius, motor.drivetrain.speed_limit * CAR.wheels.radius
    share = np.sign(throttle) * np.maximum(np.abs(throttle) - 0.15, 0.0) / 0.85
    force = 4.0 * 0.1 / radius * np.abs(share) * [1.0, 1.0, 0.8, 1.0, 1.0, 0.0]
    for _ in range(5):
        cars.drive(0.2, throttle=throttle)
        time = cars.batch.readings.time[0]
        expected = np.sign(share) * top * (1.0 - np.exp(-force * time / (MASS * top)))
        assert cars.speed() == pytest.approx(expected, abs=0.01 * top)  # the slip of the tyres
    assert motor.full_throttle_speed == pytest.approx(top)


def test_a_motor_brakes_beyond_the_speed_of_its_back_emf(cars: Cars) -> None:
    motor = car(**VOLTAGE)
    top = motor.drivetrain.speed_limit * CAR.wheels.radius
    cars.start([motor], motions={"V1": [top + 1.0, 0.0, 0.0, 1.0, 0.0]})
    cars.drive(0.4, throttle=1.0)
    rate = 4.0 * 0.1 / (CAR.wheels.radius * MASS * top)
    assert cars.speed()[0] == pytest.approx(top + math.exp(-0.4 * rate), abs=0.01)  # the slip of the tyres


def test_the_throttle_curve_is_for_torque_control_as_well(cars: Cars) -> None:
    curve = [[0.2, 0.0], [0.5, 0.4], [0.8, 0.4], [1.0, 1.0]]
    motor = car(drivetrain__control="torque", drivetrain__torque_curve=[], drivetrain__throttle_curve=curve)
    cars.start([motor] * 4)
    cars.drive(0.2, throttle=[0.2, 0.35, 0.7, 1.0, 0.0, 0.0])
    force = np.array([0.0, 0.2, 0.4, 1.0]) * 4.0 * CAR.drivetrain.torque_limit / CAR.wheels.radius
    assert cars.speed()[:4] == pytest.approx(0.2 * force / MASS, rel=0.03, abs=1e-9)  # the slip of the tyres


def test_a_speed_controller_has_a_gain_an_offset_and_a_ramp(cars: Cars) -> None:
    """Reference: gain x throttle x full scale + offset, which a limit of 0.5 1/s lets rise by 0.5 x full scale / s."""
    stiff = {"drivetrain__servo_gain": 10.0, "drivetrain__torque_limit": 5.0, "drivetrain__torque_curve": []}
    rpm = 60.0 / (2.0 * math.pi * CAR.wheels.radius)  # of 1 m/s
    stiff["drivetrain__speed_limit_rpm"] = 5.0 * rpm
    calibrated = car(**stiff, drivetrain__speed_gain=0.965, drivetrain__speed_offset_rpm=0.029 * rpm)
    ramp = car(**stiff, drivetrain__rate_limit=0.5)
    cars.start([calibrated, ramp, car(**stiff)], motions={"V1": [2.0, 0.0, 0.0, 0.4, 0.0]})
    cars.drive(1.0, throttle=0.4)
    treads = cars.batch.readings.wheel_angular_velocity[:3, 0].mean(axis=1) * CAR.wheels.radius
    assert treads == pytest.approx([0.029 + 0.965 * 2.0, 2.0, 2.0], abs=1e-3)  # the finite gain of the servo
    readings = cars.drive(0.4, throttle=0.9)
    treads = readings.wheel_angular_velocity[:3, 0].mean(axis=1) * CAR.wheels.radius
    assert treads[1] == pytest.approx(2.0 + 0.4 * 0.5 * 5.0, abs=5e-3)  # the finite gain of the servo
    assert treads[2] > 4.0  # without the ramp


# -- tyres -------------------------------------------------------------------------------------------------------


def test_front_and_rear_tyres_have_their_own_sideways_curves(cars: Cars) -> None:
    """A car that slides sideways: the force of each wheel is that of its curve at the slip that it has."""
    front = {"friction": 0.8, "shape": 0.8, "curvature": 0.0, "load_sensitivity": 0.0}
    rear = {"friction": 1.2, "shape": 1.4, "curvature": -1.0, "load_sensitivity": 0.0}
    tyres = {"sideways": front, "rear_sideways": rear, "peak_stiffness_load": None}
    own = car(**{f"wheels__magic_formula__{name}": value for name, value in tyres.items()})
    cars.start([own], motions={"V1": [3.0, 0.6, 0.0, 0.0, 0.0]})
    cars.drive(0.1, throttle=0.15)
    state = cars.batch.worlds.state
    assert own.wheels.magic_formula is not None
    for w, (curve, stiffness) in enumerate([(front, 4.9487)] * 2 + [(rear, 5.723)] * 2):
        slip = float(state.wheel_lagged_slip[0, w, 1])
        expected = magic_formula(slip, curve["friction"], stiffness, curve["shape"], curve["curvature"])
        force = -state.wheel_force[0, w, 1] / state.wheel_normal_load[0, w]
        assert abs(slip) > 0.01
        assert force == pytest.approx(expected, rel=0.03)  # a little longitudinal slip; the load before the forces


@pytest.mark.parametrize(("shape", "curvature"), [(0.5, 0.0), (0.9, -2.0), (0.7, 1.0), (1.0, 0.0)])
def test_the_greatest_force_is_the_limit_of_the_formula(shape: float, curvature: float) -> None:
    curve = MagicCurve(friction=1.0, shape=shape, curvature=curvature)
    slips = np.geomspace(1e-2, 1e8, 500)
    forces = [magic_formula(slip, 1.0, 1.0, shape, curvature) for slip in slips.tolist()]
    assert curve.greatest_share == pytest.approx(max(forces), rel=1e-6)  # the last slip of the list
    assert (shape < 1.0) == (curve.greatest_share < 1.0)
    assert curve.normalised_peak_slip == 10.0  # it rises everywhere


PUBLISHED = {
    "nuc1": (
        (4.47161357602916, 0.1320293068694414, 12.267008918241816, 1.5562751013900538),
        (10.0, 1.5, 1.320025, 1.1),
    ),
    "nuc2": (
        (4.798521440254997, 2.1640281784621833, 0.6502296853018044, 0.3732212044732381),
        (20.0, 1.5, 0.618418, 0.0),
    ),
}
"""B, C, D, E of the front and the rear tyres that ForzaETH has published."""


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_tyres_of_the_cars_of_forzaeth_are_the_published_ones(name: str) -> None:
    """Up to a slip angle of 0.3 rad, by their own formula: D sin(C atan(B a - E (B a - atan(B a))))."""
    magic = load_vehicle(name).wheels.magic_formula
    assert magic is not None
    assert magic.rear_sideways is not None
    ours = (magic.sideways, magic.front_cornering_stiffness), (magic.rear_sideways, magic.rear_cornering_stiffness)
    for (b, c, d, e), (curve, stiffness) in zip(PUBLISHED[name], ours, strict=True):
        assert stiffness == pytest.approx(b * c * d, rel=1e-4)  # four digits in the file
        for angle in np.linspace(0.0, 0.3, 31).tolist():
            published = d * math.sin(c * math.atan(b * angle - e * (b * angle - math.atan(b * angle))))
            own = magic_formula(math.tan(angle), curve.friction, stiffness, curve.shape, curve.curvature)
            assert own == pytest.approx(published, abs=0.005)  # as the documents say


# -- the session: floor, trim, battery ---------------------------------------------------------------------------


def test_a_named_floor_is_the_same_as_its_grip_factor(tmp_path: Path) -> None:
    taped = car_file(tmp_path, {"wheels.surfaces": {"rubber": 1.0, "tape": 0.43}}, "roboracer_f1tenth")

    def tables(**fields: Any) -> list[Any]:
        spec = ScenarioSpec(vehicles={"V1": VehiclePlacement(type=taped, sensors=OFF, **fields)})
        world = make(spec)
        return [world.compiled.model.wheels[name].tolist() for name in ("magic_forward", "magic_sideways", "sideways")]

    assert tables(surface="tape", grip_factor=0.5) == tables(grip_factor=0.43 * 0.5)
    assert tables(surface="rubber") == tables() != tables(surface="tape")
    with pytest.raises(SpecError, match=r"'tpae' is no floor of 'wheels.surfaces' of .*Did you mean 'tape'"):
        tables(surface="tpae")


# -- a start in motion -------------------------------------------------------------------------------------------

SLOW = {
    "steering.dead_time": 0.03,
    "steering.time_constant": 0.05,
    "steering.curve": LINKAGE["curve"],
    "drivetrain.dead_time": 0.05,
    "drivetrain.time_constant": 0.1,
    "drivetrain.rate_limit": 4.0,
    "drivetrain.coasts": True,
}
ACTUATORS = "throttle", "drive_level", "steering_target", "servo_angle", "steering_angle"


def test_a_start_obeys_past_commands_as_a_car_that_drove_on(tmp_path: Path) -> None:
    """The actuators have the bits of a World that was given the same commands, in a World and in a batch."""
    placed = VehiclePlacement(type=car_file(tmp_path, SLOW, "roboracer_f1tenth"), sensors=OFF, steering_trim=0.01)
    spec = ScenarioSpec(map="plane", vehicles={"V1": placed})
    driven, other, batch = make(spec), make(spec), BatchWorld(spec, 2, threads=1)
    commands = [(math.sin(0.3 * tick), math.cos(0.4 * tick)) for tick in range(60)]
    motion = [1.5, 0.1, 0.2, 0.4, -0.5]
    driven.reset(motions={"V1": motion})
    for throttle, steering in commands[:33]:
        driven.step({"V1": Command(throttle, steering)})
    other.reset(motions={"V1": motion}, past_commands={"V1": commands[:33]})
    batch.reset([1], motions={"V1": motion}, past_commands={"V1": commands[:33]})
    states = driven.compiled.state, other.compiled.state
    for throttle, steering in commands[33:]:
        for name in ACTUATORS:
            expected, got = (getattr(state, name)[0] for state in states)
            assert got == expected == getattr(batch.worlds.state, name)[1, 0], name
        driven.step({"V1": Command(throttle, steering)})
        frame = other.step({"V1": Command(throttle, steering)})
        readings = batch.step(np.tile([throttle, steering], (2, 1, 1)))
        np.testing.assert_array_equal(readings.position[1, 0], frame.vehicles["V1"].pose.position)
    before = other.frame
    assert before.vehicles["V1"].velocity[0] != 0.0
    for wrong in ({"motions": {"V1": [0.0] * 2}}, {"motions": {"V2": motion}}, {"past_commands": {"V1": [[2.0, 0.0]]}}):
        with pytest.raises(CommandError, match=r"V[12]"):
            other.reset(**wrong)  # pyright: ignore[reportArgumentType]
    assert other.frame is before
