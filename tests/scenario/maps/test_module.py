"""The shipped modules against closed forms and the rules for modules."""

import itertools
import math

import numpy as np
import pytest
import shapely

from autodrive.base.errors import SpecError
from autodrive.base.yaml_files import parse
from autodrive.scenario import kinds
from autodrive.scenario.maps.map import load_module
from autodrive.scenario.maps.module import DRIVING_SIDE, ModuleSpec
from autodrive.scenario.maps.shapes import CHORD_ERROR

QUARTER = math.pi / 4.0
AREAS = {
    "straight_road": 0.36,
    "road_patch": 0.12,
    "curved_road": QUARTER * (1.0 - 0.4**2),
    "dead_end": 0.36,
    "three_way_intersection": 1.4 - 2.0 * QUARTER * 0.4**2,
    "four_way_intersection": 1.96 - 4.0 * QUARTER * 0.4**2,
    "roadside_parking": 1.8,
    "parking_lot": (1.4 - 2.0 * QUARTER * 0.4**2) + 1.4 * 1.55 + 0.6 * 0.05,
    "wide_straight_road": 1.44,
    "wide_curved_road": QUARTER * (1.6**2 - 0.4**2),
    "wide_four_way_intersection": 4.0 - 4.0 * QUARTER * 0.4**2,
    "lawn": 0.0,
    "construction_box": 0.0,
}
TABLE_11 = {
    "Straight Road": "road",
    "Curved Road": "road",
    "Dead End": "road",
    "3-Way Intersection": "intersection",
    "4-Way Intersection": "intersection",
    "Roadside Parking": "parking",
    "Parking Lot": "parking",
    "Lawn": "terrain",
    "Construction Box": "obstruction",
}
DRIVABLE = [name for name, area in AREAS.items() if area]
MINIMUM_TURNING_RADIUS = 0.24515
"""Of the car, rear axle [m] (report, table 10)."""


def test_the_modules_are_the_nine_of_the_report_the_filler_and_wide_roads():
    kit = {load_module(name).spec.title: load_module(name).spec.type for name in kinds.names("module")}
    wide = {"Wide Straight Road": "road", "Wide Curved Road": "road", "Wide 4-Way Intersection": "intersection"}
    assert kit == {**TABLE_11, **wide, "Road Patch": "road"}


@pytest.mark.parametrize("name", AREAS)
def test_drivable_area_is_that_of_the_closed_form(name):
    # an arc may be off by the chord error along its length; no module has more than 4 m of arcs
    assert load_module(name).drivable.area == pytest.approx(AREAS[name], abs=CHORD_ERROR * 4.0)


def test_curve_has_the_kerbs_of_the_report():
    corner = shapely.Point(-0.5, 0.5)
    curve = load_module("curved_road").drivable
    assert curve.distance(corner) == pytest.approx(0.4, abs=CHORD_ERROR)
    assert shapely.hausdorff_distance(curve, corner) == pytest.approx(1.0, abs=CHORD_ERROR)


def test_lanes_of_the_curve_are_quarter_circles_half_a_lane_beside_its_middle():
    outer, inner = load_module("curved_road").lanes
    radii = sorted((0.7 - DRIVING_SIDE * 0.15, 0.7 + DRIVING_SIDE * 0.15))
    lengths = sorted(float(np.hypot(*np.diff(lane, axis=0).T).sum()) for lane in (inner, outer))
    # chords are shorter than their arc by 8/3 of the chord error over the length of a chord, squared: 1e-4 at most
    assert lengths == pytest.approx([radius * math.pi / 2.0 for radius in radii], rel=1e-3)


@pytest.mark.parametrize("name", DRIVABLE)
def test_whole_width_of_every_lane_is_drivable(name):
    module = load_module(name)
    for lane in module.lanes:
        # the first chord of an arc is not quite square to the port: what sticks out of the module is not asked about
        strip = shapely.LineString(lane).buffer(0.15, cap_style="flat").intersection(module.footprint)
        # a lane that turns touches the kerb, where both are chords
        assert strip.difference(module.drivable.buffer(2.0 * CHORD_ERROR)).area < 1e-9


@pytest.mark.parametrize("name", DRIVABLE)
def test_car_can_follow_every_lane(name):
    for lane in load_module(name).lanes:
        a, b, c = lane[:-2], lane[1:-1], lane[2:]
        ab, bc, ca = (np.hypot(*(p - q).T) for p, q in ((a, b), (b, c), (c, a)))
        twice_area = np.abs(np.cross(np.c_[b - a, np.zeros(len(a))], np.c_[c - a, np.zeros(len(a))])[:, 2])
        radius = ab * bc * ca / np.maximum(2.0 * twice_area, 1e-12)  # of the circle through three points
        assert (radius > MINIMUM_TURNING_RADIUS).all()


