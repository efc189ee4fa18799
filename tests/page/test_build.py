"""Build mode in a real browser: a map is built from nothing; the simulator and the saved file have what was built."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import autodrive
from autodrive.protocol.messages import EditMap, EditTrack, MapModule, Pause, TrackLine
from autodrive.scenario.kinds import read
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.spec import MapSpec
from tests.page.test_driving import yaw
from tests.page.test_edit import drag, on_screen
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab, touch

if TYPE_CHECKING:
    pass


def parts(tab: Tab) -> dict[str, dict[str, Any]]:
    return tab.value("store.scene.value.map_scene.parts")


def problems(tab: Tab) -> list[dict[str, str]]:
    return tab.value("store.scene.value.map_scene.problems")


def wait_for_parts(tab: Tab, *names: str) -> None:
    tab.wait_until(lambda: {*parts(tab)} == {*names})


def opened(server: PageServer, new_tab: NewTab, *, size: tuple[int, int] = (1000, 640), touch: bool = False) -> Tab:
    """A tab in Build mode, whose camera looks at the vehicle."""
    tab = new_tab(size=size, touch=touch).open(server.url + "?quality=low")
    tab.wait_for_image()
    return begin(tab, size)


def begin(tab: Tab, size: tuple[int, int] = (1000, 640)) -> Tab:
    tab.click("build-button")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    middle = [size[0] / 2, size[1] / 2]
    tab.wait_until(lambda: (at := on_screen(tab, 0.0, 0.0)) is not None and at == pytest.approx(middle, abs=40))
    return tab


@pytest.fixture
def building(plane: PageServer, new_tab: NewTab) -> Tab:
    """Build mode; the plane has no module."""
    return opened(plane, new_tab)


def press(tab: Tab, *keys: str) -> None:
    for key in keys:
        tab.page.keyboard.press(key)


def set_at(tab: Tab, piece: str, x: float, y: float) -> None:
    """Take a piece and click there; Escape deletes the next one."""
    tab.click(f"piece-{piece}")
    tab.page.mouse.move(*on_screen(tab, x, y))
    before = len(parts(tab))
    tab.page.mouse.click(*on_screen(tab, x, y))
    tab.wait_until(lambda: len(parts(tab)) == before + 1)
    press(tab, "Escape")


def start_from(tab: Tab, name: str) -> None:
    """Choose a map under Start from, which is folded when something was built."""
    if not tab.get("build-template").is_visible():
        tab.get("build-start").locator("summary").click()
    tab.get("build-template").select_option(name)


def test_a_closed_loop_is_built_from_an_empty_plane_and_saved(plane: PageServer, building: Tab, tmp_path: Path) -> None:
    set_at(building, "curved_road", 0.6, 0.4)
    assert len(problems(building)) == 2
    press(building, "n")
    for number in (2, 3, 4):
        building.wait_until(lambda: building.get("build-set").is_enabled())
        press(building, "Enter")
        wait_for_parts(building, *(f"curved_road_{k}" for k in range(1, number + 1)))
    assert problems(building) == []
    assert building.get("build").get_by_text("No errors").is_visible()
    assert building.get("build-ends").is_hidden()
    building.wait_until(lambda: building.get("build-set").is_disabled())  # the road is closed: nothing is in hand
    lanes = plane.simulation.world.map.lane_graph.lanes
    assert [len(lane.successors) for lane in lanes] == [1] * 8
    building.click("build-save")
    building.get("save-title").fill("My ring")
    with building.page.expect_download() as download:
        building.page.keyboard.press("Enter")
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    checked = call("check", file)
    assert checked.returncode == 0, checked.stderr
    assert "draft" not in file.read_text()
    start_from(building, "oval")
    building.wait_until(lambda: len(parts(building)) == 11)
    building.get("build-file").set_input_files(file)
    building.click("discard-dialog-discard")  # the oval is not saved
    wait_for_parts(building, *(f"curved_road_{k}" for k in range(1, 5)))
    assert load_map(file).drivable.equals(plane.simulation.world.map.drivable)
    building.click("build-save")
    building.get("save-kind").select_option("scenario")
    building.click("save-map-save")
    with building.page.expect_download() as download:
        building.click("save-dialog-save")
    scenario = tmp_path / "scenario.yaml"
    download.value.save_as(scenario)
    world = autodrive.make(scenario)
    assert [module.name for module in world.map.modules] == [f"curved_road_{number}" for number in (1, 2, 3, 4)]
    assert read("map", file, MapSpec).title == "My ring"


def test_a_piece_is_dragged_and_problems_are_shown_and_repaired(plane: PageServer, building: Tab) -> None:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8), "b": MapModule("straight_road", 0.65, 0.8)}))
    wait_for_parts(building, "a", "b")
    listed = building.get("build-problems").locator("li")
    building.wait_until(lambda: listed.count() == 1)
    assert building.text("build-ends-state") == "2 open ends"
    apart = listed.and_(building.page.locator("[data-kind=apart]"))
    assert "A and B do not meet: 5.0 cm" in (apart.text_content() or "")
    apart.get_by_text("Show me").click()
    building.wait_until(lambda: building.text("build-selected").startswith("b"))
    apart.get_by_text("Repair").click()
    building.wait_until(lambda: parts(building)["b"]["x"] == pytest.approx(0.6, abs=1e-6))
    building.click("build-leave-open")
    building.wait_until(lambda: building.get("build-ends").is_hidden())
    assert parts(building)["a"]["open"] == ["west"]
    assert parts(building)["b"]["open"] == ["east"]
    building.get("build-car").click()
    building.wait_until(lambda: plane.simulation.undo_name == "place V1")
    x, y = plane.vehicle.pose.position[:2]
    lane = plane.simulation.world.map.lane_graph.nearest(float(x), float(y), yaw(plane))
    assert lane is not None
    assert abs(lane.offset) < 0.01
    # it is dragged when it is selected, and joins again at the end near which it is left
    drag(building, on_screen(building, 0.65, 0.9), on_screen(building, -0.56, 0.9))
    building.wait_until(lambda: parts(building)["b"]["x"] == pytest.approx(-0.6, abs=1e-4))
    assert plane.simulation.undo_name == "move b"


def test_all_open_ends_are_closed_with_one_click(plane: PageServer, building: Tab) -> None:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8), "b": MapModule("straight_road", 1.2, 0.8)}))
    wait_for_parts(building, "a", "b")
    building.wait_for_text("build-ends-state", "4 open ends")
    building.click("build-close-all")
    building.wait_until(lambda: building.get("build-ends").is_hidden())
    assert problems(building) == []
    assert plane.simulation.undo_name == "close all open ends"


def test_a_piece_is_moved_with_the_arrow_keys_and_the_whole_map_is_shown(plane: PageServer, new_tab: NewTab) -> None:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8), "b": MapModule("straight_road", 9.0, 5.0)}))
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=low#build=1")  # the link opens Build mode
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    wait_for_parts(tab, "a", "b")
    tab.wait_until(lambda: on_screen(tab, 0.0, 0.8) is not None)
    press(tab, ".", "ArrowRight", "ArrowRight", "Shift+ArrowUp")
    tab.wait_until(lambda: parts(tab)["a"]["y"] == pytest.approx(0.81))
    assert parts(tab)["a"]["x"] == pytest.approx(0.2)
    assert plane.simulation.undo_name == "move a"
    press(tab, "Home")

    def is_inside(x: float, y: float) -> bool:
        """Whether a place is shown beside the panel."""
        at = on_screen(tab, x, y)
        panel = tab.get("build").bounding_box()
        assert panel is not None
        return panel["x"] + panel["width"] < at[0] < 1000 and 50 < at[1] < 570

    tab.wait_until(lambda: is_inside(-0.3, 0.5) and is_inside(9.3, 5.3))
    press(tab, "Escape", "Escape", "Escape")
    assert tab.get("build-bar").is_visible()
    tab.wait_until(lambda: "build=1" in tab.page.url)
    press(tab, "z")
    tab.wait_until(lambda: "build" not in tab.page.url)


def test_a_road_is_inserted_into_a_closed_one_and_a_piece_is_replaced(plane: PageServer, building: Tab) -> None:
    start_from(building, "oval")
    building.wait_until(lambda: len(parts(building)) == 11)
    plane.request(Pause())
    building.wait_until(lambda: building.get("build-ends").is_hidden())
    press(building, "n")  # no end is open: it goes to the first joint
    building.wait_until(lambda: building.get("build-set").is_enabled())
    building.click("piece-straight_road")
    press(building, "Enter")
    building.wait_until(lambda: len(parts(building)) == 13)
    assert problems(building) == []
    assert plane.simulation.undo_name == "insert straight_road"
    (name, *_) = (name for name, part in parts(building).items() if part.get("module") == "straight_road")
    x, y = (parts(building)[name][key] for key in "xy")
    building.page.evaluate("([x, y]) => autodrive.view.lookAt(x, y)", [x, y])
    building.wait_until(lambda: on_screen(building, x, y)[0] == pytest.approx(500, abs=40))
    building.page.mouse.click(*on_screen(building, x, y))
    building.wait_for_text("build-selected", name)
    assert building.get("build-replace").is_hidden()  # no other piece has its two ends
    press(building, "Escape", "n")
    building.wait_until(lambda: building.get("build-set").is_enabled())
    building.click("piece-three_way_intersection")
    press(building, "Enter")
    building.wait_until(lambda: any(one.startswith("three_way") for one in parts(building)))
    (name,) = (one for one in parts(building) if one.startswith("three_way"))
    while not building.text("build-selected").startswith(name):
        press(building, ".")
    building.get("build-replace").locator("[data-module=four_way_intersection]").click()
    building.wait_until(lambda: building.text("build-selected").startswith("four_way_intersection"))
    assert name not in parts(building)
    new = building.text("build-selected").split()[0]
    ends = building.value(f"Object.values(store.scene.value.map_scene.ports['{new}']).map((port) => port.state)")
    assert ends.count("joined") == 2  # as before


def test_a_map_that_the_traffic_forbids_is_built_without_traffic(running: PageServer, new_tab: NewTab) -> None:
    running.restart("traffic")
    tab = new_tab(size=(1000, 640)).open(running.url + "?quality=low#build=1")
    tab.wait_until(
        lambda: tab.value(
            "!!store.scene.value && store.status.value?.undo === '' && !store.hasUnsavedEdits.value"
            " && Object.keys(store.frame.value?.vehicles ?? {}).length > 1"
        )
    )
    running.request(Pause())
    before = set(running.frame.vehicles)
    start_from(tab, "empty")
    assert "no closed way of lanes" in tab.text("traffic-dialog")
    tab.click("traffic-dialog-cancel")
    assert set(running.frame.vehicles) == before
    start_from(tab, "empty")
    tab.click("traffic-dialog-remove")
    tab.wait_until(lambda: len(parts(tab)) == 2)
    assert not any(vehicle.is_traffic for vehicle in running.frame.vehicles.values())
    assert running.frame.vehicles


def test_a_template_is_used_and_discarded_only_after_a_question(plane: PageServer, building: Tab) -> None:
    building.get("build-template").select_option("oval")
    building.wait_until(lambda: len(parts(building)) == 11)
    assert problems(building) == []
    assert plane.simulation.undo_name == "use the map oval"
    building.click("build-done")
    building.show("menu")
    building.get("scenario").select_option("two_cars")
    building.get("discard-dialog").wait_for()
    assert "There are edits that are not saved" in building.text("discard-dialog")  # without the title of the scenario
    building.click("discard-dialog-cancel")
    assert plane.simulation.undo_name == "use the map oval"


def test_a_race_track_is_replaced_by_a_map_of_the_simulator(plane: PageServer, new_tab: NewTab) -> None:
    plane.request(EditTrack(TrackLine(((0.0, -4.0), (6.0, 0.0), (0.0, 4.0), (-6.0, 0.0)))))
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=low")
    tab.click("build-button")
    tab.wait_until(lambda: tab.value("store.scene.value.track_scene") is not None)
    start_from(tab, "oval")
    tab.click("discard-dialog-cancel")
    assert tab.value("store.scene.value.map_scene") is None
    start_from(tab, "oval")
    tab.click("discard-dialog-discard")
    tab.wait_until(lambda: tab.value("store.scene.value.map_scene") is not None and len(parts(tab)) == 11)
    assert tab.get("piece-curved_road").is_visible()


def test_all_of_building_is_done_with_fingers_on_a_tablet(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab, size=(1024, 768), touch=True)
    plane.request(Pause())  # edits then do not wait for their share of the time
    finger = partial(touch, tab.page.context.new_cdp_session(tab.page))

    def tap(x: float, y: float) -> None:
        finger("touchStart", on_screen(tab, x, y))
        finger("touchEnd")

    def move(*ways: tuple[list[float], list[float]]) -> None:
        """Fingers move from one place on the screen to another."""
        for number in range(len(ways)):  # one after the other
            finger("touchStart", *(start for start, _ in ways[: number + 1]))
        for share in (0.1, 0.4, 0.7, 1.0):
            finger("touchMove", *([a + share * (b - a) for a, b in zip(*way, strict=True)] for way in ways))
        tab.page.wait_for_timeout(100)  # after a flick, Chromium makes no click of the next tap
        finger("touchEnd")

    tab.get("piece-straight_road").tap()
    tap(0.0, 0.9)  # the piece goes there
    tap(0.0, 0.9)  # and is set
    wait_for_parts(tab, "straight_road_1")
    tab.get("build-remove").tap()  # the next piece is deleted
    tap(0.3, 0.9)  # an open end offers pieces
    tab.get("piece-curved_road").tap()
    tab.get("build-set").tap()
    tab.wait_until(lambda: len(parts(tab)) == 2)
    curve = next(name for name in parts(tab) if name.startswith("curved_road"))
    tab.wait_until(lambda: tab.get("build-set").is_enabled())
    tab.get("build-remove").tap()
    tab.wait_until(lambda: tab.get("build-set").is_disabled())
    tap(0.0, 0.9)
    tab.wait_for_text("build-selected", "straight_road_1")
    move((on_screen(tab, 0.0, 0.9), on_screen(tab, 0.0, 0.3)))
    tab.wait_until(lambda: parts(tab)["straight_road_1"]["y"] == pytest.approx(0.3, abs=0.1))
    before = yaw_of(tab, "straight_road_1")
    tab.wait_until(lambda: tab.get("build-set").is_disabled())  # the piece is not in hand any more
    tab.get("build-turn").tap()
    tab.wait_until(lambda: math.cos(yaw_of(tab, "straight_road_1") - before) == pytest.approx(0.0, abs=1e-6))
    tab.get("build-remove").tap()
    wait_for_parts(tab, curve)
    tab.get("build-undo").tap()
    wait_for_parts(tab, "straight_road_1", curve)

    def pixels() -> float:
        """Width of a metre on the screen."""
        return on_screen(tab, 0.5, 0.3)[0] - on_screen(tab, -0.5, 0.3)[0]

    for on_piece in (False, True):
        before, places = pixels(), dict(parts(tab))
        if on_piece:
            tap(0.0, 0.3)
            tab.wait_for_text("build-selected", "straight_road_1")
        x, y = on_screen(tab, 0.0, 0.3)
        move(([x, y], [x - 40.0, y]), ([x + 60.0, y], [x + 120.0, y]))
        tab.wait_until(lambda before=before: pixels() > 1.3 * before)
        assert parts(tab) == places


def yaw_of(tab: Tab, name: str) -> float:
    return parts(tab)[name]["yaw"]
