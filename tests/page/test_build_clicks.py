"""Build mode by clicks and keys: towns from an empty plane, and what each action does and how it is undone."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import shapely

from autodrive.protocol.messages import Pause
from autodrive.scenario.maps.map import load_map
from tests.page.test_build import opened, parts, press
from tests.page.test_edit import on_screen
from tests.support.page import NewTab, PageServer, Tab

COUNT_CLICKS = "() => { window.clicks = 0; addEventListener('click', () => window.clicks++, { capture: true }) }"


def click(tab: Tab, x: float, y: float) -> None:
    """Click on a point of the map."""
    at = on_screen(tab, x, y)
    tab.page.mouse.move(*at)
    tab.page.mouse.click(*at)


def set_pieces(tab: Tab, count: int) -> None:
    """Set the piece in hand that many times with the button; a road goes on at its other end."""
    for _ in range(count):
        before = len(parts(tab))
        tab.wait_until(lambda: tab.get("build-set").is_enabled())
        tab.click("build-set")
        tab.wait_until(lambda before=before: len(parts(tab)) == before + 1)


def set_there(tab: Tab, x: float, y: float) -> None:
    """Click there with a piece in hand, which is set."""
    before = len(parts(tab))
    click(tab, x, y)
    tab.wait_until(lambda: len(parts(tab)) == before + 1)


def pose(tab: Tab, name: str) -> list[float]:
    return [parts(tab)[name][key] for key in ("x", "y", "yaw")]


def test_a_figure_eight_is_built_from_an_empty_plane_with_few_clicks(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab, size=(1280, 800))
    plane.request(Pause())  # edits then follow each other at once
    tab.page.evaluate(COUNT_CLICKS)
    tab.click("piece-four_way_intersection")
    set_there(tab, 0.0, 0.0)
    x, y, _ = pose(tab, "four_way_intersection_1")
    for side in (0.7, -0.7):  # from the eastern end to the northern one, then from the western to the southern one
        tab.click("piece-curved_road")
        set_there(tab, x + side, y)
        set_pieces(tab, 2)
        tab.wait_until(lambda: tab.get("build-set").is_disabled())  # the loop is closed: nothing is in hand
    assert tab.value("store.scene.value.map_scene.problems") == []
    assert tab.page.evaluate("() => window.clicks") <= 25
    built = plane.simulation.world.map
    # the plane is paved; poses are rounded to 1 um, the edges of the roads are 40 m long
    roads = shapely.union_all([module.drivable for module in built.modules], grid_size=1e-6)
    shipped = shapely.transform(load_map("figure_eight").drivable, lambda points: np.add(points, (x, y)))
    assert shapely.symmetric_difference(roads, shipped).area < 1e-4
    assert all(lane.successors for lane in built.lane_graph.lanes)


@pytest.fixture
def folder(plane: PageServer) -> Iterator[Path]:
    """A folder in that of the user."""
    with tempfile.TemporaryDirectory(dir=plane.folder) as name:
        yield Path(name)


def test_a_loop_is_built_changed_and_driven_on_with_keys_only(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=low")
    tab.wait_for_image()
    press(tab, "z")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    tab.get("build-template").select_option("empty")
    tab.wait_until(lambda: len(parts(tab)) == 2)
    advice = tab.get("build-advice").locator("li[data-kind=outside]")
    tab.wait_until(lambda: advice.count() == 1)  # the vehicle stands on the lawn
    tab.get("piece-curved_road").focus()
    press(tab, "Enter")
    tab.wait_until(lambda: tab.get("build-set").is_enabled())
    press(tab, "Enter")
    tab.wait_until(lambda: "curved_road_1" in parts(tab))
    press(tab, "n")
    for number in (2, 3, 4):
        tab.wait_until(lambda: tab.get("build-set").is_enabled())
        press(tab, "Enter")
        tab.wait_until(lambda number=number: f"curved_road_{number}" in parts(tab))
    tab.wait_until(lambda: tab.get("build-set").is_disabled())
    assert tab.value("store.scene.value.map_scene.problems") == []
    press(tab, ".")
    tab.wait_until(lambda: tab.text("build-selected").startswith("lawn_1"))
    for _ in range(2):
        press(tab, ".")
    tab.wait_until(lambda: tab.text("build-selected").startswith("curved_road_2"))
    press(tab, ",")
    tab.wait_until(lambda: tab.text("build-selected").startswith("curved_road_1"))
    tab.get("build-car").focus()
    press(tab, "Enter")
    tab.wait_until(lambda: plane.simulation.undo_name == "place V1")
    tab.wait_until(lambda: advice.count() == 0)
    press(tab, "g")
    tab.wait_until(lambda: tab.text("build-selected") == "4 pieces")
    press(tab, "z")
    assert tab.get("build-bar").is_hidden()
    x, y = plane.vehicle.pose.position[:2]
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: np.hypot(*(plane.vehicle.pose.position[:2] - (x, y))) > 0.05)
    tab.page.keyboard.up("w")
