"""Tests of the data type of a track, its file, and its map."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

import autodrive
from autodrive.base.errors import SpecError
from autodrive.scenario import VehiclePlacement
from autodrive.scenario.kinds import names
from autodrive.scenario.maps.map import load_map, track_map
from autodrive.scenario.tracks.generate import generate_track
from autodrive.scenario.tracks.track import DUCT, Track


@pytest.fixture(scope="module")
def ring() -> Track:
    """A circle of radius 5 m, counter-clockwise from (5, 0), 1.2 m wide."""
    angle = np.arange(360) * (2.0 * math.pi / 360)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    centre_line = np.hstack([5.0 * circle, np.full((360, 1), 0.5), np.full((360, 1), 0.7)])
    return Track("ring", centre_line, walls=(5.5 * circle, 4.3 * circle[::-1]))


def test_pose_and_projection_are_inverse(ring: Track) -> None:
    # chords of 1 degree: 5 m (1 - cos 0.5 deg) = 0.2 mm, and half a degree of heading
    x, y, yaw = ring.pose_at(ring.length / 4.0)
    assert (x, y) == pytest.approx((0.0, 5.0), abs=1e-3)
    assert abs(math.remainder(yaw - math.pi, 2.0 * math.pi)) < math.radians(0.6)
    for s in np.linspace(0.0, ring.length, 50, endpoint=False) + 0.01:
        for lateral in (-0.4, 0.0, 0.6):
            x, y, _ = ring.pose_at(float(s), lateral)
            # on the inside of a bend, two segments are nearest to a point: 0.6 m x 1 degree
            assert ring.project(x, y) == pytest.approx((s, lateral), abs=0.011)
    assert ring.project(*ring.start_pose[:2]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert ring.pose_at(-1.0) == pytest.approx(ring.pose_at(ring.length - 1.0))


def test_projection_is_that_of_an_independent_library() -> None:
    track = Track.load("practice")
    line = shapely.LinearRing(track.centre_line[:, :2])
    x0, y0, x1, y1 = line.bounds
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((x0 - 1.0, y0 - 1.0), (x1 + 1.0, y1 + 1.0), (300, 2)):
        s, lateral = track.project(x, y)
        assert abs(lateral) == pytest.approx(line.distance(shapely.Point(x, y)), abs=1e-9)
        nearest = line.interpolate(s)
        assert math.hypot(nearest.x - x, nearest.y - y) == pytest.approx(abs(lateral), abs=1e-9)
        # the first point of a counter-clockwise line has the inside on its left
        is_left = shapely.Polygon(line).contains(shapely.Point(x, y)) == line.is_ccw
        assert (lateral > 0.0) == is_left


def test_a_file_keeps_every_number(ring: Track, tmp_path: Path) -> None:
    race = np.column_stack([np.arange(4.0), 5.0 * np.cos(np.arange(4.0)), np.arange(4.0) / 3.0, *np.zeros((4, 4))])
    angle = np.arange(4.0)
    gates = np.column_stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), angle + math.pi / 2.0, angle / 3.0 + 1.2])
    start = (4.9, -1.0 / 3.0, 1.5)
    track = Track("ring", ring.centre_line, race, ring.walls, 'A "ring"', "one\ntwo", DUCT, gates, start)
    track.save(tmp_path / "ring.yaml")
    again = Track.load(tmp_path / "ring.yaml")
    assert (again.name, again.title, again.note, again.barrier) == ("ring", 'A "ring"', "one\ntwo", DUCT)
    assert again.start == again.grid_pose(0) == start
    assert again.grid_pose(0, 2) == ring.grid_pose(0, 2)
    assert again.race_line is not None
    assert again.checkpoints is not None
    loaded = (*again.walls, again.centre_line, again.race_line, again.checkpoints)
    for a, b in zip(loaded, (*track.walls, track.centre_line, race, gates), strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("- 1 1 0.5 0.5", "- 1 one 0.5 0.5"), r"centre_line 3.*expected numbers.*found '1 one 0.5 0.5'"),
        (("- 1 1 0.5 0.5", "- 1 1 0.5"), r"centre_line 3"),
        (("- 1 1 0.5 0.5", "- 1 1 0.5 -0.5"), r"centre_line 3.*widths .* must be above 0"),
        (("- 1 1 0.5 0.5", "- 1 0 0.5 0.5"), r"centre_line 2.*the next point is at the same place"),
        (("- 0 1 0.5 0.5", "- 0 0 0.5 0.5"), r"centre_line 4.*first point must not be repeated"),
        (("- 1 1 0.5 0.5", "- 1 1e5 0.5 0.5"), r"centre_line.*at most 10000 m"),
        (("kind: wall", "kind: wall, gap: 1"), r"barrier.*length and gap are for ducts"),
        (("kind: wall", "kind: tyres"), r"barrier.kind.*must be 'wall' or 'duct'"),
    ],
)
def test_a_wrong_file_is_refused_with_the_place(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    text = "barrier: {kind: wall}\ncentre_line:\n- 0 0 0.5 0.5\n- 1 0 0.5 0.5\n- 1 1 0.5 0.5\n- 0 1 0.5 0.5\n"
    path = tmp_path / "square.yaml"
    path.write_text(text)
    Track.load(path)
    assert change[0] in text
    path.write_text(text.replace(*change))
    with pytest.raises(SpecError, match=message):
        Track.load(path)


def test_every_shipped_track_is_a_map_with_a_free_lane_between_its_barriers() -> None:
    for name in names("track"):
        map_ = load_map(name)
        track = map_.track
        assert track is not None
        solid = shapely.union_all([shape.plan for shape in map_.statics])
        for s in np.arange(0.0, track.length, 0.5):
            x, y, _ = track.pose_at(float(s))
            # walls are simplified by 3 mm, chords of the centre line are 0.1 m
            assert solid.distance(shapely.Point(x, y)) >= min(track.widths_at(float(s))) - 0.006
        assert map_.lane_graph.loops() == ((0,),)


def test_vehicles_start_on_the_grid_unless_they_have_a_pose() -> None:
    track = Track.load("practice")
    x, y, _ = track.pose_at(10.0)
    vehicles = {"V1": VehiclePlacement(), "V2": VehiclePlacement(), "V3": VehiclePlacement(x=x, y=y)}
    scenario = autodrive.Scenario(map="practice", vehicles=vehicles)
    frame = autodrive.make(scenario).frame
    places = [track.project(*frame.vehicles[name].pose.position[:2]) for name in ("V1", "V2")]
    assert [s for s, _ in places] == pytest.approx([track.length - 0.5, track.length - 1.3], abs=1e-3)
    assert [lateral for _, lateral in places] == pytest.approx([0.3, -0.3], abs=1e-3)
    assert frame.vehicles["V3"].pose.position[:2] == pytest.approx([x, y])


def test_lidar_sees_the_barriers_at_their_distance() -> None:
    world = autodrive.make("practice")
    track = Track.load("practice")
    scan = world.frame.vehicles["V1"].lidar
    assert scan is not None
    right, left = track.widths_at(-0.5)
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    for bearing, distance in ((math.pi / 2.0, left), (-math.pi / 2.0, right)):
        ray = int(np.argmin(np.abs(np.remainder(bearings - bearing + math.pi, 2.0 * math.pi) - math.pi)))
        assert scan.ranges[ray] == pytest.approx(distance, abs=0.02)


def test_a_collision_names_the_barrier_and_not_its_piece() -> None:
    map_ = track_map(generate_track(1, length=40.0, width=1.2, area=(15.0, 10.0)))
    assert {shape.name.split("/")[0] for shape in map_.statics} == {"wall_1", "wall_2"}
