"""The race track of Build mode in a real browser: made, dragged, checked while it is dragged, and driven."""

from __future__ import annotations

import math
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.protocol.messages import EditTrack, LapCompleted, Pause, TrackLine
from autodrive.scenario.scenario import ScenarioSpec, VehiclePlacement
from tests.page.test_edit import drag, on_screen
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab, touch

EXAMPLES = Path(__file__).parents[2] / "examples" / "racing"
OVAL = TrackLine(tuple((5.0 * math.cos(a), 3.0 * math.sin(a)) for a in np.arange(8) * math.pi / 4))


def line(tab: Tab) -> dict[str, Any]:
    return tab.value("store.scene.value.track_scene?.line ?? null")


def point(tab: Tab, index: int) -> list[float]:
    return on_screen(tab, *line(tab)["points"][index])


def opened(server: PageServer, new_tab: NewTab, *, size: tuple[int, int] = (1280, 720), touch: bool = False) -> Tab:
    """A tab in Build mode whose camera sees 30 m."""
    tab = new_tab(size=size, touch=touch).open(server.url + "?quality=low")
    tab.wait_for_image()
    tab.click("build-button")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())
    tab.wait_until(lambda: on_screen(tab, 0.0, 0.0) is not None)
    return tab


def drag_point(tab: Tab, server: PageServer, index: int, x: float, y: float) -> None:
    before = line(tab)["points"][index]
    drag(tab, point(tab, index), on_screen(tab, x, y))
    tab.wait_until(lambda: line(tab)["points"][index] != before)
    assert line(tab)["points"][index] == pytest.approx([x, y], abs=0.15)  # a pixel is up to 3 cm


def test_a_track_of_sixty_metres_is_dragged_saved_and_lapped(
    plane: PageServer, new_tab: NewTab, tmp_path: Path
) -> None:
    tab = opened(plane, new_tab)
    assert line(tab) is None
    plane.request(Pause())  # edits are faster
    tab.click("track-new")
    tab.wait_until(lambda: line(tab) is not None)
    tab.wait_until(lambda: (at := point(tab, 9)) and 340 < at[0] < 460)  # it shows all, beside the panel
    for index, (x, y) in ((6, (0.0, 4.0)), (0, (0.0, -4.0))):
        drag_point(tab, plane, index, x, y)
    start, *_ = line(tab)["points"]
    tab.page.mouse.click(*point(tab, 3))
    tab.wait_until(lambda: "Point 4 of 12" in tab.text("track-state"))
    tab.click("track-add")
    tab.wait_until(lambda: len(line(tab)["points"]) == 13)
    tab.page.keyboard.press("Delete")  # the point that was added is selected
    tab.wait_until(lambda: len(line(tab)["points"]) == 12)
    assert line(tab)["points"][0] == start
    assert plane.simulation.undo_name == "remove a point of the track"
    at = plane.simulation.world.pose("V1")[:2].tolist()
    tab.wait_until(lambda: tab.value("[...store.frame.value.vehicles.V1.pose.position]")[:2] == pytest.approx(at))
    assert tab.value("store.scene.value.track_scene.problems") == []
    assert "12 points, 59" in tab.text("track-state")
    tab.click("build-save")
    tab.get("save-title").fill("My circuit")
    with tab.page.expect_download() as download:
        tab.page.keyboard.press("Enter")
    file = tmp_path / "my_circuit.yaml"
    download.value.save_as(file)
    checked = call("check", file)
    assert checked.returncode == 0, checked.stderr
    command = runpy.run_path(str(EXAMPLES / "follow_the_gap.py"))["command"]
    angles = np.radians(np.linspace(-135.0, 135.0, 1080))
    car = {"V1": VehiclePlacement(type="roboracer")}
    world = autodrive.make(ScenarioSpec(map=str(file), vehicles=car))
    assert world.map.track is not None
    assert world.map.track.length == pytest.approx(60.0, abs=6.0)
    while not any(isinstance(event, LapCompleted) for event in world.frame.events):
        seen = world.frame.vehicles["V1"].lidar
        world.step({"V1": Command(*command(seen.ranges, angles)) if seen else Command()})
        assert world.time < 60.0
    assert world.frame.vehicles["V1"].collision_count == 0


