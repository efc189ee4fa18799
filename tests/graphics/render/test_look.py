"""The light at a time of day against the geometry of the sun, and against day and night."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from autodrive.graphics.render.look import (
    DAY,
    LAMPS_LIT,
    NIGHT,
    air_of,
    fixed_look,
    in_air,
    is_day_at,
    light_table,
    look_at,
    needs_lamps,
    sun_at,
)
from autodrive.protocol.messages import Weather

HOUR = 3600.0


def test_the_sun_moves_evenly_on_a_great_circle() -> None:
    """At an equinox: 15 degrees an hour, in the plane through east, noon and west."""
    suns = np.array([sun_at(hour * HOUR) for hour in range(24)])
    assert np.linalg.norm(suns, axis=1) == pytest.approx(1.0)
    turns = np.einsum("ij,ij->i", suns, np.roll(suns, -1, axis=0))
    assert np.degrees(np.arccos(turns)) == pytest.approx(15.0)
    east, noon = suns[6], suns[12]
    assert np.linalg.svd(suns)[1][2] == pytest.approx(0.0, abs=1e-12)
    assert east[2] == pytest.approx(0.0, abs=1e-12)
    assert noon == pytest.approx(DAY.sun_direction)
    # facing the sun at noon, east is to the left (seen from north of the tropics)
    assert noon[0] * east[1] - noon[1] * east[0] > 0.0


@pytest.mark.parametrize(("hour", "expected"), [(0, False), (5.99, False), (6.01, True), (17.99, True), (18.01, False)])
def test_it_is_day_from_six_to_six(hour: float, expected: bool) -> None:
    assert is_day_at(hour * HOUR) is expected


def test_noon_has_the_light_of_day_and_midnight_that_of_night() -> None:
    assert look_at(0.0) is NIGHT
    noon = look_at(12 * HOUR)
    for name in ("sun_direction", "sun_color", "zenith", "horizon", "floor_glow", "exposure", "glow"):
        assert getattr(noon, name) == pytest.approx(getattr(DAY, name))


def test_the_light_changes_without_jumps_while_the_sun_is_up() -> None:
    looks = [look_at(60.0 * minute) for minute in range(6 * 60 + 1, 18 * 60)]
    for before, after in itertools.pairwise(looks):
        assert np.linalg.norm(np.subtract(before.sun_direction, after.sun_direction)) < math.radians(0.6)
        assert np.abs(np.subtract(before.sun_color, after.sun_color)).max() < 0.1
    assert np.linalg.norm(np.subtract(looks[0].sun_color, NIGHT.sun_color)) < 0.1
    assert looks[30].sun_color[0] > 1.5 * looks[30].sun_color[2]  # a low sun is red


def test_the_table_of_the_page_has_the_same_lights() -> None:
    minutes = light_table()["minutes"]
    assert len(minutes) == 144
    assert minutes[90]["sun_direction"] == look_at(15 * HOUR).sun_direction


def test_dusk_grows_from_day_to_night_and_is_half_at_a_sun_of_8_degrees() -> None:
    evening = [look_at(60.0 * minute).dusk for minute in range(12 * 60, 19 * 60)]
    assert evening == sorted(evening)
    assert (evening[0], evening[-1]) == (DAY.dusk, NIGHT.dusk) == (0.0, 1.0)
    assert max(after - before for before, after in itertools.pairwise(evening)) < 0.02  # no jump at sunset
    # the light changes in steps of a minute
    below = next(minute for minute, dusk in enumerate(evening) if dusk >= LAMPS_LIT)
    assert math.degrees(math.asin(sun_at(43200.0 + 60.0 * below)[2])) == pytest.approx(8.0, abs=0.2)


@pytest.mark.parametrize("time_of_day", [None, 8 * HOUR, 12 * HOUR, 17 * HOUR, 17.5 * HOUR, 18.1 * HOUR, 23 * HOUR])
@pytest.mark.parametrize("weather", [Weather(), Weather(clouds=0.5), Weather(clouds=0.8), Weather(rain=1.0, fog=0.3)])
def test_the_traffic_has_headlights_when_their_light_is_drawn(time_of_day: float | None, weather: Weather) -> None:
    for is_day in (True, False) if time_of_day is None else (is_day_at(time_of_day),):
        look = fixed_look(is_day) if time_of_day is None else look_at(time_of_day)
        assert needs_lamps(is_day, time_of_day, weather) == in_air(look, air_of(weather)).are_lamps_lit
