"""Placement of modules: they connect in any pose, and all errors are reported."""

import math

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from autodrive.base.errors import SpecError
from autodrive.base.specs import PlaceInFile
from autodrive.scenario.files import read_map
from autodrive.scenario.maps.map import compile_map, load_map, load_module
from autodrive.scenario.maps.placing import join, place
from autodrive.scenario.maps.spec import MapSpec, Placement

angles = st.floats(-180.0, 180.0)
lengths = st.floats(-20.0, 20.0)
chains = st.lists(
    st.sampled_from(["straight_road", "road_patch", "roadside_parking", "curved_road"]), min_size=1, max_size=5
)


def chain(names, x, y, yaw_deg):
    """Placements each of whose first port meets the last port of the one before, as x, y, yaw of map axes."""
    placements = []
    yaw = math.radians(yaw_deg)
    for name in names:
        ports = load_module(name).spec.ports
        entry, leave = ports["west"], ports.get("north") or ports["east"]
        heading = yaw - math.radians(entry.yaw_deg) + math.pi
        c, s = math.cos(heading), math.sin(heading)
        at = (x - c * entry.x + s * entry.y, y - s * entry.x - c * entry.y)
        placements.append(Placement(module=name, x=at[0], y=at[1], yaw_deg=math.degrees(heading)))
        x, y = at[0] + c * leave.x - s * leave.y, at[1] + s * leave.x + c * leave.y
        yaw = heading + math.radians(leave.yaw_deg)
    return placements


def with_open_ends(placements):
    first, last = placements[0], placements[-1]
    placements[0] = first.model_copy(update={"open": True})
    placements[-1] = last.model_copy(update={"open": True})
    return placements


@settings(max_examples=40, deadline=None)
@given(names=chains, x=lengths, y=lengths, yaw_deg=angles)
def test_chain_of_modules_joins_wherever_it_lies_and_however_it_is_turned(names, x, y, yaw_deg):
    turns = sum("north" in load_module(name).spec.ports for name in names)
    assume(turns <= 2)  # three left turns and a bit: the chain would run into itself
    placements = with_open_ends(chain(["straight_road", *names], x, y, yaw_deg))
    map_ = load_map(MapSpec(title="Chain", placements=tuple(placements)))
    assert len(map_.joins) == 2 * len(names)
    areas = sum(load_module(name).drivable.area for name in ["straight_road", *names])
    # the union is taken on a grid of a micrometre, along a few metres of outline
    assert map_.drivable.area == pytest.approx(areas, abs=1e-4)
    assert map_.drivable.geom_type == "Polygon"
    lane, passed = 0, [0]
    while map_.lane_graph.lanes[lane].successors:
        (lane,) = map_.lane_graph.lanes[lane].successors
        passed.append(lane)
    assert passed[-1] == 2 * len(names)
    assert len(passed) == len(names) + 1


@settings(max_examples=30, deadline=None)
@given(yaw_deg=angles, dx=st.floats(0.01, 0.1), dy=st.floats(-0.1, 0.1))
def test_error_of_a_displaced_module_says_how_to_move_it(yaw_deg, dx, dy):
    first, second = with_open_ends(chain(["straight_road", "straight_road"], 0.0, 0.0, yaw_deg))
    moved = second.model_copy(update={"x": second.x + dx, "y": second.y + dy})
    with pytest.raises(SpecError, match="do not meet") as caught:
        load_map(MapSpec(title="Gap", placements=(first, moved)))
    shift = next(error for error in caught.value.errors if "do not meet" in error).split("by (")[1].split(")")[0]
    assert [float(number) for number in shift.split(",")] == pytest.approx([-dx, -dy], abs=1e-3)  # four digits


def broken(tmp_path, text):
    path = tmp_path / "oval.yaml"
    path.write_text(text)
    with pytest.raises(SpecError) as caught:
        load_map(path)
    return caught.value


