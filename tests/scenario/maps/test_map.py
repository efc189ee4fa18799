"""The maps that come with the simulator."""

import math

import pytest
import shapely

from autodrive.physics.model import BOX
from autodrive.scenario import kinds, load_scenario
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.shapes import CHORD_ERROR

LIDAR_HEIGHT = 0.208
"""Of the plane in which the car's LIDAR looks [m]."""
TOWNS = ["mini_map", "tiny_town", "crossing"]


def flat(map_):
    return [one for one in map_.modules if one.module.spec.type not in {"terrain", "obstruction"}]


@pytest.mark.parametrize("name", kinds.names("map"))
def test_every_map_that_comes_with_the_simulator_is_sound(name):
    assert load_map(name).name == name


@pytest.mark.parametrize("name", TOWNS)
def test_every_port_of_a_town_meets_another(name):
    map_ = load_map(name)
    ports = {(i, port.name) for i, one in enumerate(map_.modules) for port in one.ports if not port.is_blind}
    assert set(map_.joins) == set(map_.joins.values()) == ports


@pytest.mark.parametrize("name", TOWNS)
def test_vehicle_starts_in_the_middle_of_a_lane_and_along_it(name):
    start = load_scenario(name).vehicles["V1"]
    point = load_map(name).lane_graph.nearest(start.x, start.y, start.yaw)
    assert point is not None
    assert (point.offset, point.yaw) == pytest.approx((0.0, start.yaw), abs=1e-9)


def test_mini_map_contains_every_module_of_the_kit():
    map_ = load_map("mini_map")
    kit = {name for name in kinds.names("module") if not name.startswith("wide_")}
    assert {one.module.name for one in map_.modules} == kit
    assert len(map_.boxes) == 8


@pytest.mark.parametrize(("name", "straights"), [("mini_map", 2 * 2.0 + 2 * 1.4), ("tiny_town", 2 * 3.8 + 2 * 2.8)])
def test_loop_round_a_town_is_four_straights_and_four_quarter_circles(name, straights):
    graph = load_map(name).lane_graph
    for radius in (0.55, 0.85):  # clockwise on the inner lane, counter-clockwise on the outer
        exact = straights + 2.0 * math.pi * radius
        # chords are shorter than arcs, by less than a part in ten thousand
        assert min(abs(graph.length(loop) - exact) for loop in graph.loops()) < 1e-4 * exact


def test_vehicle_on_the_mini_map_can_go_round_from_the_origin():
    graph = load_map("mini_map").lane_graph
    start = graph.nearest(0.0, 0.0, 0.0)
    assert start is not None
    assert graph.loop(start.lane) is not None


def test_every_lane_of_the_crossing_leads_on_to_all_lanes_with_its_number():
    lanes = load_map("crossing").lane_graph.lanes
    number = [one.name[-1] for one in lanes]
    assert number.count("1") == number.count("2") == 14 * 2 + 8
    for start in range(len(lanes)):
        reached, new = {start}, {start}
        while new:
            new = {after for lane in new for after in lanes[lane].successors} - reached
            reached |= new
        assert reached == {lane for lane in range(len(lanes)) if number[lane] == number[start]}


def test_loops_of_the_crossing_are_straights_and_quarter_circles():
    graph = load_map("crossing").lane_graph
    lengths = [graph.length(loop) for loop in graph.loops()]
    right = 4 * 1.2 + 4 * 0.5 * math.pi * 0.55  # clockwise on the outer lane, which turns right at the intersection
    left = 4 * 1.2 + (3 + 1) * 0.5 * math.pi * 1.15  # counter-clockwise on the inner lane
    # chords are shorter than arcs, by less than a part in ten thousand
    for exact in (right, left):
        assert min(abs(length - exact) for length in lengths) < 1e-4 * exact


def test_tiny_town_has_the_modules_and_the_extent_of_the_original():
    map_ = load_map("tiny_town")
    kinds = [one.module.name for one in flat(map_)]
    original = {"straight_road": 14, "road_patch": 7, "curved_road": 4, "dead_end": 1, "parking_lot": 1}
    original |= {"roadside_parking": 1, "three_way_intersection": 1, "four_way_intersection": 1}
    assert {kind: kinds.count(kind) for kind in set(kinds)} == original
    assert map_.bounds == pytest.approx((-1.8, -3.4, 5.0, 5.4))
    assert [shape.material for shape in map_.statics].count("block") == 9
    assert len(map_.props) == 20


def test_lawn_of_tiny_town_is_as_large_as_the_tiles_of_the_original():
    map_ = load_map("tiny_town")
    lawn = next(one.footprint for one in map_.modules if one.module.name == "lawn")
    roads = shapely.union_all([one.footprint for one in flat(map_)])
    # 3772 tiles of 0.1 m; corners of curved roads are lawn in our picture, but belong to the module
    assert lawn.difference(roads).area == pytest.approx(3772 * 0.01, abs=1e-6)


@pytest.mark.parametrize("name", TOWNS)
def test_lawn_and_road_fill_the_town_without_overlap(name):
    map_ = load_map(name)
    lawn, road = map_.lawn, map_.drivable
    whole = next(one.footprint for one in map_.modules if one.module.name == "lawn")
    assert lawn.intersection(road).area < 1e-9
    assert lawn.area + road.area == pytest.approx(whole.area, abs=1e-6)  # the union's grid is a micrometre


@pytest.mark.parametrize("name", TOWNS)
def test_road_of_a_town_is_one_piece_without_slivers(name):
    map_ = load_map(name)
    assert isinstance(map_.drivable, shapely.Polygon)
    assert map_.drivable.is_valid
    assert len(map_.drivable.interiors) == 2  # what the loop and the road through its middle surround
    # arcs: at most the chord error along 30 m of kerb
    assert map_.drivable.area == pytest.approx(sum(one.drivable.area for one in flat(map_)), abs=30 * CHORD_ERROR)


@pytest.mark.parametrize("name", TOWNS)
def test_lidar_sees_walls_blocks_and_boxes(name):
    map_ = load_map(name)
    solids = [shape for shape in map_.statics if shape.material in {"wall", "block"}] + list(map_.boxes[:2])
    assert all(low <= LIDAR_HEIGHT < high for low, high in (one.span for one in solids) if low < LIDAR_HEIGHT)
    plates = {
        shape.name.split("/")[0]: shape for shape in map_.statics if shape.material == "plate"
    }  # their last parts
    # the upper edge of a give-way sign is at 0.208 m
    assert all(plate.span[1] > LIDAR_HEIGHT - 1e-9 for plate in plates.values())
    assert any(shape.material == "wall" for shape in map_.statics)


@pytest.mark.parametrize("name", TOWNS)
def test_no_fixed_object_is_on_the_road(name):
    map_ = load_map(name)
    inner = map_.drivable.buffer(-0.02)  # signs stand at the very kerb, as in the original
    assert not [shape.name for shape in map_.statics if shape.kind == BOX and shape.plan.intersects(inner)]


def test_plane_is_empty_and_drivable():
    map_ = load_map("plane")
    assert map_.drivable.area == pytest.approx(400.0)
    assert (map_.statics, map_.boxes, map_.lane_graph.lanes) == ((), (), ())
    assert map_.ground.grip == 1.0
