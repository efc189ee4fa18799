"""What the weather does to a scan, ray by ray."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.physics.sensors.lidar.weather import FIRST, WIDTH, figures, pass_weather
from autodrive.physics.sensors.random_stream import new_stream
from autodrive.physics.weather import TARGETS, backscatter, extinction
from autodrive.protocol.messages import Weather

N = 20_000


def passed(weather: Weather, target: str, distance: float) -> np.ndarray:
    """Ranges of N rays that hit the same target [m]; infinite without a return."""
    inverse = np.full(N, 1.0 / distance)
    row = np.array(figures(weather, 12.0, 0.1))
    hits, targets = np.zeros(N, np.int64), np.array([TARGETS[target]])
    pass_weather(inverse, hits, targets, row, new_stream(np.random.default_rng(1)))
    with np.errstate(divide="ignore"):
        return 1.0 / inverse


def test_clear_weather_changes_nothing() -> None:
    assert figures(Weather(clouds=1.0, wind=1.0), 12.0, 0.1) == [0.0] * WIDTH


def test_wet_dark_surfaces_are_lost_at_a_shorter_distance_than_dry_ones() -> None:
    wet = Weather(wetness=1.0)
    # a black housing with the rated reflectivity: sqrt(0.0543 / 0.1) * 12 m = 8.84 m, 10 % around it from ray to ray
    assert np.isinf(passed(wet, "housing", 8.84)).mean() == pytest.approx(0.5, abs=0.02)
    assert passed(wet, "housing", 7.9) == pytest.approx(7.9)
    assert np.isinf(passed(wet, "housing", 9.9)).all()
    assert passed(wet, "plate", 11.9) == pytest.approx(11.9)
    assert passed(Weather(wetness=0.0, rain=0.01), "housing", 10.7) == pytest.approx(10.7)


@pytest.mark.parametrize("distance", [3.0, 5.0])
def test_the_air_returns_as_often_as_its_power_exceeds_that_of_the_target(distance: float) -> None:
    fog = Weather(fog=0.5)
    lost = extinction(fog)
    echo = 0.5 * math.exp(-2.0 * lost * distance) / distance**2
    share = math.exp(-max(echo, 0.1 / 12.0**2) / backscatter(lost))  # of an exponential distribution
    ranges = passed(fog, "wall", distance)
    # a return from beyond the target is the target
    nearer = 1.0 - math.exp(-(2.0 * lost + 2.0) * (distance - 1.0))
    assert (ranges < distance).mean() == pytest.approx(share * nearer, abs=0.02)


def test_the_range_of_a_target_is_reduced_by_snow() -> None:
    row = figures(Weather(snow=1.0, wetness=0.0), 12.0, 0.1)
    reach = row[FIRST + len(TARGETS) + TARGETS["housing"]]
    assert reach < 11.0
    assert 0.1 * math.exp(-2.0 * row[0] * reach) / reach**2 == pytest.approx(0.1 / 144.0)