def test_all_errors_of_a_map_are_reported_at_once_with_their_places(tmp_path):
    error = broken(
        tmp_path,
        """
title: Oval
placements:
  - {module: straight_road, x: 0.0, y: 0.0, open: true}
  - {module: straight_road, name: shifted, x: 0.61, y: 0.0, open: [east]}
  - {module: straight_road, x: 5.0, y: 0.0, open: true}
  - {module: curve_9, x: 9.0, y: 9.0}
  - {module: curved_road, x: 5.1, y: 0.1, open: true}
  - {module: road_patch, name: turned, x: 0.0, y: 7.0, mass: 2.0, open: [north]}
  - {module: construction_box, x: 3.0, y: 3.0, mass: -1.0}
  - {module: construction_box, name: box, x: 2.0, y: 2.0}
  - {module: construction_box, name: box, x: 2.05, y: 2.0}
  - {module: straight_road, x: nowhere, y: 0.0}
walls:
  - {points: [[0, 0]], height: 0.2}
colour: green
""",
    )
    text = str(error)
    expected = [
        "placement 4 'curve_9' (line 7): module 'curve_9' is not known. Known: ",
        "Did you mean 'curved_road'?",
        "placement 1 'straight_road' (line 4): port 'east' and port 'west' of placement 2 'shifted' (line 5) do not",
        "Move the second module by (-0.01, 0) m",
        "placement 3 'straight_road' (line 6) overlaps placement 5 'curved_road'",
        "placement 6 'turned' (line 9): mass cannot be set for road_patch, which is a road",
        "placement 6 'turned' (line 9): open: road_patch has no port 'north'. Ports of road_patch: east, west",
        "placement 7.mass (line 10): must be at least 0.001, not -1.0",
        "placement 9 'box' (line 12): the name 'box' is already used",
        "placement 8 'box' (line 11) overlaps placement 9 'box' (line 12) by 50 cm^2",
        "placement 10.x (line 13): must be a number, not 'nowhere'",
        "wall 1.points (line 15)",
        "'colour' is not a known key",
    ]
    assert [part for part in expected if part not in text] == []
    assert all(f"map 'oval': {error}" in text for error in expected if error.startswith("placement "))
    assert text.endswith(f"({error.path})")
    assert "is not connected" not in text  # an invalid placement may be the missing neighbour


def test_open_end_is_an_error_unless_it_is_declared(tmp_path):
    road = "title: Road\nplacements:\n  - {module: straight_road, x: 1.0, y: 0.0, yaw_deg: 90"
    error = broken(tmp_path, f"{road}, open: [east]}}\n")
    assert len(error.errors) == 1
    assert "port 'west' is not connected. Place a module with a port at (1, -0.3) that faces 90 degrees" in str(error)
    path = tmp_path / "road.yaml"
    path.write_text(f"{road}, open: true}}\n")
    assert load_map(path).joins == {}


def test_ports_of_different_heading_or_width_are_an_error(tmp_path):
    (tmp_path / "lane.yaml").write_text(
        "title: Lane\ntype: road\nlength: 1\nwidth: 0.3\n"
        "ports: {west: {x: -0.5, y: 0, yaw_deg: 180, width: 0.3}}\n"
        "drivable:\n  - {shape: rectangle, length: 1, width: 0.3}\n"
    )
    straight = "{module: straight_road, x: 0, y: 0, open: true}"
    error = broken(tmp_path, f"title: T\nplacements:\n  - {straight}\n  - {{module: lane.yaml, x: 0.8, y: 0}}\n")
    assert "have different widths: 0.6 m and 0.3 m" in str(error)
    x, y = 0.3 + 0.3 * math.cos(0.1), 0.3 * math.sin(0.1)
    turned = f"{{module: straight_road, x: {x}, y: {y}, yaw_deg: {math.degrees(0.1)}, open: true}}"
    error = broken(tmp_path, f"title: T\nplacements:\n  - {straight}\n  - {turned}\n")
    assert "do not face each other: turn the second module by -5.73 degrees" in str(error)


def test_boxes_may_be_piled_but_not_put_into_each_other_or_into_a_wall(tmp_path):
    boxes = (
        "  - {module: construction_box, name: low, x: 0, y: 0}\n"
        "  - {module: construction_box, name: high, x: 0, y: 0, z: 0.25, mass: 0.4, height: 0.1, length: 0.08}\n"
    )
    path = tmp_path / "pile.yaml"
    path.write_text(f"title: Pile\nplacements:\n{boxes}")
    low, high = load_map(path).boxes
    assert low.position[2] == pytest.approx(0.125)
    assert (high.position[2], high.mass, high.size) == (pytest.approx(0.3), 0.4, (0.08, 0.1, 0.1))
    error = broken(tmp_path, f"title: Pile\nplacements:\n{boxes.replace('z: 0.25', 'z: 0.2')}")
    assert "placement 1 'low' (line 3) overlaps placement 2 'high' (line 4)" in str(error)
    wall = "walls:\n  - {points: [[-1, 0], [1, 0]], height: 0.1}\n"
    assert "placement 1 'low' (line 3) overlaps 'wall_1'" in str(
        broken(tmp_path, f"title: P\nplacements:\n{boxes}{wall}")
    )


