"""The formulas of the wheel against their definitions."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.physics import formulas, wheel

CURVE = (0.4, 1.0, 0.8, 0.5, 1.2)
EXACT = 1e-12  # a few roundings of numbers near 1


@pytest.mark.parametrize(("slip", "value"), [(0.0, 0.0), (0.4, 1.0), (0.6, 0.75), (0.8, 0.5), (9.0, 0.5)])
def test_friction_curve_passes_through_its_defining_points(slip: float, value: float) -> None:
    assert wheel.friction_coefficient(slip, *CURVE) == pytest.approx(value, abs=EXACT)


def test_friction_curve_is_flat_at_extremum_and_asymptote_and_starts_with_the_given_slope() -> None:
    def slope(s: float, h: float = 1e-6) -> float:
        return (wheel.friction_coefficient(s + h, *CURVE) - wheel.friction_coefficient(max(s - h, 0.0), *CURVE)) / (
            s + h - max(s - h, 0.0)
        )

    assert slope(0.0) == pytest.approx(1.2 * 1.0 / 0.4, rel=1e-4)  # one-sided difference: first order in h
    assert slope(0.4) == pytest.approx(0.0, abs=1e-4)
    assert slope(0.8) == pytest.approx(0.0, abs=1e-4)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 50))
def test_tyre_force_never_exceeds_the_friction_limit_and_opposes_the_slip(
    ratio: float, angle: float, load: float
) -> None:
    fx, fy = wheel.tyre_force(ratio, angle, load, *CURVE, 0.2, 1.0, 0.5, 0.75, 1.2)
    assert math.hypot(fx, fy) <= load * (1.0 + EXACT) + 1e-300  # subnormal numbers have few digits
    assert fx * ratio >= 0.0 >= fy * angle


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_tyre_force_is_mirror_symmetric(ratio: float, angle: float) -> None:
    fx, fy = wheel.tyre_force(ratio, angle, 4.0, *CURVE, 0.2, 1.0, 0.5, 0.75, 1.2)
    assert wheel.tyre_force(ratio, -angle, 4.0, *CURVE, 0.2, 1.0, 0.5, 0.75, 1.2) == (fx, -fy)
    assert wheel.tyre_force(-ratio, angle, 4.0, *CURVE, 0.2, 1.0, 0.5, 0.75, 1.2) == (-fx, fy)


def test_suspension_carries_the_static_load_at_compression_zero_and_never_pulls() -> None:
    law = {"compression_max": 0.005, "bump_stiffness": 2e4, "look_ahead": 0.0}
    assert wheel.suspension_force(0.0, 0.0, 4.29, 5040.0, 20.0, **law) == 4.29
    assert wheel.suspension_force(0.001, 0.0, 4.29, 5040.0, 20.0, **law) == pytest.approx(4.29 + 5.04, abs=EXACT)
    assert wheel.suspension_force(0.001, 0.1, 4.29, 5040.0, 20.0, **law) == pytest.approx(4.29 + 7.04, abs=EXACT)
    assert wheel.suspension_force(-0.005, 0.0, 4.29, 5040.0, 20.0, **law) == 0.0
    assert wheel.suspension_force(0.0, -9.0, 4.29, 5040.0, 20.0, **law) == 0.0
    at_the_stop = wheel.suspension_force(0.006, 0.0, 4.29, 5040.0, 0.0, **law)
    assert at_the_stop == pytest.approx(4.29 + 25.2 + 20.0, abs=EXACT)


@given(st.floats(-50, 50), st.floats(0, 5), st.floats(1e-6, 1e3))
def test_brake_stops_a_wheel_but_never_reverses_it(spin: float, torque: float, gain: float) -> None:
    after = wheel.braked_spin(spin, torque, gain)
    assert after * spin >= 0.0
    assert abs(after) <= abs(spin)


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-15, 15))
def test_motors_reach_the_target_of_the_mean_speed_in_one_step(left: float, right: float, target: float) -> None:
    gain = 30.0
    torque = wheel.motor_torque(0.5 * (left + right), gain, target, 1e6, 1e9)
    assert 0.5 * (left + right) + gain * torque == pytest.approx(target, abs=1e-4)  # servo gain is finite
    limited = wheel.motor_torque(0.5 * (left + right), gain, target, 1e6, 0.1)
    assert abs(limited) <= 0.1


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 20))
def test_compiled_and_plain_source_agree_to_the_last_bit(ratio: float, angle: float, load: float) -> None:
    arguments = (ratio, angle, load, *CURVE, 0.2, 1.0, 0.5, 0.75, 1.2)
    assert formulas.tyre_force(*arguments) == wheel.tyre_force(*arguments)
