"""Tests of the roads on which traffic drives: links, gates, and where they cross."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.roads import CRITICAL_GAPS, Roads, roads
from autodrive.scenario.maps.spec import MapSpec

CLEARANCE = 0.225
CLOSED = ("tiny_town", "mini_map", "figure_eight", "oval", "practice")


def points_of(of: Roads, link: int) -> np.ndarray:
    return of.points[of.point_first[link] : of.point_first[link + 1]]


def successors(of: Roads, link: int) -> list[int]:
    return of.successor[of.successor_first[link] : of.successor_first[link + 1]].tolist()


def rivals(of: Roads, link: int) -> dict[int, tuple[float, int]]:
    rows = slice(of.conflict_first[link], of.conflict_first[link + 1])
    table = zip(of.conflict[rows], of.conflict_end[rows], of.yields[rows], strict=True)
    return {int(other): (float(end), int(order)) for other, end, order in table}


def gate(of: Roads, start: tuple[float, float], end: tuple[float, float]) -> int:
    """The gate that begins and ends there."""
    for link in np.flatnonzero(of.is_gate).tolist():
        line = points_of(of, link)
        if math.dist(line[0, :2], start) + math.dist(line[-1, :2], end) < 1e-6:
            return link
    raise AssertionError((start, end))


@pytest.mark.parametrize("name", CLOSED)
def test_each_link_goes_on_where_it_ends(name: str) -> None:
    of = roads(load_map(name), CLEARANCE)
    assert of.link_count > 0
    for link in range(of.link_count):
        assert successors(of, link)
        for following in successors(of, link):
            end, start = points_of(of, link)[-1], points_of(of, following)[0]
            assert end[:2] == pytest.approx(start[:2], abs=1e-6)
            assert end[2:] @ start[2:] > math.cos(0.05)  # a chord of an arc turns by half its angle
        steps = np.hypot(*np.diff(points_of(of, link)[:, :2], axis=0).T)
        assert steps == pytest.approx(of.spacing[link], rel=1e-3)  # chords of a resampled polyline are shorter
        assert of.length[link] == pytest.approx(steps.sum(), rel=1e-3)


def test_links_have_the_lengths_of_lines_and_quarters_of_circles() -> None:
    town = roads(load_map("tiny_town"), CLEARANCE)
    straight, left = gate(town, (-0.7, -0.15), (0.7, -0.15)), gate(town, (-0.7, -0.15), (0.15, 0.7))
    right = gate(town, (-0.7, -0.15), (-0.15, -0.7))
    assert town.length[straight] == pytest.approx(1.4)
    assert town.length[left] == pytest.approx(math.pi / 2 * 0.85, rel=1e-3)  # chords of the lane
    assert town.length[right] == pytest.approx(math.pi / 2 * 0.55, rel=1e-3)


def test_the_lanes_of_an_oval_differ_by_a_turn_around_the_distance_between_them() -> None:
    oval = roads(load_map("oval"), CLEARANCE)
    assert [successors(oval, link) for link in range(oval.link_count)] == [[0], [1]]
    assert not oval.is_gate.any()
    assert abs(oval.length[0] - oval.length[1]) == pytest.approx(2 * math.pi * 0.3, rel=2e-3)


def test_an_intersection_has_the_crossing_and_joining_pairs_of_the_textbook() -> None:
    """Four legs: 16 crossings, and at each of four exits three movements that join."""
    for clearance in (1e-3, CLEARANCE):
        of = roads(load_map("figure_eight"), clearance)
        pairs = {frozenset((a, b)) for a in range(of.link_count) for b in rivals(of, a)}
        joining = {pair for pair in pairs if len({tuple(points_of(of, a)[-1, :2].round(3)) for a in pair}) == 1}
        assert (len(pairs - joining), len(joining)) == (16, 12)


def test_two_links_are_apart_where_they_are_clear_of_each_other() -> None:
    of = roads(load_map("tiny_town"), CLEARANCE)
    for link in range(of.link_count):
        other_line = shapely.LineString(points_of(of, link)[:, :2])
        for other, (end, order) in rivals(of, link).items():
            assert rivals(of, other)[link][1] == -order
            behind = points_of(of, other)[math.ceil(end / of.spacing[other] - 1e-9) :, :2]
            assert all(other_line.distance(shapely.Point(p)) >= CLEARANCE for p in behind)


def test_gates_know_their_lines_lights_and_signs() -> None:
    map_ = load_map("tiny_town")
    of = roads(map_, CLEARANCE)
    straight, left = gate(of, (-0.7, -0.15), (0.7, -0.15)), gate(of, (-0.7, -0.15), (0.15, 0.7))
    oncoming = gate(of, (0.7, 0.15), (-0.15, -0.7))  # turns left, too
    assert map_.traffic_lights[of.light[straight]] == "traffic_light_1"
    assert of.stop_at[straight] == pytest.approx(0.03)
    assert rivals(of, oncoming)[straight][1] == 1
    assert oncoming not in rivals(of, left)
    from_lot = np.flatnonzero(of.is_stop).tolist()
    assert of.stop_at[from_lot] == pytest.approx(1.42)
    assert {order for link in from_lot for other, (_, order) in rivals(of, link).items() if other not in from_lot} == {
        1
    }
    # the road through the middle has a give-way sign where it meets the northern road
    minor, through = gate(of, (3.5, -0.15), (4.35, 0.7)), gate(of, (4.05, 0.7), (4.05, -0.7))
    assert rivals(of, minor)[through][1] == 1
    assert of.critical_gap[minor] == CRITICAL_GAPS["left"]
    assert of.light[minor] == -1


def test_a_map_without_a_closed_way_has_no_links() -> None:
    ends = [
        {"module": "dead_end", "x": -0.3, "y": 0.0, "yaw_deg": 180.0},
        {"module": "dead_end", "x": 0.3, "y": 0.0},
    ]
    assert roads(load_map(MapSpec.model_validate({"title": "Street", "placements": ends})), CLEARANCE).link_count == 0
