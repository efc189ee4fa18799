"""Build mode by clicks and keys: towns from an empty plane, and what each action does and how it is undone."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from autodrive import Client
from autodrive.protocol.messages import EditMap, Frame, MapModule, MapProp, MapWall, Pause
from autodrive.scenario.maps.map import Map, load_map
from tests.page.test_build import begin, opened, parts, press, wait_for_parts
from tests.page.test_edit import drag, on_screen
from tests.support.page import NewTab, PageServer, Tab

COUNT_CLICKS = "() => { window.clicks = 0; addEventListener('click', () => window.clicks++, { capture: true }) }"
STRAIGHT = MapModule("straight_road", 0.0, 0.9, open=True)


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


def select(tab: Tab, name: str, x: float, y: float) -> None:
    click(tab, x, y)
    tab.wait_until(lambda: tab.text("build-selected").startswith(name))


def pose(tab: Tab, name: str) -> list[float]:
    return [parts(tab)[name][key] for key in ("x", "y", "yaw")]


def is_at(tab: Tab, name: str, x: float, y: float, yaw: float) -> bool:
    """Whether a part has that pose; headings of half a turn are equal."""
    if name not in parts(tab):
        return False
    px, py, angle = pose(tab, name)
    turn = np.remainder(angle - yaw + np.pi, 2.0 * np.pi) - np.pi
    return np.hypot(px - x, py - y) < 1e-5 and abs(turn) < 1e-5


def joined_marks(tab: Tab) -> int:
    """Ports of the piece in hand that meet others, as they are drawn."""
    return tab.get("build-overlay").locator("g.port[data-state=joined]").count()


def difference(built: Map, shipped: shapely.Geometry) -> float:
    """Area that only one of two drivable areas has [m^2]."""
    return shapely.symmetric_difference(built.drivable, shipped).area


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
    roads = shapely.union_all([one.drivable for one in built.modules], grid_size=1e-6)
    shipped = shapely.transform(load_map("figure_eight").drivable, lambda points: np.add(points, (x, y)))
    assert shapely.symmetric_difference(roads, shipped).area < 1e-4
    assert all(lane.successors for lane in built.lane_graph.lanes)


def test_the_crossing_of_tiny_town_is_rebuilt_by_clicks(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab, size=(1280, 800))
    plane.request(Pause())  # as above
    tab.get("build-template").select_option("empty")
    tab.wait_until(lambda: len(parts(tab)) == 2)
    tab.click("piece-four_way_intersection")
    set_there(tab, 0.0, 0.0)
    press(tab, "Escape")
    select(tab, "four_way_intersection_1", 0.0, 0.0)
    for key in ("x", "y"):
        tab.get(f"build-{key}").fill("0")
        tab.get(f"build-{key}").press("Tab")
        tab.wait_until(lambda key=key: parts(tab)["four_way_intersection_1"][key] == 0)
    arms = {
        (0.0, 0.7): ["straight_road", "straight_road"],
        (0.0, -0.7): ["straight_road", "straight_road"],
        (-0.7, 0.0): ["dead_end"],
        (0.7, 0.0): ["road_patch", "straight_road"],
    }
    for end, pieces in arms.items():
        click(tab, *end)
        for piece in pieces:
            tab.wait_until(lambda piece=piece: tab.get(f"piece-{piece}").is_visible())
            tab.page.mouse.move(640, 300, steps=4)  # over the scene, as a hand moves the mouse to the palette
            tab.click(f"piece-{piece}")
            set_pieces(tab, 1)
        if pieces != ["dead_end"]:  # no road goes on from it, so nothing is in hand
            press(tab, "Escape")
    shipped = load_map("tiny_town").drivable.intersection(shapely.box(-1.3, -1.9, 1.5, 1.9))
    assert len(parts(tab)) == 10  # with the lawn and the wall
    assert difference(plane.simulation.world.map, shipped) < 1e-9  # rounded to 1 um in the file


def test_r_and_m_choose_the_end_by_which_a_piece_is_joined(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    plane.request(EditMap({"a": STRAIGHT}))
    wait_for_parts(tab, "a")
    # the end at (0.3, 0.9) faces x; poses by hand from the ports of the two modules
    by = {"east": (1.0, 0.7, np.pi), "north": (0.8, 0.9, np.pi / 2.0), "west": (1.0, 1.1, 0.0)}
    keys = {"r": ["north", "west", "east"], "Shift+R": ["west", "north", "east"]}
    for key, order in keys.items():
        for count, end in enumerate(order, 1):
            click(tab, 0.3, 0.9)
            tab.click("piece-three_way_intersection")
            press(tab, *[key] * count, "Enter")
            tab.wait_until(lambda end=end: is_at(tab, next(reversed(parts(tab))), *by[end]))
            press(tab, "Escape", "Control+z")
            wait_for_parts(tab, "a")
    for mirrored, (x, y, yaw) in ((False, (0.8, 1.1, 0.0)), (True, (0.8, 0.7, np.pi / 2.0))):
        click(tab, 0.3, 0.9)
        tab.click("piece-curved_road")
        press(tab, *["m"] * mirrored, "Enter")
        tab.wait_until(lambda x=x, y=y, yaw=yaw: is_at(tab, next(reversed(parts(tab))), x, y, yaw))
        press(tab, "Escape", "Control+z")
        wait_for_parts(tab, "a")
    click(tab, 0.3, 0.9)
    tab.click("piece-dead_end")
    press(tab, "r")
    tab.wait_for_notice("Dead End has one end: it can be joined in one way.")


@pytest.fixture
def folder(plane: PageServer) -> Iterator[Path]:
    """A folder in that of the user."""
    with tempfile.TemporaryDirectory(dir=plane.folder) as name:
        yield Path(name)


def test_a_piece_snaps_within_a_distance_on_the_screen_and_to_ends_of_its_width(
    plane: PageServer, new_tab: NewTab, folder: Path
) -> None:
    (folder / "path.yaml").write_text(
        "title: Path\ntype: road\nlength: 0.6\nwidth: 0.3\nlanes: [[west, east]]\n"
        "ports:\n  west: {x: -0.3, y: 0, yaw_deg: 180, width: 0.3}\n  east: {x: 0.3, y: 0, yaw_deg: 0, width: 0.3}\n"
        "drivable:\n  - {shape: rectangle, length: 0.6, width: 0.3}\n"
    )
    (folder / "own.yaml").write_text(
        "title: Own\nplacements:\n  - {module: straight_road, name: a, x: 0, y: 0.9, open: true}\n"
        "  - {module: path.yaml, name: narrow, x: 0, y: -0.9, open: true}\n"
    )
    scenario = folder / "scenario.yaml"
    scenario.write_text(f"map: {folder}/own.yaml\nvehicles:\n  V1: {{type: nigel}}\n")
    plane.restart(str(scenario))
    tab = opened(plane, new_tab)
    for _ in range(2):  # the distance is one of the screen: it is the same from farther away
        for pixels, snaps in ((32, True), (42, False)):
            tab.click("piece-road_patch")
            x, y = on_screen(tab, 0.3, 0.9)
            tab.page.mouse.move(x, y - pixels - 1)
            tab.page.mouse.move(x, y - pixels)
            tab.wait_until(lambda snaps=snaps: (joined_marks(tab) == 1) == snaps)
            press(tab, "Escape")
        before = on_screen(tab, 0.3, 0.9)
        tab.page.evaluate("() => autodrive.view.zoomEdit(-2)")
        tab.wait_until(lambda before=before: on_screen(tab, 0.3, 0.9) != before)
    tab.click("piece-straight_road")
    x, y = on_screen(tab, 0.3, -0.9)
    tab.page.mouse.move(x, y)
    tab.page.mouse.click(x, y)
    tab.wait_until(lambda: len(parts(tab)) == 3)
    assert pose(tab, "straight_road_1")[:2] == pytest.approx([0.3, -0.9], abs=0.02)  # where the pointer is
    press(tab, "Control+z", "Escape")
    wait_for_parts(tab, "a", "narrow")
    click(tab, 0.3, -0.9)
    tab.wait_until(lambda: tab.get("piece-straight_road").is_hidden())
    offered = tab.get("build-pieces").locator(".piece:visible")
    assert [one.get_attribute("data-piece") for one in offered.all()] == [parts(tab)["narrow"]["module"]]


def test_each_action_is_one_step_that_is_undone_and_made_again(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    plane.request(Pause())  # as above
    curve = MapModule("curved_road", 0.8, 1.1)
    wall = MapWall(((0.5, -0.6), (1.1, -0.6)), 0.2)
    start: dict[str, Any] = {"a": STRAIGHT, "curve": curve, "wall": wall, "sign": MapProp("stop", -0.8, -0.6, 0.0)}
    plane.request(EditMap(start))
    wait_for_parts(tab, *start)

    def check(*keys: str) -> dict[str, Any]:
        """The parts after an action, which is undone and made again and undone."""
        before, undo = parts(tab), plane.simulation.undo_name
        press(tab, *keys)
        tab.wait_until(lambda: parts(tab) != before)
        after = parts(tab)
        press(tab, "Control+z")
        tab.wait_until(lambda: parts(tab) == before)
        assert plane.simulation.undo_name == undo  # one step
        press(tab, "Control+Shift+z")
        tab.wait_until(lambda: parts(tab) == after)
        press(tab, "Control+z")
        tab.wait_until(lambda: parts(tab) == before)
        return after

    select(tab, "curve", 0.7, 1.0)
    assert check("r")["curve"]["yaw"] == pytest.approx(np.pi / 2.0, abs=1e-6)
    assert check("Shift+R")["curve"]["yaw"] == pytest.approx(-np.pi / 2.0, abs=1e-6)
    mirrored = check("m")["curve"]  # about the end at (0.3, 0.9) where it is joined
    assert [mirrored[key] for key in ("x", "y", "yaw")] == pytest.approx([0.8, 0.7, np.pi / 2.0], abs=1e-6)
    assert "curve" not in check("Delete")
    select(tab, "sign", -0.8, -0.6)
    assert check("r")["sign"]["yaw"] == pytest.approx(np.radians(15.0), abs=1e-6)
    select(tab, "wall", 0.8, -0.6)
    angle = np.radians(15.0)
    ends = [(0.8 + side * 0.3 * np.cos(angle), -0.6 + side * 0.3 * np.sin(angle)) for side in (-1, 1)]
    assert np.array(check("r")["wall"]["points"]) == pytest.approx(np.array(ends), abs=1e-5)
    drag(tab, on_screen(tab, 0.8, -0.6), on_screen(tab, 0.9, -0.7))
    tab.wait_until(lambda: parts(tab)["wall"]["points"][0] == pytest.approx([0.6, -0.7], abs=0.02))
    press(tab, "Control+z")
    tab.wait_until(lambda: parts(tab)["wall"]["points"][0] == pytest.approx([0.5, -0.6], abs=1e-6))
    # a copy lies beside what it is a copy of, until the pointer moves it
    select(tab, "a", 0.0, 0.9)
    press(tab, "g")
    tab.wait_until(lambda: tab.text("build-selected") == "2 pieces")
    after = check("Control+d", "Enter")
    assert len(after) == 6
    assert {"straight_road_1", "a_1"} & {*after}
    select(tab, "a", 0.0, 0.9)
    press(tab, "g")
    tab.wait_until(lambda: tab.text("build-selected") == "2 pieces")
    turned = check("r")  # about the middle of the two, from (-0.3, 0.6) to (1.3, 1.6)
    assert [turned["a"][key] for key in ("x", "y", "yaw")] == pytest.approx([0.7, 0.6, np.pi / 2.0], abs=1e-5)
    assert {"a", "curve"} & {*check("Delete")} == set()


def test_connected_pieces_are_moved_together(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    places = {"a": STRAIGHT, "b": MapModule("straight_road", 0.6, 0.9, open=True)}
    plane.request(EditMap({**places, "c": MapModule("straight_road", -1.0, 0.9, open=True)}))
    wait_for_parts(tab, "a", "b", "c")
    select(tab, "a", 0.0, 0.9)
    press(tab, "g")
    tab.wait_until(lambda: tab.text("build-selected") == "2 pieces")
    drag(tab, on_screen(tab, 0.0, 0.9), on_screen(tab, 0.1, 0.5))
    tab.wait_until(lambda: parts(tab)["a"]["y"] == pytest.approx(0.5, abs=0.02))
    shift = np.subtract(pose(tab, "a"), (0.0, 0.9, 0.0))
    assert pose(tab, "b") == pytest.approx(np.add(shift, (0.6, 0.9, 0.0)), abs=2e-6)
    assert pose(tab, "c") == [-1.0, 0.9, 0.0]
    press(tab, "Control+z")
    tab.wait_until(lambda: pose(tab, "a") == [0.0, 0.9, 0.0])
    assert pose(tab, "b") == [0.6, 0.9, 0.0]


def test_escape_puts_the_piece_away_then_the_selection_then_leaves(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    plane.request(EditMap({"a": STRAIGHT}))
    wait_for_parts(tab, "a")
    tab.click("piece-straight_road")
    tab.wait_until(lambda: tab.get("build-set").is_enabled())
    press(tab, "Escape")
    tab.wait_until(lambda: tab.get("build-set").is_disabled())
    assert tab.get("build-bar").is_visible()
    select(tab, "a", 0.0, 0.9)
    press(tab, "Escape")
    assert tab.get("build-selected").is_hidden()
    assert tab.get("build-bar").is_visible()
    press(tab, "Escape")
    assert tab.get("build-bar").is_hidden()
    assert {*parts(tab)} == {"a"}
    begin(tab)


def test_a_loop_is_closed_from_an_open_end_and_from_the_list_of_problems(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab)
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.9), "b": MapModule("straight_road", 1.2, 0.9)}))
    wait_for_parts(tab, "a", "b")
    click(tab, 0.3, 0.9)
    tab.wait_until(lambda: tab.get("build-close").is_enabled())
    press(tab, "c")
    wait_for_parts(tab, "a", "b", "straight_road_1")
    assert plane.simulation.undo_name == "close the loop"
    listed = tab.get("build-problems").locator("li")
    tab.wait_until(lambda: listed.count() == 2)
    listed.first.get_by_text("Close the loop").click()
    tab.wait_until(lambda: listed.count() == 0)
    assert all(len(lane.successors) == 1 for lane in plane.simulation.world.map.lane_graph.lanes)
    press(tab, "Control+z")
    wait_for_parts(tab, "a", "b", "straight_road_1")


def test_a_loop_is_built_changed_and_driven_on_with_keys_only(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=low")
    tab.wait_for_image()
    press(tab, "z")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    tab.get("build-template").select_option("empty")
    tab.wait_until(lambda: len(parts(tab)) == 2)
    advice = tab.get("build-problems").locator("li[data-kind=outside]")
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
    press(tab, "Escape", "Escape")
    assert tab.get("build-bar").is_hidden()
    x, y = plane.vehicle.pose.position[:2]
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: np.hypot(*(plane.vehicle.pose.position[:2] - (x, y))) > 0.05)
    tab.page.keyboard.up("w")


def test_a_vehicle_drives_while_it_is_built_and_its_road_is_removed(mini_map: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1000, 640)).open(f"{mini_map.url}?quality=low")
    tab.click("build-button")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    outside = tab.get("build-problems").locator("li[data-kind=outside]")

    def drive(throttle: float, is_done: Callable[[Frame], bool]) -> Frame:
        """Drive as a script of the user does, until then; the frame."""
        while not is_done(frame := client.frame):
            client.drive("V1", throttle=throttle)
            tab.page.wait_for_timeout(20)
        return frame

    def x(frame: Frame) -> float:
        return float(frame.vehicles["V1"].pose.position[0])

    with Client(f"127.0.0.1:{mini_map.server.port}") as client:
        client.set_driving_mode("V1", True)
        drive(0.3, lambda frame: x(frame) > 0.1)
        assert outside.count() == 0
        edited = client.edit_map({"straight_road_2": None, "parking_lot_3": None})  # of x from -0.3 to 1.7
        drive(0.3, lambda frame: x(frame) > x(edited) + 0.1)  # it drives on, over the lawn
        drive(0.0, lambda frame: abs(frame.vehicles["V1"].velocity[0]) < 1e-3)
        tab.wait_until(lambda: outside.count() == 1)
        assert "'V1' stands beside the drivable area" in tab.text("build-problems")
        outside.get_by_text("Show me").click()
        shown = [500.0, 320.0]
        tab.wait_until(lambda: on_screen(tab, x(client.frame), 0.0) == pytest.approx(shown, abs=40))
        client.undo()
        tab.wait_until(lambda: outside.count() == 0)