@pytest.mark.parametrize("name", DRIVABLE)
def test_traffic_keeps_to_its_side_at_every_port(name):
    spec = load_module(name).spec
    for port in spec.ports.values():
        for lane in range(1, port.lanes + 1):
            x, y, yaw = port.pose_out(lane)
            left = -math.sin(yaw) * (x - port.x) + math.cos(yaw) * (y - port.y)
            assert left == pytest.approx(DRIVING_SIDE * (0.3 * lane - 0.15))
            assert math.hypot(x - port.pose_in(lane)[0], y - port.pose_in(lane)[1]) == pytest.approx(0.6 * lane - 0.3)


@pytest.mark.parametrize("name", DRIVABLE)
def test_every_port_opens_on_drivable_ground_across_its_whole_width(name):
    module = load_module(name)
    for port in module.spec.ports.values():
        x, y, yaw = port.pose
        across = np.array([-math.sin(yaw), math.cos(yaw)]) * (port.width / 2.0)
        mouth = shapely.LineString([np.array([x, y]) - across, np.array([x, y]) + across])
        assert module.drivable.buffer(1e-9).covers(mouth)
        solid_lines = [line for kind, line in module.markings if kind == "edge"]
        assert not any(
            line.intersects(shapely.LineString([mouth.interpolate(0.1), mouth.interpolate(0.5)]))
            for line in solid_lines
        )


@pytest.mark.parametrize("name", DRIVABLE)
def test_paint_lies_on_the_road_and_inside_the_footprint(name):
    module = load_module(name)
    assert module.footprint.buffer(1e-9).covers(module.drivable)
    for kind, line in module.markings:
        assert module.drivable.buffer(CHORD_ERROR).covers(line), kind


@pytest.mark.parametrize("name", [name for name in AREAS if "intersection" in name])
def test_intersection_has_a_stop_line_and_a_crossing_at_every_arm(name):
    module = load_module(name)
    kinds = [kind for kind, _ in module.markings]
    assert kinds.count("stop_line") == kinds.count("crossing") == len(module.spec.ports)
    for (kind, line), lane in itertools.product(module.markings, module.lanes):
        if kind == "stop_line":
            inbound = shapely.LineString(
                [lane[0], lane[0] + (lane[1] - lane[0]) / np.hypot(*(lane[1] - lane[0])) * 0.06]
            )
            outbound = shapely.LineString(
                [lane[-1] - (lane[-1] - lane[-2]) / np.hypot(*(lane[-1] - lane[-2])) * 0.06, lane[-1]]
            )
            assert line.intersects(inbound) == (line.distance(shapely.Point(lane[0])) < 0.05)
            assert not line.intersects(outbound)


@pytest.mark.parametrize("name", ["parking_lot", "roadside_parking"])
def test_bays_hold_a_car_and_stand_clear_of_the_lanes_and_of_each_other(name):
    module = load_module(name)
    bays = [bay.geometry() for bay in module.spec.bays]
    assert all(bay.length >= 0.3185 and bay.width >= 0.175 for bay in module.spec.bays)  # the car's length and width
    assert all(module.drivable.buffer(1e-9).covers(bay) for bay in bays)
    assert all(a.intersection(b).area < 1e-9 for a, b in itertools.combinations(bays, 2))
    for lane in module.lanes:
        strip = shapely.LineString(lane).buffer(0.15, cap_style="flat")
        assert all(strip.intersection(bay).area < 1e-9 for bay in bays)


def test_all_errors_of_a_module_are_reported_at_once():
    text = """
title: Broken
type: road
length: 0.6
width: 0.6
ports:
  east: {x: 0.2, y: 0.0, yaw_deg: 0, width: 0.6}
  west: {x: -0.3, y: 0.0, yaw_deg: 180, width: 0.6}
lanes: [[west, eats], [west, west]]
"""
    with pytest.raises(SpecError) as caught:
        parse(text, ModuleSpec)
    message = str(caught.value)
    assert "port 'eats' is not known. Known: east, west. Did you mean 'east'?" in message
    assert "port 'east' must be on an edge of the footprint" in message
    assert "lane from 'west' to 'west': neither a line nor a single arc connects the two poses" in message


def test_road_has_no_mass_and_a_box_has_one():
    with pytest.raises(SpecError, match="an obstruction needs height and mass; other types must not have them"):
        parse("title: Stone\ntype: obstruction\nlength: 1\nwidth: 1\n", ModuleSpec)
    with pytest.raises(SpecError, match="an obstruction needs height and mass; other types must not have them"):
        parse("title: Road\ntype: road\nlength: 1\nwidth: 1\nmass: 3\n", ModuleSpec)
