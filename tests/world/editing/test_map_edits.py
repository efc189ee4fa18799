"""Edits of the map of a running World: a map is built from nothing, with undo, problems and repairs, by two people."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import autodrive
from autodrive import Command, CommandError, Frame, Simulation, SpecError
from autodrive.base.errors import AutodriveError
from autodrive.base.yaml_files import parse
from autodrive.cli.spec_files import check
from autodrive.protocol.messages import (
    AddBox,
    CloseLoop,
    Collision,
    EditMap,
    MapBlock,
    MapModule,
    MapPart,
    MapProp,
    MapWall,
    OffRoad,
    Operation,
    Place,
    Redo,
    RemoveBox,
    RemoveTraffic,
    Reset,
    Teleport,
    Undo,
    UseMap,
)
from autodrive.protocol.native import MapScene
from autodrive.scenario.kinds import find
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.spec import MAX_PLACEMENTS, MapSpec
from autodrive.world import World
from autodrive.world.editing.map_edits import edited_map, own_map, parts_of
from autodrive.world.editing.map_scene import map_scene
from autodrive.world.factory import new_world
from tests.support.frames import digest, digests

WALL = MapWall(((2.0, -1.0), (2.0, 1.0)), height=0.2)
BLOCK = MapBlock(4.0, -4.0, 1.0, 1.0, 1.0)
CURVES = {f"curve_{i}": MapModule("curved_road", x, y, i * math.pi / 2) for i, (x, y) in enumerate([
    (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)
])}  # fmt: skip
"""The smallest closed loop."""


class Building:
    """A Simulation whose requests are executed at once, in this thread."""

    def __init__(self, scenario: str | Path = "plane") -> None:
        self.simulation = Simulation(new_world(scenario), speed=None, load=new_world)

    @property
    def world(self) -> World:
        return self.simulation.world

    @property
    def scene(self) -> MapScene:
        """As a client gets it."""
        found = map_scene(self.world, lambda name, _: name)
        assert found is not None
        return found

    def ask(self, *operations: Operation) -> Frame:
        for operation in operations:
            done = self.simulation.request(operation)
            self.simulation.execute_requests()
            done.result(0)
        return self.world.frame

    def put(self, **parts: MapPart | None) -> Frame:
        return self.ask(EditMap(parts))

    def drive(self, ticks: int, throttle: float = 0.0) -> list[Frame]:
        return [self.world.step({"V1": Command(throttle)}) for _ in range(ticks)]


def test_a_closed_loop_is_built_from_an_empty_plane_and_is_that_of_a_file(tmp_path: Path) -> None:
    building, states = Building(), set[str]()
    for name, part in CURVES.items():
        building.put(**{name: part})
        states = {port.state for ports in building.scene.ports.values() for port in ports.values()}
        assert states <= {"free", "joined"}
    assert building.scene.problems == []
    assert states == {"joined"}
    assert [len(lane.successors) for lane in building.world.map.lane_graph.lanes] == [1] * 8
    file = tmp_path / "map.yaml"
    file.write_text(building.simulation.map_text("My loop"))
    assert check(str(file))[0] == "map"
    assert load_map(file).drivable.equals(building.world.map.drivable)
    assert yaml.safe_load(file.read_text())["title"] == "My loop"
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(building.simulation.scenario_text())
    (tmp_path / "with_file.yaml").write_text(f"map: {file}\n")
    building.ask(Reset(1))
    drives = [
        digests(world, 50, lambda _: {"V1": Command(0.5, 0.3)})
        for world in (building.world, autodrive.make(scenario, 1), autodrive.make(tmp_path / "with_file.yaml", 1))
    ]
    assert drives[0] == drives[1] == drives[2]


def test_an_open_end_counts_as_open_while_a_map_is_built(tmp_path: Path) -> None:
    building = Building()
    building.put(a=MapModule("straight_road", 0.0, 0.0))
    assert {problem.kind for problem in building.scene.problems} == {"unconnected"}
    assert building.scene.ports == {
        "a": {
            "east": building.scene.ports["a"]["east"],
            "west": building.scene.ports["a"]["west"],
        }
    }
    assert {port.state for port in building.scene.ports["a"].values()} == {"free"}
    text = building.simulation.map_text()
    (tmp_path / "draft.yaml").write_text(text)
    assert parse(text, MapSpec).is_draft
    assert load_map(tmp_path / "draft.yaml").modules  # it can be used and built further
    kind, _, warnings = check(str(tmp_path / "draft.yaml"))
    assert (kind, len(warnings)) == ("map", 2)
    assert all("is not connected" in warning and "(line " in warning for warning in warnings)
    (tmp_path / "finished.yaml").write_text(text.replace("is_draft: true\n", ""))
    with pytest.raises(SpecError, match="port 'east' is not connected"):
        load_map(tmp_path / "finished.yaml")


def test_each_problem_is_repaired_by_what_it_offers() -> None:
    building = Building()
    shifted = MapModule("curved_road", 0.81, 0.23, 0.0)
    turned = MapModule("dead_end", 1.0, 1.02, math.pi / 2 + 0.1)
    building.put(a=MapModule("straight_road", 0.0, 0.0), b=shifted, c=turned)
    kinds = []
    for _ in range(20):
        problems = building.scene.problems
        if not problems:
            break
        kinds.append(problems[0].kind)
        assert problems[0].parts
        building.ask(EditMap({**problems[0].repair}))
    assert building.scene.problems == []
    assert {"apart", "turned", "unconnected"} <= {*kinds}
    parts = building.scene.parts
    assert isinstance(parts["b"], MapModule)
    assert (parts["b"].x, parts["b"].y) == pytest.approx((0.8, 0.2), abs=1e-6)


def test_overlapping_roads_are_a_problem_at_their_place() -> None:
    building = Building()
    building.put(a=MapModule("straight_road", 0.0, 3.0, open=True), b=MapModule("road_patch", 0.1, 3.0, open=True))
    (problem,) = (problem for problem in building.scene.problems if problem.kind == "overlap")
    assert (problem.parts, problem.repair) == (["a", "b"], {})
    assert (problem.x, problem.y) == pytest.approx((0.1, 3.0), abs=0.15)


def test_a_wall_on_a_lane_is_a_problem_and_one_beside_it_is_none() -> None:
    building = Building()
    building.put(
        road=MapModule("straight_road", 0.0, 3.0, open=True),
        beside=MapWall(((-0.3, 3.4), (0.3, 3.4)), 0.2),
        across=MapWall(((0.1, 2.9), (0.1, 3.5)), 0.2, thickness=0.05),
    )
    (problem,) = building.scene.problems
    assert (problem.kind, problem.parts) == ("blocked", ["across", "road"])
    assert (problem.x, problem.y) == pytest.approx((0.1, 3.15), abs=0.01)  # the lane to the west
    assert problem.text == "wall 2 stands on a lane of placement 1 'road'. Move it."


def test_each_action_is_undone_in_one_step_also_a_turn() -> None:
    building = Building()
    steps: list[tuple[Operation, str]] = [
        (EditMap({"a": MapModule("curved_road", 3.0, 3.0)}), "add a"),
        (EditMap({"a": MapModule("curved_road", 3.0, 3.0, 1.5)}), "move a"),
        (EditMap({"w": WALL}), "add w"),
        (EditMap({"a": MapModule("curved_road", 3.0, 3.0, 1.5, open=("west",))}), "change a"),
        (EditMap({"b": BLOCK, "p": MapProp("stop", 3.0, -3.0, 0.0)}), "add 2 parts of the map"),
        (EditMap({"b": None}), "remove b"),
        (AddBox("crate", 1.0, 0.5), "add crate"),
        (UseMap("mini_map"), "use the map mini_map"),
    ]  # fmt: skip
    states = [building.scene.parts]
    for operation, name in steps:
        building.ask(operation)
        assert building.simulation.undo_name == name
        states.append(building.scene.parts)
    for before in reversed(states[:-1]):
        building.ask(Undo())
        assert building.scene.parts == before
    assert building.world.spec.map == "plane"
    for after in states[1:]:
        building.ask(Redo())
        assert building.scene.parts == after


def test_the_second_of_two_people_who_change_the_same_part_is_told() -> None:
    building = Building()
    building.put(a=MapModule("straight_road", 3.0, 0.0), b=MapModule("straight_road", 3.0, 2.0))
    seen = building.scene.parts  # by both
    building.ask(EditMap({"a": MapModule("straight_road", 3.0, 0.5)}, {"a": seen["a"]}))
    building.ask(EditMap({"b": None}, {"b": seen["b"]}))  # another part
    for parts, known in (
        ({"a": MapModule("straight_road", 3.0, 1.0)}, {"a": seen["a"]}),
        ({"b": MapModule("straight_road", 3.0, 3.0)}, {"b": seen["b"]}),
        ({"a": MapModule("dead_end", 9.0, 9.0)}, {"a": None}),
    ):
        before = building.simulation.map_text()
        with pytest.raises(CommandError, match="was changed by another client in the meantime"):
            building.ask(EditMap({**parts}, {**known}))
        assert building.simulation.map_text() == before
    assert building.simulation.undo_name == "remove b"


def test_other_edits_go_on_in_a_map_that_is_built() -> None:
    building = Building()
    building.put(a=MapModule("straight_road", 3.0, 0.0))
    building.ask(AddBox("crate", 1.0, 0.5), Place("V1", 0.2, 0.1))
    building.put(b=MapModule("straight_road", 3.0, 2.0))
    assert building.world.spec.boxes["crate"].x == 1.0
    assert building.world.spec.vehicles["V1"].x == 0.2
    building.ask(Undo(), Undo())
    assert building.world.spec.vehicles["V1"].x == 0.0
    assert [*building.scene.parts] == ["a"]


def test_time_and_vehicles_go_on_and_meet_the_new_wall() -> None:
    building = Building()
    before = building.drive(100, 0.5)[-1]
    building.put(w=WALL)
    after = building.world.frame
    assert (after.tick, digest(after.vehicles["V1"].pose)) == (before.tick, digest(before.vehicles["V1"].pose))
    events = [event for frame in building.drive(1500, 0.5) for event in frame.events]
    hits = [event for event in events if isinstance(event, Collision)]
    assert [hit.other for hit in hits][:1] == ["w_1"]
    assert hits[0].position[0] == pytest.approx(1.95, abs=0.02)  # its face


def test_numbers_of_numpy_are_numbers() -> None:
    building = Building()
    building.ask(EditMap({"stop": MapProp("stop", np.float64(1.25), np.float32(0.5), np.float32(0.25))}))  # pyright: ignore[reportArgumentType]
    stop = building.scene.parts["stop"]
    assert isinstance(stop, MapProp)
    assert (stop.x, stop.y, stop.yaw) == pytest.approx((1.25, 0.5, 0.25), abs=1e-7)


def test_a_wall_where_a_vehicle_stands_is_refused_and_nothing_is_lost() -> None:
    building = Building()
    building.put(w=WALL)
    x = float(building.drive(300, 0.5)[-1].vehicles["V1"].pose.position[0])
    assert x > 0.5
    for at in (0.0, x):  # where it starts, and where it is
        with pytest.raises(AutodriveError, match=r"V1.*(overlap|is where)"):
            building.put(v=MapWall(((at, -1.0), (at, 1.0)), height=0.2))
    assert [*building.scene.parts] == ["w"]
    building.ask(Undo())
    with pytest.raises(CommandError, match="no edit to undo"):
        building.ask(Undo())


def test_a_vehicle_whose_road_is_removed_stands_and_is_off_the_road() -> None:
    building = Building("mini_map")
    building.drive(50)
    position = building.world.frame.vehicles["V1"].pose.position
    assert [problem for problem in building.scene.advice if problem.kind == "outside"] == []
    building.put(straight_road_2=None)
    frames = building.drive(100)
    off = [event for frame in frames for event in frame.events if isinstance(event, OffRoad)]
    assert [event.vehicle for event in off] == ["V1"]
    assert frames[-1].vehicles["V1"].pose.position == pytest.approx(position, abs=1e-3)
    (advice,) = (problem for problem in building.scene.advice if problem.kind == "outside")
    assert advice.text == "'V1' stands beside the road."
    assert (advice.x, advice.y) == pytest.approx(tuple(position[:2]), abs=1e-3)
    assert advice.place is not None
    building.ask(Place("V1", *advice.place))
    assert [problem for problem in building.scene.advice if problem.kind == "outside"] == []


def test_parts_without_a_name_keep_theirs_when_an_earlier_one_is_removed() -> None:
    building = Building("mini_map")
    names = [*building.scene.parts]
    boxes = [*building.world.frame.objects]
    building.put(straight_road_2=None)
    assert [*building.scene.parts] == [name for name in names if name != "straight_road_2"]
    building.put(lawn_1=None, four_way_intersection_5=None)
    assert [*building.world.frame.objects] == boxes
    assert {*building.scene.parts} == {*names} - {"straight_road_2", "lawn_1", "four_way_intersection_5"}


def test_boxes_of_the_map_that_were_removed_or_moved_stay_so() -> None:
    building = Building("mini_map")
    building.ask(RemoveBox("pile_3"), Place("corner_1", 0.2, 0.8))
    assert not {"pile_3", "corner_1"} & {*building.scene.parts}
    building.put(pile_3=None, curve=MapModule("curved_road", 8.0, 8.0))
    assert building.world.spec.removed_boxes == ("corner_1",)
    building.ask(UseMap("tiny_town"))
    assert building.world.spec.removed_boxes == ()


@pytest.mark.parametrize(
    ("parts", "problem"),
    [
        ({"a": MapModule("curved", 0.0, 0.0)}, "module 'curved' is not known.*curved_road"),
        ({"a": MapModule("/etc/passwd.yaml", 0.0, 0.0)}, "is not known"),
        ({"a": MapModule("../vehicles/nigel", 0.0, 0.0)}, "is not known"),
        ({"a": MapModule("lawn", math.nan, 0.0)}, "x of EditMap: expected float"),
        ({"a": MapModule("lawn", 0.0, 0.0, math.inf)}, "yaw of EditMap: expected float"),
        ({"a": MapModule("lawn", 0.0, 1e9)}, "y of EditMap: expected float <= 10000"),
        ({"a": MapModule("lawn", 0.0, 0.0, length=-1.0)}, "length: must be at least"),
        ({"a": MapModule("curved_road", 0.0, 0.0, length=2.0)}, "length cannot be set for curved_road"),
        ({"a": MapModule("curved_road", 0.0, 0.0, open=("up",))}, "curved_road has no port 'up'"),
        ({"a/b": MapModule("curved_road", 0.0, 0.0)}, "name: must have letters"),
        ({"a": MapWall((), 0.2)}, "points: must have at least 2"),
        ({"a": MapWall(((0.0, 3.0),) * 3000, 0.2)}, "at most 2000"),
        ({"a": MapWall(((0.0, 3.0), (900.0, 3.0), (-900.0, 3.0)), 0.2)}, "it must be at most 1000 m"),
        ({"a": MapBlock(3.0, 3.0, 1.0, 0.0, 1.0)}, "width: must be at least"),
        ({"a": MapProp("lamp", 3.0, 3.0, 0.0)}, "must be 'stop'"),
        ({"world": MapBlock(3.0, 3.0, 1.0, 1.0, 1.0)}, "reserved"),
        ({"V1": MapModule("construction_box", 3.0, 3.0)}, "used twice"),
        ({"nothing": None}, "'nothing' is not in the map"),
        ({"b": MapModule("construction_box", 2.0, 0.0)}, "overlaps"),
        ({"w": MapModule("lawn", 0.0, 0.0)}, "'w' is a wall; it cannot become a module"),
    ],
)  # fmt: skip
def test_a_wrong_edit_is_refused_with_a_clear_message_and_the_draft_stays(
    parts: dict[str, MapPart | None], problem: str
) -> None:
    building = Building()
    building.put(w=WALL, a0=MapModule("straight_road", 5.0, 5.0))
    before = building.simulation.map_text(), building.world
    with pytest.raises(AutodriveError, match=f"(?s){problem}"):
        building.ask(EditMap(parts))
    assert (building.simulation.map_text(), building.world) == before
    assert building.simulation.undo_name == "add 2 parts of the map"


def test_a_box_of_the_map_is_where_it_was_put_and_undo_brings_it_back() -> None:
    building = Building()
    box = MapModule("construction_box", 1.5, 0.0)
    building.put(box=box)

    def place() -> list[float]:
        return building.world.frame.objects["box"].pose.position[:2].tolist()

    building.drive(400, 1.0)  # pushes it
    pushed = place()
    assert pushed[0] > 1.51
    building.put(box=msgspec.structs.replace(box, x=0.0, y=2.0))
    assert place() == pytest.approx([0.0, 2.0], abs=1e-3)
    assert building.drive(50)[-1].objects["box"].pose.position[:2] == pytest.approx([0.0, 2.0], abs=1e-3)
    with pytest.raises(CommandError, match="would overlap 'V1'"):  # which has rolled there
        building.ask(Undo())
    building.ask(Teleport("V1", -2.0, 0.0), Undo())
    assert place() == pytest.approx(pushed, abs=1e-6)
    x, y, _ = building.world.frame.vehicles["V1"].pose.position.tolist()
    with pytest.raises(CommandError, match="would overlap 'V1'"):
        building.put(other=MapModule("construction_box", x, y))
    building.ask(UseMap("mini_map"), Undo(), Reset())
    assert place() == pytest.approx([1.5, 0.0], abs=1e-3)


def test_the_text_of_a_map_is_opened_and_undone() -> None:
    building = Building()
    building.put(a=MapModule("straight_road", 3.0, 3.0), w=WALL)
    text, parts = building.simulation.map_text("Mine"), building.scene.parts
    building.ask(UseMap("oval"), UseMap(text=text))
    assert building.simulation.undo_name == "open a map"
    assert building.scene.parts == parts
    assert building.simulation.map_text() == text
    building.ask(Undo())
    assert "a" not in building.scene.parts
    spec = find("map", "mini_map").read_text()
    building.ask(UseMap(text=spec))
    assert building.scene.problems == []
    assert yaml.safe_load(building.simulation.map_text()) == yaml.safe_load(spec)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("title: [", "invalid YAML"),
        ("- 1", "expected 'key: value' lines"),
        ("title: x\nwals: []", "'wals' is not a known key.*walls"),
        ("title: x\nplacements: [{module: /etc/passwd.yaml, x: 0, y: 0}]", "module '/etc/passwd.yaml' is not known"),
        ("title: x\nplacements: [{module: lawn, x: far, y: 0}]", r"placement 1.x \(line 2\): must be a number"),
        ("a: &a [x]\nb: &b [*a, *a]\ntitle: !!python/name:os.system x", "tags such as"),
        ("title: x\nplacements: [{module: lawn, x: 0, y: 0, mass: 1}]", "mass cannot be set for lawn"),
        ("title: x\nwalls: [{points: [[0, -1], [0, 1]], height: 0.2}]", "overlap at the start"),
    ],
)
def test_a_wrong_text_is_refused_and_nothing_is_lost(text: str, problem: str) -> None:
    building = Building()
    building.put(w=WALL)
    before = building.simulation.map_text()
    with pytest.raises(AutodriveError, match=f"(?s){problem}"):
        building.ask(UseMap(text=text))
    assert building.simulation.map_text() == before
    assert building.simulation.undo_name == "add w"


def test_a_race_track_has_no_parts(tmp_path: Path) -> None:
    building = Building("practice")
    assert map_scene(building.world, lambda name, _: name) is None
    with pytest.raises(CommandError, match="race track"):
        building.put(w=WALL)
    with pytest.raises(CommandError, match=r"map 'tiny_twon' is not known.*tiny_town"):
        building.ask(UseMap("tiny_twon"))


def test_a_module_of_a_file_stays_in_a_map_that_is_edited(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(find("module", "curved_road").read_text())
    (tmp_path / "map.yaml").write_text("title: Mine\nplacements: [{module: mine.yaml, x: 2.0, y: 0.0, open: true}]\n")
    (tmp_path / "scenario.yaml").write_text(f"map: {tmp_path / 'map.yaml'}\n")
    building = Building(tmp_path / "scenario.yaml")
    (tmp_path / "mine.yaml").unlink()  # it is read once
    building.put(more=MapModule(str(tmp_path / "mine.yaml"), 5.0, 0.0, open=True))
    assert [*building.scene.parts] == ["mine_1", "more"]
    assert str(tmp_path / "mine.yaml") in building.scene.modules


@pytest.mark.parametrize("name", ["mini_map", "tiny_town", "plane"])
def test_a_map_that_is_taken_apart_and_put_together_is_the_same(name: str) -> None:
    """Each part is replaced by what a client was told of it."""
    specs = new_world(name).specs
    spec = own_map(specs)
    again = edited_map(specs, EditMap(dict(parts_of(spec))))
    new = own_map(again)
    assert parts_of(new) == parts_of(spec)
    maps = [load_map(spec), load_map(new)]
    assert maps[0].drivable.equals(maps[1].drivable)
    assert [module.footprint for module in maps[0].modules] == [module.footprint for module in maps[1].modules]
    statics = [
        [replace(static, yaw=math.remainder(static.yaw, 2.0 * math.pi)) for static in map_.statics] for map_ in maps
    ]
    assert statics[0] == statics[1]
    assert maps[0].boxes == maps[1].boxes


MODULES = st.sampled_from(["straight_road", "curved_road", "dead_end", "four_way_intersection", "lawn", "road_patch"])
PLACES = st.floats(-3.0, 3.0)
PARTS = st.one_of(
    st.builds(MapModule, MODULES, PLACES, PLACES, st.floats(-4.0, 4.0)),
    st.builds(lambda x, y: MapWall(((x, y + 4.0), (x + 1.0, y + 5.0)), 0.2), PLACES, PLACES),
    st.builds(lambda x, y, yaw: MapBlock(x, y - 6.0, 0.2, 0.3, 0.1, yaw), PLACES, PLACES, PLACES),
)
NAMES = st.sampled_from(["a", "b", "c", "d"])
EDITS = st.one_of(
    st.builds(EditMap, st.dictionaries(NAMES, st.one_of(PARTS, st.none()), min_size=1, max_size=3)),
    st.builds(CloseLoop, NAMES), st.builds(Undo), st.builds(Redo),
    st.builds(UseMap, st.sampled_from(["plane", "mini_map"])),
)  # fmt: skip


@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(EDITS, min_size=1, max_size=12))
def test_any_sequence_of_edits_is_undone_and_its_map_can_be_saved(edits: list[Operation]) -> None:
    building = Building()
    start = building.simulation.map_text()
    for edit in edits:
        before = building.simulation.map_text()
        try:
            building.ask(edit)
        except AutodriveError:
            assert building.simulation.map_text() == before
        spec = parse(building.simulation.map_text(), MapSpec)
        assert load_map(spec).drivable.equals(building.world.map.drivable)
        assert np.isfinite(building.world.step().vehicles["V1"].pose.position).all()
    last = building.simulation.map_text()
    count = 0
    while building.simulation.undo_name:
        building.ask(Undo())
        count += 1
    assert building.simulation.map_text() == start
    while building.simulation.redo_name and count:
        building.ask(Redo())
        count -= 1
    assert building.simulation.map_text() == last


def test_a_module_too_many_is_refused_and_nothing_is_lost() -> None:
    building = Building()
    lawns: dict[str, MapPart | None] = {
        f"lawn_{i}": MapModule("lawn", 2.0 * (i % 30), 2.0 * (i // 30), length=1.0, width=1.0)
        for i in range(MAX_PLACEMENTS)
    }
    building.ask(EditMap(lawns))
    with pytest.raises(AutodriveError, match="1000"):
        building.ask(EditMap({"another": MapModule("lawn", -4.0, -4.0)}))
    assert {*building.scene.parts} == {*lawns}
    assert building.simulation.undo_name == "add 1000 parts of the map"


def test_traffic_forbids_a_map_without_closed_lanes_until_it_is_removed() -> None:
    building = Building("traffic")
    cars = {name for name, vehicle in building.world.frame.vehicles.items() if vehicle.is_traffic}
    assert cars
    with pytest.raises(AutodriveError, match=r"traffic has .* cars"):
        building.ask(UseMap("empty"))
    building.ask(RemoveTraffic())
    assert building.simulation.undo_name == "remove the traffic"
    assert not cars & {*building.world.frame.vehicles}
    building.ask(UseMap("empty"))
    with pytest.raises(CommandError, match="the scenario has no traffic"):
        building.ask(RemoveTraffic())
    building.ask(Undo(), Undo())
    assert cars < {*building.world.frame.vehicles}
