"""The edit that inserts a module into a road: what is moved, what closes the road again, and what is refused."""

from __future__ import annotations

import pytest

from autodrive import CommandError
from autodrive.protocol.messages import EditMap, InsertModule, MapModule, MapProp, MapWall, Undo, UseMap
from tests.world.editing.test_closing import building
from tests.world.editing.test_map_edits import CURVES, Building


def modules_of(made: Building) -> list[str]:
    return sorted(part.module for part in made.scene.parts.values() if isinstance(part, MapModule))


def test_the_road_behind_an_insertion_is_moved_with_its_signs() -> None:
    made = building(
        a=MapModule("straight_road", 0.0, 2.0),
        b=MapModule("straight_road", 0.6, 2.0),
        c=MapModule("curved_road", 1.4, 2.2),
        sign=MapProp("stop", 0.6, 2.4, 0.0),
        other=MapProp("stop", -0.1, 2.4, 0.0),
    )
    ends = len(made.scene.problems)
    made.ask(InsertModule("straight_road", "a", "east"))
    parts = {name: part for name, part in made.scene.parts.items() if isinstance(part, MapModule | MapProp)}
    assert (parts["a"].x, parts["b"].x, parts["c"].x) == pytest.approx((0.0, 1.2, 2.0))
    assert (parts["sign"].x, parts["other"].x) == pytest.approx((1.2, -0.1))
    assert parts["straight_road_1"].x == pytest.approx(0.6)
    assert len(made.scene.problems) == ends
    assert made.simulation.undo_name == "insert straight_road"
    made.ask(Undo())
    assert {*made.scene.parts} == {"a", "b", "c", "sign", "other"}


@pytest.mark.parametrize("curve", [*CURVES])
def test_a_closed_ring_is_opened_and_closed_by_a_road_on_its_other_side(curve: str) -> None:
    made = building(**CURVES)
    made.ask(InsertModule("straight_road", curve, "west"))
    assert [problem.text for problem in made.scene.problems] == []
    assert modules_of(made) == ["curved_road"] * 4 + ["straight_road"] * 2
    assert {port.state for ports in made.scene.ports.values() for port in ports.values()} == {"joined"}


@pytest.mark.parametrize("name", ["oval", "figure_eight"])
@pytest.mark.parametrize("module", ["straight_road", "three_way_intersection", "roadside_parking"])
def test_roads_of_the_maps_of_the_simulator_stay_closed(name: str, module: str) -> None:
    made = Building()
    made.ask(UseMap(name))
    before = modules_of(made)
    part, port = next(
        (part, port)
        for part, ports in made.scene.ports.items()
        for port, place in ports.items()
        if place.state == "joined"
    )
    made.ask(InsertModule(module, part, port))
    assert {problem.kind for problem in made.scene.problems} <= {"unconnected"}
    new = {name for name in made.scene.parts if name.startswith(module)}
    open_ends = [
        part for part, ports in made.scene.ports.items() for place in ports.values() if place.state != "joined"
    ]
    assert {*open_ends} <= new  # only the third end of the intersection
    assert modules_of(made).count(module) > before.count(module)


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (InsertModule("straigt_road", "a", "east"), "Did you mean 'straight_road'"),
        (InsertModule("straight_road", "aa", "east"), "'aa' is not a module of the map"),
        (InsertModule("straight_road", "a", "west"), "port 'west' of 'a' is not joined"),
        (InsertModule("straight_road", "a", "east", "north"), "Straight Road has no port 'north'"),
        (InsertModule("dead_end", "a", "east"), "Dead End has no two ends as wide as this road"),
        (InsertModule("wide_straight_road", "a", "east"), "has no two ends as wide as this road"),
    ],
)
def test_what_cannot_be_inserted_says_why(edit: InsertModule, text: str) -> None:
    made = building(a=MapModule("straight_road", 0.0, 2.0), b=MapModule("straight_road", 0.6, 2.0))
    with pytest.raises(CommandError, match=text):
        made.ask(edit)
    assert {*made.scene.parts} == {"a", "b"}


def test_a_ring_without_room_says_why_it_cannot_be_opened() -> None:
    corners = ((-1.2, -1.2), (1.2, -1.2), (1.2, 1.2), (-1.2, 1.2))
    made = building(**CURVES, wall=MapWall(corners, height=0.2, is_closed=True))
    with pytest.raises(CommandError, match="the road is closed, and no pieces close it again"):
        made.ask(InsertModule("straight_road", "curve_0", "west"))
    assert {*made.scene.parts} == {*CURVES, "wall"}
    made.ask(EditMap({"wall": None}), InsertModule("straight_road", "curve_0", "west"))
    assert made.scene.problems == []
