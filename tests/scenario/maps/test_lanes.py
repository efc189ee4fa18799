"""Paths of lanes, and queries of the lane graph."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.scenario.maps.lanes import Piece, lane_graph, lane_path
from autodrive.scenario.maps.map import load_map


def test_path_between_poses_in_line_is_a_line():
    assert lane_path((0.0, 0.0, 0.0), (2.0, 0.0, 0.0)).tolist() == [[0.0, 0.0], [2.0, 0.0]]


@given(
    radius=st.floats(0.3, 3.0),
    turn=st.floats(0.2, 3.0),
    side=st.sampled_from([-1.0, 1.0]),
    before=st.floats(0.0, 2.0),
    yaw=st.floats(-3.0, 3.0),
)
def test_path_is_a_line_and_the_one_arc_that_keeps_both_headings(radius, turn, side, before, yaw):
    tangent = np.array([before, 0.0])
    centre = tangent + np.array([0.0, side * radius])
    end = centre + radius * np.array([math.sin(turn), -side * math.cos(turn)])
    c, s = math.cos(yaw), math.sin(yaw)
    turned = np.array([[c, -s], [s, c]])
    points = lane_path((0.0, 0.0, yaw), (*(turned @ end), yaw + side * turn)) @ turned
    on_arc = np.abs(np.hypot(*(points - centre).T) - radius) < 1e-6  # found by solving for the corner: rounding grows
    on_line = (np.abs(points[:, 1]) < 1e-6) & (points[:, 0] < before + 1e-6)
    assert (on_arc | on_line).all()
    assert points[-1] == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("end", [(-1.0, 0.0, 0.0), (1.0, 0.3, 0.0), (1.0, 0.0, math.pi), (-1.0, 1.0, math.pi / 2)])
def test_poses_without_a_path_are_an_error(end):
    with pytest.raises(ValueError, match="neither a line nor a single arc"):
        lane_path((0.0, 0.0, 0.0), end)


def square():
    """Four lanes round a square of 1 m, left about, and a detour of 3 m that replaces the first."""
    corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    pieces = [Piece(f"side_{i}", corners[[i, (i + 1) % 4]], i, (i + 1) % 4) for i in range(4)]
    detour = np.array([(0.0, 0.0), (0.0, -1.0), (1.0, -1.0), (1.0, 0.0)])
    pieces.append(Piece("detour", detour, 0, 1))
    return lane_graph(pieces)


def test_lanes_follow_each_other_where_end_and_start_are_the_same_node():
    graph = square()
    assert [lane.successors for lane in graph.lanes] == [(1,), (2,), (3,), (0, 4), (1,)]


def test_loop_is_the_shortest_that_comes_back():
    graph = square()
    assert graph.loop(3) == (3, 0, 1, 2)
    assert graph.loop(0) == (0, 1, 2, 3)
    assert graph.loop(4) == (4, 1, 2, 3)
    assert [graph.length(loop) for loop in graph.loops()] == [4.0, 6.0]


def test_a_lane_with_an_open_end_has_no_loop():
    one, other = np.array([(0.0, 0.0), (1.0, 0.0)]), np.array([(5.0, 0.0), (6.0, 0.0)])
    graph = lane_graph([Piece("a", one, 0, 1), Piece("b", other, 2, 3)])
    assert graph.loop(0) is None
    assert graph.loops() == ()


def test_nearest_point_has_lane_heading_and_side():
    point = square().nearest(0.3, 0.1)
    assert point is not None
    assert point.lane == 0
    assert point[1:] == pytest.approx((0.3, 0.0, 0.0, 0.1))
    right = square().nearest(0.3, -0.1)
    assert right is not None
    assert right.offset == pytest.approx(-0.1)


def test_nearest_lane_can_be_limited_to_a_driving_direction():
    point = square().nearest(0.5, 0.1, yaw=math.pi)
    assert point is not None
    assert point.lane == 2
    assert lane_graph([]).nearest(0.0, 0.0) is None


@given(x=st.floats(-2.0, 6.0), y=st.floats(-4.0, 6.0))
def test_nearest_point_is_as_near_as_shapely_finds(x, y):
    import shapely

    graph = TOWN.lane_graph
    lines = shapely.MultiLineString([lane.points for lane in graph.lanes])
    point = graph.nearest(x, y)
    assert point is not None
    assert abs(point.offset) == pytest.approx(lines.distance(shapely.Point(x, y)), abs=1e-9)


TOWN = load_map("tiny_town")


def test_every_loop_is_one_smooth_closed_path():
    for loop in TOWN.lane_graph.loops():
        path = TOWN.lane_graph.path(loop)
        assert path[0] == pytest.approx(path[-1], abs=1e-9)
        steps = np.diff(path, axis=0)
        headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        # between chords of an arc: at most the angle that one chord of the smallest arc (0.55 m) spans, 0.04 rad
        assert np.abs(np.diff(headings)).max() < 0.045
        assert abs(headings[-1] - headings[0]) == pytest.approx(2.0 * math.pi, abs=0.045)
