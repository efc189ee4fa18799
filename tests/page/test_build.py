"""Build mode in a real browser: a map is built from nothing; the simulator and the saved file have what was built."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import autodrive
from autodrive.protocol.messages import EditMap, EditTrack, MapModule, MapWall, Pause, TrackLine
from autodrive.scenario.kinds import read
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.spec import MapSpec
from tests.page.test_access import wrong_targets
from tests.page.test_driving import yaw
from tests.page.test_edit import drag, on_screen
from tests.page.test_screens import MIN_CONTRAST, MIN_TARGET, MIN_TEXT, SHOW_CARDS, TEXTS
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab, box, overlap, touch

if TYPE_CHECKING:
    from playwright.sync_api import Dialog


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
    """Take a piece and click there; Escape puts the next one away."""
    tab.click(f"piece-{piece}")
    tab.page.mouse.move(*on_screen(tab, x, y))
    before = len(parts(tab))
    tab.page.mouse.click(*on_screen(tab, x, y))
    tab.wait_until(lambda: len(parts(tab)) == before + 1)
    press(tab, "Escape")


def test_a_closed_loop_is_built_from_an_empty_plane_and_saved(plane: PageServer, building: Tab, tmp_path: Path) -> None:
    set_at(building, "curved_road", 0.6, 0.4)
    assert len(problems(building)) == 2
    press(building, "n")
    for number in (2, 3, 4):
        building.wait_until(lambda: building.get("build-set").is_enabled())
        press(building, "Enter")
        wait_for_parts(building, *(f"curved_road_{one}" for one in range(1, number + 1)))
    assert problems(building) == []
    assert building.get("build").get_by_text("No problems").is_visible()
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
    building.get("build-template").select_option("oval")
    building.wait_until(lambda: len(parts(building)) == 11)
    building.get("build-file").set_input_files(file)
    building.click("discard-dialog-discard")  # the oval is not saved
    wait_for_parts(building, *(f"curved_road_{one}" for one in range(1, 5)))
    assert load_map(file).drivable.equals(plane.simulation.world.map.drivable)
    building.click("build-save")
    building.click("save-map-scenario")
    with building.page.expect_download() as download:
        building.click("save-dialog-save")
    scenario = tmp_path / "scenario.yaml"
    download.value.save_as(scenario)
    world = autodrive.make(scenario)
    assert [one.name for one in world.map.modules] == [f"curved_road_{number}" for number in (1, 2, 3, 4)]
    assert read("map", file, MapSpec).title == "My ring"


def test_each_step_is_undone_and_made_again(plane: PageServer, building: Tab) -> None:
    set_at(building, "straight_road", 0.8, 0.6)
    placed = parts(building)["straight_road_1"]
    building.page.mouse.click(*on_screen(building, 0.8, 0.5))
    building.wait_until(lambda: building.text("build-selected").startswith("straight_road_1"))
    building.click("build-turn")
    building.wait_until(lambda: parts(building)["straight_road_1"]["yaw"] == pytest.approx(1.5708, abs=1e-4))
    building.get("build-open").check()
    building.wait_until(lambda: problems(building) == [])
    press(building, "Delete")
    wait_for_parts(building)
    assert plane.simulation.undo_name == "remove straight_road_1"
    building.click("build-undo")
    wait_for_parts(building, "straight_road_1")
    press(building, "Control+z")
    building.wait_until(lambda: len(problems(building)) == 2)
    press(building, "Control+z")
    building.wait_until(lambda: parts(building)["straight_road_1"] == placed)
    press(building, "Control+z")
    wait_for_parts(building)
    press(building, "Control+Shift+z", "Control+y")
    building.wait_until(lambda: len(parts(building)) == 1 and parts(building)["straight_road_1"]["yaw"] != 0)
    assert plane.simulation.redo_name == "change straight_road_1"


def test_an_open_end_offers_what_fits_and_a_piece_snaps_to_it_unless_shift_is_held(
    plane: PageServer, building: Tab
) -> None:
    set_at(building, "straight_road", 0.0, 0.9)
    building.page.mouse.click(*on_screen(building, 0.3, 0.9))
    building.wait_until(lambda: building.get("piece-lawn").is_hidden())
    assert building.get("piece-curved_road").is_visible()
    press(building, "ArrowRight", "Enter")
    wait_for_parts(building, "straight_road_1", "dead_end_1")
    assert [parts(building)["dead_end_1"][key] for key in "xy"] == pytest.approx([0.6, 0.9], abs=0.02)
    press(building, "Escape", "Escape")
    assert building.get("build-bar").is_hidden()
    begin(building)
    building.click("piece-straight_road")
    near = on_screen(building, -0.28, 0.88)
    for shift, is_joined in ((False, True), (True, False)):
        if shift:
            building.page.keyboard.down("Shift")
        building.page.mouse.move(near[0] + 3, near[1])
        building.page.mouse.move(*near)
        building.page.mouse.click(*near)
        if shift:
            building.page.keyboard.up("Shift")
        building.wait_until(lambda shift=shift: len(parts(building)) == 3 + shift)
        states = {
            port["state"] for port in building.value("store.scene.value.map_scene.ports")["straight_road_1"].values()
        }
        assert (states == {"joined"}) == is_joined or shift
        press(building, "Escape")
        building.click("piece-straight_road")
    second, third = parts(building)["straight_road_2"], parts(building)["straight_road_3"]
    assert second["x"] == pytest.approx(-0.6, abs=0.02)
    assert third["x"] == pytest.approx(-0.28, abs=0.03)
    kinds = {problem["kind"] for problem in problems(building)}
    assert "overlap" in kinds


def test_a_piece_is_dragged_and_problems_are_shown_and_repaired(plane: PageServer, building: Tab) -> None:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8), "b": MapModule("straight_road", 0.65, 0.8)}))
    wait_for_parts(building, "a", "b")
    listed = building.get("build-problems").locator("li")
    building.wait_until(lambda: listed.count() == 3)
    apart = listed.and_(building.page.locator("[data-kind=apart]"))
    apart.get_by_text("Show me").click()
    building.wait_until(lambda: building.text("build-selected").startswith("b"))
    apart.get_by_text("Repair").click()
    building.wait_until(lambda: parts(building)["b"]["x"] == pytest.approx(0.6, abs=1e-6))
    for left in (1, 0):
        listed.first.get_by_text("Leave open").click()
        building.wait_until(lambda left=left: listed.count() == left)
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


def test_pieces_in_a_rectangle_are_moved_together(plane: PageServer, building: Tab) -> None:
    places = {name: MapModule("straight_road", x, -0.9, open=True) for name, x in (("a", 0.0), ("b", 0.6), ("c", -1.2))}
    plane.request(EditMap({**places}))
    wait_for_parts(building, "a", "b", "c")
    building.page.keyboard.down("Shift")
    drag(building, on_screen(building, -0.25, -0.5), on_screen(building, 0.9, -1.2))
    building.page.keyboard.up("Shift")
    building.wait_until(lambda: building.text("build-selected") == "2 pieces")
    drag(building, on_screen(building, 0.1, -0.9), on_screen(building, -0.52, -0.8))  # near the end of c
    building.wait_until(lambda: parts(building)["a"]["x"] == pytest.approx(-0.6, abs=1e-4))
    assert [parts(building)["b"][key] for key in "xy"] == pytest.approx([0.0, -0.9], abs=1e-4)
    assert plane.simulation.undo_name == "move 2 parts of the map"
    press(building, "Control+z")
    building.wait_until(lambda: parts(building)["b"]["x"] == pytest.approx(0.6, abs=1e-4))


def test_walls_blocks_and_signs_are_set_by_points(plane: PageServer, building: Tab) -> None:
    building.click("piece-wall")
    for x, y in ((0.5, 0.6), (0.9, 0.6), (0.9, 0.9)):
        building.page.mouse.click(*on_screen(building, x, y))
    press(building, "Enter")
    wait_for_parts(building, "wall_1")
    assert parts(building)["wall_1"]["points"][2] == pytest.approx([0.9, 0.9], abs=0.02)
    press(building, "Escape")
    building.click("piece-block")
    for x, y in ((0.5, -0.9), (0.9, -0.6)):
        building.page.mouse.click(*on_screen(building, x, y))
    wait_for_parts(building, "wall_1", "block_1")
    assert parts(building)["block_1"]["length"] == pytest.approx(0.4, abs=0.03)
    press(building, "Escape")
    set_at(building, "sign-stop", 0.3, -0.4)
    assert [one.kind for one in plane.simulation.world.map.props] == ["stop"]
    # a wall at the place of the vehicle is refused; nothing is lost
    building.click("piece-wall")
    for y in (-0.3, 0.3):
        building.page.mouse.click(*on_screen(building, 0.05, y))
    press(building, "Enter")
    building.wait_for_notice("overlap at the start")
    assert len(parts(building)) == 3


def test_two_people_build_together_and_the_second_is_told(plane: PageServer, building: Tab, new_tab: NewTab) -> None:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8, open=True), "w": MapWall(((2, 2), (3, 2)), 0.2)}))
    wait_for_parts(building, "a", "w")
    other = new_tab(size=(640, 480)).open(plane.url + "?quality=low")
    other.click("build-button")
    wait_for_parts(other, "a", "w")
    building.page.mouse.click(*on_screen(building, 0.1, 0.9))
    building.wait_until(lambda: building.text("build-selected").startswith("a"))
    building.click("build-turn")
    other.wait_until(lambda: parts(other)["a"]["yaw"] == pytest.approx(1.5708, abs=1e-4))
    other.page.mouse.click(*on_screen(other, 0.1, 0.8))
    other.wait_until(lambda: other.text("build-selected").startswith("a"))
    # as if the latest edit were still on its way to this page
    other.page.evaluate("() => { autodrive.store.scene.value.map_scene.parts.a.yaw = 0 }")
    press(other, "Delete")
    other.wait_for_notice("was changed by another client meanwhile")
    assert {*parts(building)} == {"a", "w"}


def test_a_template_is_used_and_discarded_only_after_a_question(plane: PageServer, building: Tab) -> None:
    building.get("build-template").select_option("oval")
    building.wait_until(lambda: len(parts(building)) == 11)
    assert problems(building) == []
    assert plane.simulation.undo_name == "use the map oval"
    building.click("build-done")
    building.show("menu")
    building.get("scenario").select_option("two_cars")
    building.get("discard-dialog").wait_for()
    building.click("discard-dialog-cancel")
    assert plane.simulation.undo_name == "use the map oval"


def test_the_browser_asks_before_unsaved_work_is_lost_and_a_reload_keeps_the_history(
    plane: PageServer, building: Tab
) -> None:
    asked: list[str] = []

    def stay(dialog: Dialog) -> None:
        asked.append(dialog.type)
        dialog.dismiss()

    building.page.on("dialog", stay)
    set_at(building, "straight_road", 0.0, 0.9)
    building.page.close(run_before_unload=True)
    building.wait_until(lambda: asked == ["beforeunload"])
    assert {*parts(building)} == {"straight_road_1"}  # the tab is still there
    building.page.remove_listener("dialog", stay)
    building.page.on("dialog", lambda dialog: dialog.accept())
    building.page.reload()
    building.wait_until(lambda: building.value("store.scene.value") is not None)
    begin(building)
    wait_for_parts(building, "straight_road_1")
    press(building, "Control+z")
    wait_for_parts(building)
    press(building, "Control+Shift+z")
    wait_for_parts(building, "straight_road_1")


def test_a_link_contains_a_town_of_150_modules(plane: PageServer, new_tab: NewTab) -> None:
    places = {
        f"road_{i}": MapModule("straight_road", 0.6 * (i % 15), 1.0 + 0.4 * (i // 15), 0.0, open=True)
        for i in range(150)
    }
    plane.request(Pause())
    plane.request(EditMap({**places}))
    tab = opened(plane, new_tab)
    wait_for_parts(tab, *places)
    made = parts(tab)
    tab.click("build-save")
    tab.click("save-map-link")
    tab.get("map-link").wait_for()
    link = tab.text("map-link")
    assert len(link) < 30_000
    plane.restart("plane")
    other = new_tab().open(link)
    other.click("link-changes-apply")
    wait_for_parts(other, *places)
    assert parts(other) == made


def test_a_race_track_is_replaced_by_a_map_of_the_simulator(plane: PageServer, new_tab: NewTab) -> None:
    plane.request(EditTrack(TrackLine(((0.0, -4.0), (6.0, 0.0), (0.0, 4.0), (-6.0, 0.0)))))
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=low")
    tab.click("build-button")
    tab.wait_until(lambda: tab.value("store.scene.value.track_scene") is not None)
    tab.get("build-template").select_option("oval")
    tab.wait_until(lambda: tab.value("store.scene.value.map_scene") is not None and len(parts(tab)) == 11)
    assert tab.get("piece-curved_road").is_visible()


def test_a_finger_builds(plane: PageServer, new_tab: NewTab) -> None:
    tab = opened(plane, new_tab, size=(390, 844), touch=True)
    tools = tab.page.context.new_cdp_session(tab.page)

    def tap(x: float, y: float) -> None:
        touch(tools, "touchStart", on_screen(tab, x, y))
        touch(tools, "touchEnd")

    tab.click("build-details")
    tab.click("piece-straight_road")
    tap(0.0, 0.9)  # moves it
    tab.click("build-set")
    wait_for_parts(tab, "straight_road_1")
    press(tab, "Escape")
    tap(0.3, 0.9)
    tab.wait_until(lambda: tab.get("build-mirror").is_enabled())
    tap(0.8, 0.9)  # on the piece that is offered
    tab.wait_until(lambda: len(parts(tab)) == 2)
    assert len(problems(tab)) == 2


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
    tab.get("build-remove").tap()  # the next piece is put away
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


@pytest.mark.parametrize(
    "size", [(390, 844), (844, 390), (820, 1180), (1024, 768)], ids=lambda size: "x".join(map(str, size))
)
def test_all_controls_of_build_mode_are_reached_on_a_touch_screen(
    plane: PageServer, new_tab: NewTab, size: tuple[int, int]
) -> None:
    tab = new_tab(size=size, touch=True).open(f"{plane.url}?quality=low")
    tab.click("build-button")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    for name in ("menu", "edit", "build", "hud"):
        shown = box(tab.get(f"{name}-button"))
        assert 0 <= shown["left"] < shown["right"] <= size[0], name
    assert tab.get("build").is_visible() == (size[0] > 719)
    assert wrong_targets(tab, MIN_TARGET) == []
    if size[0] <= 719:
        tab.click("build-details")
        tab.get("build").wait_for()
    assert wrong_targets(tab, MIN_TARGET) == []
    assert not overlap(tab.get("build"), tab.get("build-bar"))
    if size[0] > 719:  # one row
        shown = box(tab.get("build-bar"))
        assert shown["bottom"] - shown["top"] < 2 * MIN_TARGET


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_of_build_mode_is_large_enough_and_has_contrast(plane: PageServer, new_tab: NewTab, theme: str) -> None:
    saved = f"localStorage.setItem('autodrive.theme', '{theme}')"
    tab = new_tab(size=(1280, 720), script=saved).open(f"{plane.url}?quality=low")
    tab.page.emulate_media(reduced_motion="reduce")
    tab.show()
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8)}))
    tab.click("build-button")
    wait_for_parts(tab, "a")
    tab.page.evaluate(SHOW_CARDS)
    texts = tab.page.evaluate(TEXTS)
    assert {"Curved Road", "Problems (2)", "Leave open", "Start from"} <= {each["text"] for each in texts}
    assert [each for each in texts if each["contrast"] < MIN_CONTRAST or each["size"] < MIN_TEXT] == []
