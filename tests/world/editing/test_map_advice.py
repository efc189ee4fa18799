"""Advice about a map: lanes that lead nowhere, and vehicles beside the road."""

from __future__ import annotations

from pathlib import Path

import pytest

from autodrive.protocol.messages import EditMap, MapModule, UseMap
from tests.world.editing.test_map_edits import Building

ONE_WAY = """title: One way
type: road
length: 0.6
width: 0.6
lanes: [[west, east]]
ports:
  west: {x: -0.3, y: 0, yaw_deg: 180, width: 0.6}
  east: {x: 0.3, y: 0, yaw_deg: 0, width: 0.6}
drivable:
  - {shape: rectangle, length: 0.6, width: 0.6}
"""


@pytest.mark.parametrize(
    ("headings", "found"),
    [
        ((0, 0), []),
        ((0, 180), [("a", "leaves"), ("b", "leaves")]),  # both lead to the port where they meet
        ((180, 0), [("a", "reaches"), ("b", "reaches")]),
    ],
)
def test_lanes_that_no_car_reaches_or_leaves_are_named(
    tmp_path: Path, headings: tuple[int, int], found: list[tuple[str, str]]
) -> None:
    (tmp_path / "one_way.yaml").write_text(ONE_WAY)
    (tmp_path / "map.yaml").write_text(
        "title: One way\nplacements:\n"
        f"  - {{module: one_way.yaml, name: a, x: 0, y: 0, yaw_deg: {headings[0]}, open: true}}\n"
        f"  - {{module: one_way.yaml, name: b, x: 0.6, y: 0, yaw_deg: {headings[1]}, open: true}}\n"
    )
    (tmp_path / "scenario.yaml").write_text(f"map: {tmp_path / 'map.yaml'}\n")
    advice = Building(tmp_path / "scenario.yaml").scene.advice
    assert [(one.parts[0], one.text.split("no car ")[1].split()[0]) for one in advice] == found
    assert {one.kind for one in advice} <= {"unreachable"}
    assert all((one.x, one.y) == pytest.approx((0.3, one.y)) for one in advice)


def test_the_maps_of_the_simulator_have_no_lanes_that_lead_nowhere() -> None:
    building = Building()
    for name in ("figure_eight", "oval", "crossing", "tiny_town"):
        building.ask(UseMap(name))
        assert {one.kind for one in building.scene.advice} <= {"outside"}


def test_a_vehicle_beside_the_road_is_named_until_there_is_a_road() -> None:
    building = Building()
    assert building.scene.advice == []  # the plane is paved
    building.ask(UseMap("empty"))
    (advice,) = building.scene.advice
    assert (advice.kind, advice.parts) == ("outside", [])
    assert (advice.x, advice.y) == pytest.approx(building.world.frame.vehicles["V1"].pose.position[:2])
    building.ask(EditMap({"road": MapModule("straight_road", 0.0, 0.0)}))
    assert building.scene.advice == []
