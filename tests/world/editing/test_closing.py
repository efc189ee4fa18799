"""The edit that closes a road, in a running World: one step, with clear errors."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from autodrive import CommandError
from autodrive.protocol.messages import CloseLoop, EditMap, MapModule, MapPart, Redo, Undo, UseMap
from tests.world.editing.test_map_edits import CURVES, Building

NARROW = """title: Path
type: road
length: 0.6
width: 0.3
lanes: [[west, east]]
ports:
  west: {x: -0.3, y: 0, yaw_deg: 180, width: 0.3}
  east: {x: 0.3, y: 0, yaw_deg: 0, width: 0.3}
drivable:
  - {shape: rectangle, length: 0.6, width: 0.3}
"""


def building(**parts: MapPart) -> Building:
    made = Building()
    made.put(**parts)
    return made


def test_a_ring_is_closed_by_the_piece_that_was_missing_as_one_edit() -> None:
    made = building(**dict(list(CURVES.items())[1:]))
    made.ask(CloseLoop("curve_1"))
    assert made.scene.problems == []
    assert made.simulation.undo_name == "close the loop"
    closed = made.scene.parts
    new = closed["curved_road_1"]
    assert isinstance(new, MapModule)
    assert (new.x, new.y) == pytest.approx((0.5, -0.5), abs=1e-6)
    made.ask(Undo())
    assert {*made.scene.parts} == {*CURVES} - {"curve_0"}
    made.ask(Redo())
    assert made.scene.parts == closed


def test_names_of_new_roads_are_free_and_ends_may_be_named() -> None:
    made = building(
        straight_road_1=MapModule("straight_road", 0.0, 2.0), b=MapModule("straight_road", 3.0, 2.0, math.pi)
    )
    made.ask(CloseLoop("straight_road_1", "west", "b", "west"))
    assert "straight_road_2" in made.scene.parts
    ends = made.scene.ports
    assert ends["straight_road_1"]["west"].state == ends["b"]["west"].state == "joined"
    assert ends["straight_road_1"]["east"].state == ends["b"]["east"].state == "free"


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (CloseLoop("aa"), "'aa' is not a module of the map. Known: a, b, c, curve. Did you mean 'a'?"),
        (CloseLoop("a", "north"), "'a' has no open end 'north'"),
        (CloseLoop("a", "east", "curve"), r"no chain of roads leads from port 'east' of 'a' to port '(west|north)'"),
        (CloseLoop("b", "", "a"), r"Move '[ab]' and the modules that are connected with '[ab]' by \(-?0.05, 0\) m"),
        (CloseLoop("c", "", "a"), "there is no other open end of that width in the map"),
    ],
)
def test_what_cannot_be_closed_says_why(tmp_path: Path, edit: CloseLoop, text: str) -> None:
    (tmp_path / "path.yaml").write_text(NARROW)
    (tmp_path / "map.yaml").write_text(
        "title: Own\nis_draft: true\nplacements:\n"
        "  - {module: straight_road, name: a, x: 0, y: 2}\n  - {module: straight_road, name: b, x: 3.05, y: 2}\n"
        "  - {module: path.yaml, name: c, x: 0, y: -2}\n"
        "  - {module: curved_road, name: curve, x: 5, y: -5, yaw_deg: 33}\n"
    )
    (tmp_path / "scenario.yaml").write_text(f"map: {tmp_path / 'map.yaml'}\n")
    made = Building(tmp_path / "scenario.yaml")
    with pytest.raises(CommandError, match=text):
        made.ask(edit)
    assert len(made.scene.parts) == 4
    assert made.simulation.undo_name == ""


def test_a_town_without_open_ends_says_so() -> None:
    made = Building()
    made.ask(UseMap("oval"))
    with pytest.raises(CommandError, match=r"no open end|not a module of the map"):
        made.ask(CloseLoop("curved_road_1"))
    made.ask(EditMap({"w": MapModule("dead_end", 4.0, 4.0)}))
    with pytest.raises(CommandError, match="there is no other open end"):
        made.ask(CloseLoop("w"))


def test_all_open_ends_are_closed_as_one_edit_the_nearest_first_and_the_rest_by_dead_ends() -> None:
    made = building(
        **dict(list(CURVES.items())[1:]),
        a=MapModule("straight_road", 4.0, 4.0),
        b=MapModule("straight_road", 5.2, 4.0),
        t=MapModule("three_way_intersection", -4.0, 4.0),
    )
    ends = sum(port.state == "free" for ports in made.scene.ports.values() for port in ports.values())
    assert ends == 9
    made.ask(CloseLoop())
    assert [problem.text for problem in made.scene.problems] == []
    assert made.simulation.undo_name == "close all open ends"
    parts = {name: part for name, part in made.scene.parts.items() if isinstance(part, MapModule)}
    new = [part.module for name, part in parts.items() if name not in CURVES and name not in "abt"]
    assert "straight_road" in new  # between a and b
    assert "dead_end" in new  # the third end of the intersection has no other
    made.ask(Undo())
    assert {*made.scene.parts} == {*CURVES, "a", "b", "t"} - {"curve_0"}


def test_a_map_without_open_ends_has_nothing_to_close() -> None:
    made = Building()
    made.ask(UseMap("oval"))
    with pytest.raises(CommandError, match="the map has no open end"):
        made.ask(CloseLoop())
