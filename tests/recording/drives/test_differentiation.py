"""Speed and yaw rate from poses: parabolas are exact, circles have a known error, gaps are not crossed."""

from __future__ import annotations

import numpy as np
import pytest

from autodrive.recording.drives import local_parabola

NONE = np.empty(0)


def test_a_parabola_at_any_times_is_found_exactly() -> None:
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.005, 0.06, 300))
    values = np.column_stack((2.0 - 3.0 * time + 0.7 * time**2, 5.0 + 0.0 * time))
    value, slope = local_parabola(time, values, NONE, 0.2)
    np.testing.assert_allclose(value, values, atol=1e-9)
    np.testing.assert_allclose(slope, np.column_stack((-3.0 + 1.4 * time, 0.0 * time)), atol=1e-8)


def test_the_slope_of_a_sine_is_reduced_by_the_factor_of_the_formula() -> None:
    """The slope of rows that are close together is 3 / h^3 * integral of u sin(w u) du over 0 to h."""
    w, h = 4.0, 0.3
    time = np.arange(0.0, 6.0, 0.002)
    _, slope = local_parabola(time, np.sin(w * time), NONE, h)
    factor = 3.0 / h**3 * (np.sin(w * h) / w**2 - h * np.cos(w * h) / w) / w
    inner = slice(200, -200)  # whole windows; the sum over rows differs from the integral by 2 steps of 300
    np.testing.assert_allclose(slope[inner], factor * w * np.cos(w * time[inner]), atol=0.01 * w)
    assert factor == pytest.approx(0.86, abs=0.01)


def test_rows_beyond_a_gap_do_not_count() -> None:
    time = np.concatenate((np.arange(0.0, 1.0, 0.01), np.arange(1.05, 2.0, 0.01)))
    is_after = time > 1.0
    values = np.where(is_after, 100.0 - 2.0 * time, 3.0 * time)
    _, slope = local_parabola(time, values, np.array([1.05]), 0.1)
    np.testing.assert_allclose(slope, np.where(is_after, -2.0, 3.0), atol=1e-8)
    _, across = local_parabola(time, values, NONE, 0.1)
    assert np.abs(across - slope).max() > 100.0


def test_a_row_with_too_few_neighbours_has_no_slope() -> None:
    time = np.array([0.0, 0.1, 0.2, 5.0, 5.1, 9.0])
    value, slope = local_parabola(time, time, NONE, 0.25)
    assert np.isfinite(slope).tolist() == [True] * 3 + [False] * 3
    assert np.isfinite(value).tolist() == [True] * 3 + [False] * 3