def test_faults_are_shown_while_a_point_is_dragged_and_a_finger_and_keys_move_points(
    plane: PageServer, new_tab: NewTab
) -> None:
    plane.request(EditTrack(OVAL))
    plane.request(Pause())
    tab = opened(plane, new_tab, size=(1024, 768), touch=True)
    tab.wait_until(lambda: line(tab) is not None)
    tab.click("track-all")
    drawn = tab.value("store.imageCount.value")
    tab.wait_until(lambda: tab.value("store.imageCount.value") > drawn + 1)  # the camera is there
    assert point(tab, 4)[0] > 340
    tools = tab.page.context.new_cdp_session(tab.page)
    start, end = point(tab, 2), on_screen(tab, 0.0, -2.0)
    touch(tools, "touchStart", start)
    touch(tools, "touchMove", [0.5 * (a + b) for a, b in zip(start, end, strict=True)])
    touch(tools, "touchMove", end)
    tab.wait_until(lambda: "Problems (" in tab.page.locator("#build").inner_text())
    assert tab.value("store.scene.value.track_scene.problems") == []  # the simulator has not seen it
    touch(tools, "touchEnd")
    tab.wait_until(lambda: len(tab.value("store.scene.value.track_scene.problems")) > 0)
    faults = tab.get("track-problems").locator("li")
    assert faults.count() == len(tab.value("store.scene.value.track_scene.problems"))
    tab.click("build-undo")
    tab.wait_until(lambda: line(tab)["points"][2][1] == 3.0)
    tab.page.keyboard.press("Escape")
    tab.page.keyboard.press("n")
    tab.page.keyboard.press("ArrowRight")
    tab.wait_until(lambda: line(tab)["points"][0] == [5.5, 0.0])
    tab.get("track-width").fill("1.6")
    tab.page.keyboard.press("Enter")
    tab.wait_until(lambda: line(tab)["width"] == 1.6)
    tab.get("track-barrier").select_option("duct")
    tab.wait_until(lambda: line(tab)["barrier"] == "duct")


def test_a_link_contains_the_track_and_a_dropped_file_is_opened(plane: PageServer, new_tab: NewTab) -> None:
    plane.request(EditTrack(OVAL))
    tab = opened(plane, new_tab)
    tab.wait_until(lambda: line(tab) is not None)
    made = line(tab)
    tab.click("build-save")
    tab.click("save-map-link")
    tab.get("map-link").wait_for()
    link = tab.text("map-link")
    assert link.startswith(f"{plane.url}#own_map=")
    tab.click("link-dialog-cancel")
    plane.restart("plane")
    other = new_tab(size=(1280, 720)).open(link)
    other.click("link-changes-apply")
    other.wait_until(lambda: line(other) == made)
    other.wait_until(lambda: other.get("build-bar").is_visible())
    assert plane.simulation.undo_name == "open a map"
    other.wait_until(lambda: "own_map" not in other.page.url)  # a reload does not open it again
    cut = new_tab().open(link[:-40])
    cut.click("link-changes-apply")
    cut.wait_for_notice("the link was cut")
    assert line(cut) == made
    drop = """text => {
        const data = new DataTransfer()
        data.items.add(new File([text], 'narrow.yaml'))
        window.dispatchEvent(new DragEvent('drop', { dataTransfer: data, cancelable: true }))
    }"""
    other.page.evaluate(drop, "width: 1.0\npoints: [0 0, 9 0, 9 6, 0 6]\n")
    other.get("discard-dialog").wait_for()  # the map of the link is not saved
    other.click("discard-dialog-discard")
    other.wait_until(lambda: line(other)["width"] == 1.0)
    other.page.evaluate(drop, "points: [0 0")
    other.click("discard-dialog-discard")
    other.wait_until(lambda: other.page.locator(".notices").inner_text() != "")
    assert line(other)["width"] == 1.0