def test_names_of_solid_objects_must_be_unique(tmp_path):
    block = "  - {name: house, x: 0, y: 0, length: 1, width: 1, height: 1}\n"
    assert "the name 'house' is used by 2 solid objects" in str(broken(tmp_path, f"title: T\nblocks:\n{block}{block}"))


def test_module_files_may_be_in_the_folder_of_the_map(tmp_path):
    (tmp_path / "round.yaml").write_text(
        "title: Round\ntype: road\nlength: 2\nwidth: 2\n"
        "drivable:\n  - {shape: sector, outer_radius: 1, start_deg: 0, end_deg: 360}\n"
    )
    path = tmp_path / "arena.yaml"
    path.write_text("title: Arena\nplacements:\n  - {module: round.yaml, x: 4, y: 0}\n")
    assert load_map(path).drivable.distance(shapely.Point(4.0, 0.0)) == 0.0


def repaired(placements):
    """The placements with the first problem of two ports solved as it says; None if there is none."""
    placed, _ = place(read_map(MapSpec(title="Chain", placements=tuple(placements)))[0])
    _, problems = join(placed, is_complete=True)
    for problem in problems:
        if problem.kind in ("apart", "turned") and isinstance(problem.other, PlaceInFile) and problem.other_port:
            index = int(problem.other.location[1])
            second = placements[index]
            px, py, _ = problem.other_port.pose  # it is turned about its port
            c, s = math.cos(problem.turn), math.sin(problem.turn)
            x = px + c * (second.x - px) - s * (second.y - py) + problem.dx
            y = py + s * (second.x - px) + c * (second.y - py) + problem.dy
            changes = {"x": x, "y": y, "yaw_deg": second.yaw_deg + math.degrees(problem.turn)}
            return [*placements[:index], second.model_copy(update=changes), *placements[index + 1 :]]
    return None


@settings(max_examples=40, deadline=None)
@given(
    names=st.lists(st.sampled_from(["straight_road", "roadside_parking", "curved_road"]), min_size=1, max_size=5),
    dx=st.floats(-0.05, 0.05),
    dy=st.floats(-0.05, 0.05),
    turn=st.floats(-10.0, 10.0),
    which=st.integers(0, 5),
)
def test_what_a_problem_says_repairs_the_map(names, dx, dy, turn, which):
    """The numbers of a problem are compared with what they lead to, not with their formula.

    No end comes nearer to an end that it does not belong to: the modules are long, and are moved by less.
    """
    placements = [one.model_copy(update={"open": True}) for one in chain(["straight_road", *names], 0.0, 0.0, 0.0)]
    which %= len(placements)
    one = placements[which]
    moved = {"x": one.x + dx, "y": one.y + dy, "yaw_deg": one.yaw_deg + turn}
    left = [*placements[:which], one.model_copy(update=moved), *placements[which + 1 :]]
    for _ in range(4 * len(placements)):
        after = repaired(left)
        if after is None:
            return
        left = after
    pytest.fail("there are problems after each repair")


def test_each_problem_names_its_parts_and_its_ports():
    spec = MapSpec(
        title="Wrong",
        placements=(
            Placement(module="straight_road", x=0.0, y=0.0, open=("west",)),
            Placement(module="straight_road", x=0.65, y=0.0, open=("east",)),
            Placement(module="straight_road", x=5.0, y=0.0, open=("west",)),
            Placement(module="road_patch", x=5.1, y=0.0, open=True),
        ),
    )
    _, problems = compile_map(read_map(spec)[0])
    found = {(one.kind, getattr(one.part, "location", ())[1:], getattr(one.port, "name", "")) for one in problems}
    assert ("apart", (0,), "east") in found
    assert any(kind == "overlap" and index == (2,) for kind, index, _ in found)
    apart = next(one for one in problems if one.kind == "apart")
    assert (apart.dx, apart.dy) == pytest.approx((-0.05, 0.0))
    assert getattr(apart.other_port, "name", "") == "west"
