"""Shapes against closed forms."""

import math

import pytest
import shapely

from autodrive.base.errors import SpecError
from autodrive.base.yaml_files import parse
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.shapes import CHORD_ERROR, Arc, Line, Polygon, Rectangle, Sector, arc


def test_rectangle_has_its_area_and_turns_about_its_centre():
    shape = Rectangle(shape="rectangle", x=1.0, y=2.0, yaw_deg=90.0, length=0.6, width=0.2).geometry()
    assert shape.area == pytest.approx(0.12, abs=1e-12)  # rounding only
    assert shape.bounds == pytest.approx((0.9, 1.7, 1.1, 2.3), abs=1e-12)


@pytest.mark.parametrize(("inner", "outer", "start", "end"), [(0.4, 1.0, -90.0, 0.0), (0.0, 0.5, 0.0, 360.0)])
def test_sector_has_the_area_of_a_ring_piece_or_disc(inner, outer, start, end):
    shape = Sector(shape="sector", inner_radius=inner, outer_radius=outer, start_deg=start, end_deg=end).geometry()
    assert shape.is_valid
    sweep = math.radians(end - start)
    # chord error times arc lengths
    assert shape.area == pytest.approx(sweep / 2.0 * (outer**2 - inner**2), abs=CHORD_ERROR * sweep * (outer + inner))


def test_no_chord_is_farther_from_its_arc_than_the_tolerance():
    for radius in (0.01, 0.4, 1.0, 30.0):
        points = arc((0.0, 0.0), radius, 0.3, 2.9)
        middles = (points[1:] + points[:-1]) / 2.0
        assert max(radius - math.hypot(*point) for point in middles) <= CHORD_ERROR * (1.0 + 1e-9)  # rounding


def test_dashes_fill_half_the_line_and_leave_half_a_gap_at_each_end():
    dashes = Line(shape="line", points=((0.0, 0.0), (0.6, 0.0)), width=0.012, dash=0.1, gap=0.1).geometry()
    assert len(shapely.get_parts(dashes)) == 3
    assert dashes.area == pytest.approx(0.3 * 0.012, abs=1e-12)
    assert (dashes.bounds[0], dashes.bounds[2]) == pytest.approx((0.05, 0.55), abs=1e-12)


def test_dashes_follow_an_arc_in_a_whole_number_of_periods():
    line = Arc(shape="arc", radius=0.7, start_deg=0.0, end_deg=90.0, width=0.012, dash=0.1, gap=0.1).geometry()
    assert len(shapely.get_parts(line)) == round(0.7 * math.pi / 2.0 / 0.2)
    # half of the arc is painted; chords make it shorter by less than one part in a thousand
    assert line.area == pytest.approx(0.7 * math.pi / 4.0 * 0.012, rel=1e-3)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (
            "{shape: sector, inner_radius: 1.0, outer_radius: 0.4, start_deg: 0, end_deg: 90}",
            "greater than inner_radius",
        ),
        ("{shape: sector, outer_radius: 0.4, start_deg: 90, end_deg: 0}", "end_deg must be greater"),
        ("{shape: polygon, points: [[0, 0], [1, 1], [1, 0], [0, 1]]}", "must not cross"),
        ("{shape: line, points: [[0, 0], [1, 0]], width: 0.1, dash: 0.1}", "dash and gap must be given together"),
        ("{shape: rectangle, length: -1, width: 1}", "at least 0.001"),
        ("{shape: circle, radius: 1}", "rectangle"),
    ],
)
def test_impossible_shape_is_refused_with_the_valid_range(shape, message):
    with pytest.raises(SpecError, match=message):
        parse(f"title: T\ntype: road\nlength: 1\nwidth: 1\ndrivable:\n  - {shape}\n", ModuleSpec)


def test_polygon_goes_through_its_points():
    assert Polygon(shape="polygon", points=((0.0, 0.0), (2.0, 0.0), (0.0, 2.0))).geometry().area == pytest.approx(2.0)
