"""The magic formula, relaxation lengths and differentials against their definitions and closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.physics import wheel
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.physics import WorldWith, drive, magic_formula, world_with_car

CAR = load_vehicle("roboracer_f1tenth")
MAGIC = CAR.wheels.magic_formula
assert MAGIC is not None
LOAD = MAGIC.nominal_load
FORWARD = (MAGIC.forward.friction, MAGIC.slip_stiffness, MAGIC.forward.shape, MAGIC.forward.curvature)
SIDEWAYS = (MAGIC.sideways.friction, MAGIC.front_cornering_stiffness, MAGIC.sideways.shape, MAGIC.sideways.curvature)
slips = st.floats(-3.0, 3.0)


def force(ratio: float, aside: float, load: float = LOAD) -> tuple[float, float]:
    kx, ky = wheel.magic_stiffness(ratio, aside, load, *FORWARD, *SIDEWAYS)
    return kx * ratio, -ky * aside


@given(slips)
def test_pure_slip_gives_the_formula_of_the_book(slip: float) -> None:
    # the length of the slip vector is at least 1e-9, which adds 1e-9 of the force
    assert force(slip, 0.0)[0] == pytest.approx(LOAD * magic_formula(slip, *FORWARD), rel=1e-6, abs=1e-6)
    assert force(0.0, slip)[1] == pytest.approx(-LOAD * magic_formula(slip, *SIDEWAYS), rel=1e-6, abs=1e-6)


@given(slips, slips)
def test_combined_slip_keeps_to_the_friction_ellipse_and_opposes_the_slip(ratio: float, aside: float) -> None:
    fx, fy = force(ratio, aside)
    assert math.hypot(fx / FORWARD[0], fy / SIDEWAYS[0]) <= LOAD * (1.0 + 1e-12)
    assert fx * ratio >= 0.0 >= fy * aside


def test_the_force_has_its_peak_at_the_peak_slip() -> None:
    assert MAGIC is not None
    peak = MAGIC.sideways.normalised_peak_slip * SIDEWAYS[0] / SIDEWAYS[1]
    grid = np.arange(0.0, 2.0, 1e-3)
    forces = [magic_formula(slip, *SIDEWAYS) for slip in grid.tolist()]
    assert peak == pytest.approx(grid[int(np.argmax(forces))], abs=0.004)  # both are read from grids


@given(st.floats(0.05, 4.0))
def test_cornering_stiffness_is_that_of_the_book(share: float) -> None:
    """K = p_Ky1 F_z0 sin(2 atan(F_z / (p_Ky2 F_z0))), Pacejka (4.E25)."""
    p_ky2 = 2.0
    p_ky1 = 4.9487 / math.sin(2.0 * math.atan(1.0 / p_ky2))
    expected = p_ky1 * math.sin(2.0 * math.atan(share / p_ky2))
    found = share * wheel.cornering_stiffness(4.9487, share * LOAD, LOAD, p_ky2**-2)
    assert found == pytest.approx(expected, rel=1e-12)


def test_peak_friction_falls_linearly_with_the_load() -> None:
    assert wheel.peak_friction(1.0, LOAD, LOAD, 0.17) == 1.0
    assert wheel.peak_friction(1.0, 2.0 * LOAD, LOAD, 0.17) == pytest.approx(0.83)
    assert wheel.peak_friction(1.0, 100.0 * LOAD, LOAD, 0.17) == 0.1


@pytest.mark.parametrize("speed", [1.0, 15.0])
def test_slip_reaches_63_percent_of_a_step_after_the_relaxation_length(speed: float) -> None:
    slip, length, dt = 0.0, 0.05, 1e-5
    for _ in range(round(length / speed / dt)):
        slip = wheel.lagged_slip(slip, 0.1 * speed, speed, length, dt)
    assert slip == pytest.approx(0.1 * (1.0 - math.exp(-1.0)), rel=2e-3)  # implicit Euler: first order in dt


def test_a_tyre_at_rest_is_a_spring_up_to_its_peak() -> None:
    slip = 0.0
    for _ in range(100):
        slip = wheel.lagged_slip(slip, 0.01, 0.0, 0.05, 0.001)
    assert slip == pytest.approx(0.01 * 0.1 / 0.05)
    assert wheel.bounded_slip(5.0, 0.01, 0.0, 0.1, 0.6) == 0.6
    assert wheel.bounded_slip(5.0, -20.0, 1.0, 1.0, 0.6) == 5.0  # the steady slip is -10


spins = st.floats(-300.0, 300.0)
gains = st.floats(0.1, 10.0)


@given(spins, gains, spins, gains, st.floats(-5.0, 5.0), st.booleans())
def test_a_differential_turns_its_wheels_as_its_shaft_predicts(
    one: float, gain: float, other: float, other_gain: float, torque: float, is_locked: bool
) -> None:
    shaft, shaft_gain = wheel.shaft_spin(one, gain, other, other_gain, is_locked)
    moved = wheel.transferred_torque(one, gain, other, other_gain, torque, math.inf if is_locked else 0.0)
    left, right = one + gain * (torque - moved), other + other_gain * (torque + moved)
    assert 0.5 * (left + right) == pytest.approx(shaft + shaft_gain * torque, rel=1e-9, abs=1e-9)
    if is_locked:
        assert left == pytest.approx(right, rel=1e-9, abs=1e-9)
    else:
        assert moved == 0.0


KINDS = {
    "open": {},
    "limited": {"rear": {"kind": "limited_slip", "preload": 0.01, "bias": 0.5}},
    "locked": {"rear": {"kind": "locked"}},
}


def test_an_open_differential_drives_no_wheel_when_the_other_hangs_in_the_air(tmp_path: Path) -> None:
    """A car with rear-wheel drive that is held at a roll of 20 degrees with its right wheels on the ground."""
    forces = {}
    for name, differentials in KINDS.items():
        changes = {"axles.front.is_driven": False, "drivetrain.differentials": differentials}
        world = world_with_car(tmp_path, "roboracer_f1tenth", changes)
        half = math.radians(10.0)
        world.hold("V1", (0.0, 0.0, 0.0905), (math.cos(half), math.sin(half), 0.0, 0.0))
        drive(world, 0.5, 0.5)
        state = world.compiled.state
        assert state.wheel_normal_load[2] == 0.0 < state.wheel_normal_load[3]
        forces[name] = float(state.wheel_force[3, 0])
    assert abs(forces["open"]) < 0.2 * min(forces["limited"], forces["locked"])


def test_the_motor_has_the_torque_of_its_curve(world_with: WorldWith) -> None:
    """The wheels follow dv/dt = T(v) / (r m) between two points of the curve; rolling without slip."""
    curve = [[0, 1.0], [400, 1.0], [1000, 0.25]]
    torque, radius = 0.1, 0.0508
    world = world_with(
        "roboracer_f1tenth", {"drivetrain.torque_curve": curve, "drivetrain.torque_limit": torque}, substep=0.001
    )
    mass = 3.74 + 4 * 0.5 * 0.109
    speed, dt = 0.0, 0.0001
    for _ in range(20_000):
        rpm = speed / radius * 60.0 / (2.0 * math.pi)
        share = float(np.interp(rpm, *np.array(curve).T))
        speed += dt * 4.0 * share * torque / radius / mass
    assert 400 < speed / radius * 60.0 / (2.0 * math.pi) < 1000
    drive(world, 2.0, 1.0)
    # the tyre slips by 0.5 %, and the wheels gain that much more energy
    assert world.frame.vehicles["V1"].speed == pytest.approx(speed, rel=0.005)
