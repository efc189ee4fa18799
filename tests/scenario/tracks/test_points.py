"""Tracks by points: the line is smooth, its faults are those that other formulas find, and files keep their bits."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.interpolate import CubicSpline

import autodrive
from autodrive import Command, SpecError
from autodrive.base.arrays import Floats
from autodrive.cli.spec_files import check
from autodrive.experiments.campaigns.parameters import applied
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.files import read_scenario
from autodrive.scenario.tracks.points import centre_line, faults, points_on, smooth_line
from autodrive.scenario.tracks.shape import walls_along
from autodrive.scenario.tracks.track import Track, TrackSpec
from tests.support.frames import digests

BEAN = np.array([(0, 0), (6, 0), (12, -1), (15, 3), (11, 6), (8, 3.5), (4, 6), (-2, 4)], dtype=float)
TEXT = f"""\
title: A bean
barrier: {{kind: duct, width: 0.33, height: 0.33, length: 3.0, gap: 0.03}}
points: [{", ".join(f"{x:g} {y:g}" for x, y in BEAN)}]
width: 1.2
"""


def ellipses(count: int) -> list[Floats]:
    """Random closed lines of 6 to 15 points, some of them with faults."""
    rng = np.random.default_rng(7)
    found = []
    for _ in range(count):
        n = int(rng.integers(6, 16))
        angles = 2.0 * math.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
        radii = rng.uniform(2.0, 8.0, n)
        found.append(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]).round(3))
    return found


def test_the_line_is_the_periodic_cubic_spline_of_scipy() -> None:
    for points in (BEAN, *ellipses(5)):
        closed = np.vstack([points, points[:1]])
        knots = np.concatenate([[0.0], np.cumsum(np.sqrt(np.hypot(*np.diff(closed, axis=0).T)))])
        spline = CubicSpline(knots, closed, bc_type="periodic")
        places, parameters = smooth_line(points)
        expected = spline(np.interp(parameters, np.arange(len(knots)), knots))
        assert np.abs(places - expected).max() < 1e-9  # Jacobi's method leaves 2^-60 of 10 m
        steps = np.hypot(*(np.roll(places, -1, axis=0) - places).T)
        assert steps.std() < 0.02 * steps.mean()


def test_faults_are_those_of_the_offset_line_and_of_the_walls() -> None:
    """A line without faults has walls that do not cross, and buffers of half a width on each side are one ring."""
    kinds, clean = set(), 0
    for points in ellipses(60):
        found = {one.kind for one in faults(points, 1.2)}
        kinds |= found
        rows = centre_line(points, 1.2)
        rings = [shapely.LinearRing(wall) for wall in walls_along(rows)]
        if not found:
            clean += 1
            assert all(ring.is_simple for ring in rings)
            assert not rings[0].intersects(rings[1])
            road = shapely.LinearRing(rows[:, :2]).buffer(0.6)
            assert len(road.interiors) == 1
        if not all(ring.is_simple for ring in rings) or rings[0].intersects(rings[1]):
            assert found & {"bend", "touch"}
    assert kinds == {"bend", "touch"}
    assert clean > 5


def test_a_fault_has_place_point_and_values() -> None:
    circle = np.array([(0.5 * math.cos(a), 0.5 * math.sin(a)) for a in np.arange(8) * math.pi / 4])
    (bend,) = faults(circle, 0.9)
    assert (bend.kind, bend.value) == ("bend", pytest.approx(0.5, abs=0.02))  # 16 places on 8 points
    assert bend.least == pytest.approx(0.55)
    assert "the radius at" in bend.text
    eight = np.array([(0, 0), (3, 2), (6, 0), (3, -2), (0, 0.01), (-3, 2), (-6, 0), (-3, -2)], dtype=float)
    crossing = [one for one in faults(eight, 0.9) if one.kind == "touch"]
    assert any(math.hypot(one.x, one.y) < 0.3 and one.value < 0.1 for one in crossing)
    wide = 10.0 * circle
    assert [(one.kind, one.value) for one in faults(wide, 0.6)] == [("narrow", 0.6)]
    assert faults(wide, 0.9) == []


def lines_for_the_page() -> list[dict[str, Any]]:
    """Random tracks with what the simulator says about them."""
    found = []
    for points, width in zip(ellipses(24), [0.7, 1.0, 1.2, 2.0] * 6, strict=True):
        places, _ = smooth_line(points)
        wrong = [[one.kind, one.x, one.y, one.point, one.value, one.least] for one in faults(points, width)]
        line = {"points": points.tolist(), "width": width, "count": len(places)}
        found.append(line | {"places": places[::25].round(9).tolist(), "faults": wrong})
    return found


def test_the_page_is_tested_with_what_the_simulator_says() -> None:
    """web/tests/track_line.test.ts compares the formulas of the page with this file."""
    saved = json.loads((Path(__file__).parents[3] / "web" / "tests" / "track_lines.json").read_text())
    assert saved == lines_for_the_page()


@pytest.mark.parametrize("name", ["practice", "technical", "fast"])
def test_few_points_are_found_for_a_line(name: str) -> None:
    line = Track.load(name).centre_line[:, :2]
    points = points_on(line)
    assert len(points) < len(line) / 8
    ring = shapely.LinearRing(smooth_line(points).places)
    assert shapely.distance(ring, shapely.points(line)).max() < 0.03
    assert np.hypot(*(points[0] - line[0])) < 0.001


def test_a_track_by_points_has_the_bits_of_its_centre_line_in_a_file_and_in_a_scenario(tmp_path: Path) -> None:
    (tmp_path / "points.yaml").write_text(TEXT)
    track = Track.load(tmp_path / "points.yaml")
    track.save(tmp_path / "rows.yaml")  # the centre line and the walls as numbers
    inline = "map:\n" + "".join(f"  {line}\n" for line in TEXT.splitlines())
    (tmp_path / "inline.yaml").write_text(inline)
    (tmp_path / "inline_rows.yaml").write_text(
        "map:\n" + "".join(f"  {line}\n" for line in (tmp_path / "rows.yaml").read_text().splitlines())
    )
    scenarios = [
        ScenarioSpec(map=str(tmp_path / "points.yaml")),
        ScenarioSpec(map=str(tmp_path / "rows.yaml")),
        tmp_path / "inline.yaml",
        tmp_path / "inline_rows.yaml",
    ]
    drives = [digests(autodrive.make(scenario, 3), 200, lambda _: {"V1": Command(0.4, 0.2)}) for scenario in scenarios]
    assert drives[0] == drives[1] == drives[2] == drives[3]
    for name in ("points", "inline", "inline_rows"):
        assert check(str(tmp_path / f"{name}.yaml"))[2] == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("points: [0 0, ", "points: [0 0, 0 0.04, "),
            r"point 1 \(line 3\): neighbouring .* at least 5 cm",
        ),
        (("points: [0 0, ", "points: [600 0, "), r"points \(line 3\): positions must be at most 500 m"),
        (("width: 1.2", "width: 1.2\nwalls: [[0 0, 1 0, 1 1]]"), r"walls .*is computed from the points"),
        (("width: 1.2", ""), r"width: is required with points"),
        (("width: 1.2", "width: 0.1"), r"width \(line 4\): must be at least 0.2"),
        (("6 0, 12 -1", "6 0, x"), r"point 3.*found 'x'"),
        (("points: [", "point: ["), r"point .*Did you mean 'points'"),
        (
            ("width: 1.2", "width: 5"),
            r"track 'wrong': point \d+ \(line 3\): the radius .* at least 2.60 m",
        ),
    ],
)
def test_what_is_wrong_with_points_is_said(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    text = TEXT.replace(*change)
    assert text != TEXT
    (tmp_path / "wrong.yaml").write_text(text)
    with pytest.raises(SpecError, match=message):
        check(str(tmp_path / "wrong.yaml"), "track")


def test_points_on_one_line_have_faults_and_a_track_without_a_line_is_refused() -> None:
    assert {one.kind for one in faults(np.array([(0, 0), (3, 0), (6, 0)], dtype=float), 1.0)} == {"touch"}
    assert Track.of(TrackSpec(points=((0, 0), (3, 0), (6, 0)), width=1.0), "flat").length == pytest.approx(12, rel=0.1)
    with pytest.raises(SpecError, match="centre_line: is required; or give points and a width"):
        TrackSpec(title="x")


@pytest.mark.filterwarnings("ignore:map. point")
def test_faults_of_a_draft_are_warnings_with_lines(tmp_path: Path) -> None:
    (tmp_path / "draft.yaml").write_text(TEXT.replace("width: 1.2", "width: 5\nis_draft: true"))
    kind, title, warnings = check(str(tmp_path / "draft.yaml"))
    assert (kind, title) == ("track", "A bean")
    assert warnings
    assert all("(line 3)" in warning for warning in warnings)
    with pytest.warns(UserWarning, match="the radius at"):
        world = autodrive.make(ScenarioSpec(map=str(tmp_path / "draft.yaml")))
    world.step({})


def test_a_campaign_changes_the_width(tmp_path: Path) -> None:
    (tmp_path / "points.yaml").write_text(TEXT)
    for map_ in (str(tmp_path / "points.yaml"), TrackSpec(points=tuple(map(tuple, BEAN.tolist())), width=1.2)):
        descriptions = applied(read_scenario(ScenarioSpec(map=map_)), {"map.width": 1.5})
        found = descriptions.specs.map.spec
        assert isinstance(found, TrackSpec)
        assert found.width == 1.5
