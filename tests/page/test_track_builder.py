"""The race track of Build mode in a real browser: made, dragged, checked while it is dragged, and driven."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.protocol.messages import LapCompleted, Pause
from autodrive.scenario.scenario import ScenarioSpec, VehiclePlacement
from tests.page.test_edit import drag, on_screen
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab

EXAMPLES = Path(__file__).parents[2] / "examples" / "racing"


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
