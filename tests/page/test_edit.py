"""Edit mode in a real browser: the Frames and the scenario file of the simulator show what was edited."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

import autodrive
from autodrive.base.transforms import euler_from_quaternion
from autodrive.protocol.messages import SetSceneLight
from tests.page.test_driving import yaw
from tests.page.test_screens import SHOW_CARDS
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab, overlap, touch


def opened(server: PageServer, new_tab: NewTab, *, touch: bool = False) -> Tab:
    """A tab in Edit mode."""
    tab = new_tab(size=(900, 560), touch=touch).open(server.url + "?quality=low")
    tab.wait_for_image()
    tab.click("edit-button")
    tab.wait_until(lambda: tab.get("edit-bar").is_visible())
    # the camera of Edit mode looks at the vehicle
    tab.wait_until(lambda: (at := on_screen(tab, 0.0, 0.0)) is not None and at == pytest.approx([450, 280], abs=40))
    return tab


@pytest.fixture
def editing(plane: PageServer, new_tab: NewTab) -> Tab:
    """Edit mode; the plane has no box."""
    return opened(plane, new_tab)


def on_screen(tab: Tab, x: float, y: float, z: float = 0.0) -> list[float]:
    """Where a point of the map is shown [CSS pixels]."""
    return tab.value(f"view.screenPoint({x}, {y}, {z})")


def drag(tab: Tab, start: list[float], end: list[float]) -> None:
    """Drag with the left button."""
    mouse = tab.page.mouse
    mouse.move(*start)
    mouse.down()
    mouse.move(*(0.5 * (a + b) for a, b in zip(start, end, strict=True)), steps=3)
    mouse.move(*end, steps=3)
    mouse.up()


def test_a_vehicle_is_dragged_and_turned_and_the_edits_are_undone(plane: PageServer, editing: Tab) -> None:
    at, to = on_screen(editing, 0.07, 0.0), on_screen(editing, 0.57, 0.3)
    drag(editing, at, to)
    editing.wait_until(lambda: plane.simulation.undo_name == "place V1")
    assert plane.vehicle.pose.position[:2] == pytest.approx([0.5, 0.3], abs=0.02)  # a pixel is 4 mm
    editing.wait_until(lambda: editing.value("store.preview.value") is None)  # then the camera stands
    # the handle is ahead of the vehicle: drag it to the left of its middle
    circle = editing.get("edit-overlay").locator("circle")
    editing.wait_until(lambda: abs(float(circle.get_attribute("cy") or 0) - to[1]) < 20)
    handle = [float(circle.get_attribute(name) or 0) for name in ("cx", "cy")]
    drag(editing, handle, on_screen(editing, 0.57, 0.6))
    editing.wait_until(lambda: yaw(plane) == pytest.approx(1.57, abs=0.1))
    middle = plane.vehicle.pose.position[:2]
    assert middle == pytest.approx([0.57, 0.3 - 0.07], abs=0.02)  # it turns about its middle
    editing.page.keyboard.press("Control+z")
    editing.wait_until(lambda: abs(yaw(plane)) < 0.01)
    editing.click("edit-undo")
    editing.wait_until(lambda: abs(plane.vehicle.pose.position[0]) < 0.01)
    editing.page.keyboard.press("Control+Shift+z")
    editing.wait_until(lambda: plane.vehicle.pose.position[0] > 0.45)


def test_the_saved_file_passes_the_check_and_starts_as_the_edited_scenario(
    plane: PageServer, editing: Tab, tmp_path: Path
) -> None:
    editing.click("edit-right")
    editing.wait_until(lambda: yaw(plane) < -0.2)
    editing.click("edit-add")
    editing.wait_until(lambda: "box_1" in plane.frame.objects)
    editing.click("edit-save")
    editing.get("save-title").fill("My plane")
    with editing.page.expect_download() as download:
        editing.page.keyboard.press("Enter")
    assert download.value.suggested_filename == "plane_edited.yaml"
    file = tmp_path / "mine.yaml"
    download.value.save_as(file)
    checked = call("check", file)
    assert checked.returncode == 0, checked.stderr  # which also has the log of the simulation of this process
    world = autodrive.make(file)
    assert world.spec.title == "My plane"
    start = world.frame
    assert euler_from_quaternion(start.vehicles["V1"].pose.orientation)[2] == pytest.approx(-0.2618, abs=1e-4)
    there = plane.frame.objects["box_1"].pose.position
    assert start.objects["box_1"].pose.position == pytest.approx(there, abs=1e-3)


def test_a_finger_drags_a_vehicle_and_the_map_moves_beside_it(plane: PageServer, new_tab: NewTab) -> None:
    editing = opened(plane, new_tab, touch=True)
    start, end = on_screen(editing, 0.07, 0.0), on_screen(editing, 0.07, 0.4)
    send = partial(touch, editing.page.context.new_cdp_session(editing.page))
    send("touchStart", start)
    for share in (0.3, 0.6, 1.0):
        send("touchMove", [a + share * (b - a) for a, b in zip(start, end, strict=True)])
    send("touchEnd")
    editing.wait_until(lambda: plane.vehicle.pose.position[1] == pytest.approx(0.4, abs=0.03))
    beside = on_screen(editing, 0.7, -0.3)
    send("touchStart", beside)
    for share in (10.0, 40.0, 80.0):
        send("touchMove", [beside[0] - share, beside[1]])
    send("touchEnd")
    editing.wait_until(lambda: on_screen(editing, 0.7, -0.3)[0] < beside[0] - 40)
    assert plane.vehicle.pose.position[0] == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("size", [(1280, 720), (1920, 1080), (800, 600)], ids=lambda size: "x".join(map(str, size)))
def test_the_bar_covers_no_panel_and_names_what_it_does(
    plane: PageServer, new_tab: NewTab, size: tuple[int, int]
) -> None:
    tab = new_tab(size=size).open(f"{plane.url}?quality=low#hud=1")
    tab.click("edit-button")
    tab.page.evaluate(SHOW_CARDS)
    bar = tab.get("edit-bar")
    for panel in ("edit", "hud", "minimap", "log"):
        tab.wait_until(lambda panel=panel: tab.get(panel).is_visible())
        tab.wait_until(lambda panel=panel: not overlap(bar, tab.get(panel)))
    assert [tab.get(f"edit-{name}").inner_text() for name in ("undo", "redo")] == ["Undo", "Redo"]


def test_edit_mode_has_light_at_night_and_the_simulation_stays_dark(plane: PageServer, new_tab: NewTab) -> None:
    plane.request(SetSceneLight(False))
    try:
        tab = new_tab(size=(600, 400), draws=True).open(plane.url + "?quality=low#camera=birds-eye&scan=0")
        tab.wait_for_image()
        dark = float(tab.pixels().mean())
        tab.page.keyboard.press("j")
        tab.wait_until(lambda: float(tab.pixels()[150:250, 50:200].mean()) > dark + 0.15)
        assert not plane.frame.scene_light
        tab.page.keyboard.press("Escape")
        tab.wait_until(lambda: float(tab.pixels().mean()) < dark + 0.05)
    finally:
        plane.request(SetSceneLight(True))
