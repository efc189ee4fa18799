"""Tests of generated tracks and of race lines."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from autodrive.base.errors import SpecError
from autodrive.scenario.kinds import names
from autodrive.scenario.tracks.checks import track_errors, track_warnings
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.race_line import CarLimits, race_line, speeds
from autodrive.scenario.tracks.shape import curvature
from autodrive.scenario.tracks.track import DUCT, Track


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_generated_track_keeps_its_limits(seed: int) -> None:
    track = generate_track(seed, length=45.0, width=1.0, area=(18.0, 9.0), barrier=DUCT)
    assert track.length == pytest.approx(45.0, rel=0.05)
    assert track_errors(track) == track_warnings(track) == []
    walls = [shapely.LinearRing(wall) for wall in track.walls]
    x0, y0, x1, y1 = shapely.total_bounds(np.array(walls))
    # an air duct stands behind the wall; lines are simplified by 3 mm
    assert max(x1 - x0, 0.0) <= 18.0 - 2.0 * 0.33 + 0.01
    assert max(y1 - y0, 0.0) <= 9.0 - 2.0 * 0.33 + 0.01
    assert np.abs(curvature(track.centre_line[:, :2])).max() < 1.05  # the smallest radius is the width; rounding
    assert walls[0].distance(walls[1]) > 0.98


def test_the_same_seed_gives_the_same_bits_on_every_processor() -> None:
    text = generate_track(7, length=30.0, width=1.0, area=(14.0, 8.0)).text()
    assert hashlib.sha256(text.encode()).hexdigest()[:16] == "6348b8b8253f78c5"
    assert generate_track(8, length=30.0, width=1.0, area=(14.0, 8.0)).text() != text


def test_the_track_technical_can_be_generated_again() -> None:
    made, shipped = generate_track(2, length=92.0, width=1.0, barrier=DUCT), Track.load("technical")
    np.testing.assert_array_equal(made.centre_line, shipped.centre_line)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0.5}, r"width 0.5 m: it must be from 0.9 m"),
        ({"area": (3.0, 30.0)}, r"area 3 x 30 m: each side must be from 5 m"),
        ({"length": 5.0}, r"length 5 m: it must be from 7.54 m \(a circle\) to 230.8 m"),
        ({"min_radius": 0.3}, r"min_radius 0.3 m: it must be above half the width, 0.6 m"),
    ],
)
def test_impossible_wishes_are_refused(change: dict[str, float], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        generate_track(0, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", names("track"))
def test_the_race_lines_of_shipped_tracks_are_smooth_and_within_the_limits_of_the_car(name: str) -> None:
    track, limits = Track.load(name), CarLimits()
    assert track_errors(track) == track_warnings(track) == []
    rows = track.race_line
    assert rows is not None
    s, points, kappa, speed, acceleration = rows[:, 0], rows[:, 1:3], rows[:, 4], rows[:, 5], rows[:, 6]
    steps = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    assert np.allclose(np.diff(s), steps[:-1], atol=2e-4)  # rounding to 0.1 mm
    assert math.remainder(track.project(*points[0])[0], track.length) == pytest.approx(0.0, abs=0.02)
    solid = shapely.union_all([shapely.LinearRing(wall) for wall in track.walls])
    # the line keeps the margin, but for the length of its steps at the apex of a bend and the walls' tolerance
    assert shapely.distance(solid, shapely.points(points)).min() > limits.margin - 0.02
    assert (speed**2 * np.abs(kappa)).max() <= limits.lateral * 1.01
    assert acceleration.max() <= limits.forward * 1.02
    assert acceleration.min() >= -limits.braking * 1.02
    centre = track.centre_line[::2, :2]
    gaps = np.hypot(*(np.roll(centre, -1, axis=0) - centre).T)
    assert np.sum(kappa**2 * steps) < 0.9 * np.sum(curvature(centre) ** 2 * gaps)
    slow = speeds(gaps, curvature(centre), limits)
    assert np.sum(steps / speed) < 0.95 * np.sum(gaps / slow)  # the times of a lap


def test_speeds_are_those_of_the_equations_of_motion() -> None:
    """A straight of 30 m between bends of radius 2 m: v = sqrt(a r), then v^2 = v0^2 + 2 a s, then braking."""
    limits = CarLimits(speed=100.0, lateral=8.0, forward=4.0, braking=5.0)
    kappa = np.concatenate([np.full(40, 0.5), np.zeros(300)])
    speed = speeds(np.full(340, 0.1), kappa, limits)
    assert speed[10] == pytest.approx(4.0)  # sqrt(8 / 0.5)
    assert speed[40 + 100] == pytest.approx(math.sqrt(16.0 + 2.0 * 4.0 * 10.0), rel=0.005)
    assert speed[339 - 50] == pytest.approx(math.sqrt(16.0 + 2.0 * 5.0 * 5.0), rel=0.005)


def test_a_track_that_is_too_narrow_has_no_race_line() -> None:
    track = Track.load("practice")
    narrow = replace(track, centre_line=track.centre_line * np.array([1.0, 1.0, 0.3, 0.3]))
    with pytest.raises(SpecError, match=r"is 0.36 m wide at point 0.*needs 0.5 m"):
        race_line(narrow, CarLimits())
