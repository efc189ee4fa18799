"""The even-odd test against shapely."""

import numba
import numpy as np
import pytest
import shapely

from autodrive.scenario.maps.area import drivable_edges, is_inside
from autodrive.scenario.maps.map import load_map


@pytest.mark.parametrize("name", ["mini_map", "tiny_town", "plane"])
def test_even_odd_rule_agrees_with_shapely(name):
    map_ = load_map(name)
    x0, y0, x1, y1 = map_.bounds
    points = np.random.default_rng(7).uniform((x0 - 0.5, y0 - 0.5), (x1 + 0.5, y1 + 0.5), (4000, 2))
    compiled = numba.njit(is_inside)
    ours = np.array([compiled(map_.drivable_edges, x, y) for x, y in points])
    assert (ours == shapely.contains_xy(map_.drivable, points)).all()
    assert [is_inside(map_.drivable_edges, x, y) for x, y in points[:50]] == ours[:50].tolist()


def test_edges_are_flat_closed_rings():
    ring = shapely.Point(0.0, 0.0).buffer(2.0).difference(shapely.Point(0.0, 0.0).buffer(1.0))
    edges = drivable_edges(ring)
    assert edges.dtype == np.float64
    assert edges.flags.c_contiguous
    assert np.hypot(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1]).sum() == pytest.approx(ring.length)
    assert not is_inside(edges, 0.0, 0.0)
    assert is_inside(edges, 1.5, 0.0)


def test_nothing_is_inside_nothing():
    assert drivable_edges(shapely.Polygon()).shape == (0, 4)
