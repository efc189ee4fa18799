"""Each control of the menu (report, table 13, and more) acts on the simulation, and says how it stands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from playwright.sync_api import Browser

from autodrive.protocol.messages import SetDrivingMode
from tests.page.conftest import Visitor, visits_with
from tests.page.visits import Served, Visit

CAMERAS = ["Driver's Eye", "Bird's Eye", "God's Eye", "Orbit"]


@pytest.fixture(scope="module")
def tab(served: Served, browser: Browser) -> Iterator[Visit]:
    served.renew("plane")
    with visits_with(browser) as visitor:
        yield visitor().go(served.url + "?quality=low")


@pytest.fixture
def visit(plane: Served, tab: Visit) -> Visit:
    """One for all, with its menu open."""
    tab.until(lambda: tab.knows("store.scene.value.scenario") == "plane")
    tab.until_begun(plane)
    if not tab.get("menu").is_visible():
        tab.press("menu-button")
    return tab


def test_toolbar_opens_and_closes_menu_and_hud(visit: Visit) -> None:
    for panel, key in (("menu", "m"), ("hud", "u")):
        if visit.get(panel).is_visible():
            visit.press(f"{panel}-button")
        for act in (lambda panel=panel: visit.press(f"{panel}-button"), lambda key=key: visit.page.keyboard.press(key)):
            assert not visit.get(panel).is_visible()
            act()
            visit.get(panel).wait_for(state="visible")
            assert visit.get(f"{panel}-button").get_attribute("aria-expanded") == "true"
            act()
            visit.get(panel).wait_for(state="hidden")
            assert visit.get(f"{panel}-button").get_attribute("aria-expanded") == "false"


def test_reset_brings_back_the_world_and_the_fields_and_keeps_the_viewer(plane: Served, visit: Visit) -> None:
    visit.get("ip").fill("10.0.0.9")
    visit.get("port").fill("9999")
    visit.page.keyboard.press("Escape")
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.vehicle.pose.position[0] > 0.3)
    visit.page.keyboard.up("w")
    visit.until(lambda: plane.vehicle.throttle == 0)
    before = plane.frame.time
    visit.page.evaluate("() => { window.welcome = autodrive.store.welcome.value }")
    visit.press("reset")
    visit.until(lambda: plane.frame.time < before)
    assert np.linalg.norm(plane.vehicle.pose.position[:2]) < 0.05
    visit.until_text("time", "00:00:0")
    visit.until_text("notices", "Reset to the initial state.")
    visit.until(lambda: visit.knows("store.frame.value.vehicles.V1.pose.position[0]") < 0.05)
    assert (visit.get("ip").input_value(), visit.get("port").input_value()) == ("127.0.0.1", "4567")
    assert visit.page.evaluate("() => window.welcome === autodrive.store.welcome.value")  # the same visit


def test_driving_mode_is_switched_and_shown(plane: Served, visit: Visit) -> None:
    visit.until_text("mode-status", "Manual")
    visit.press("mode")
    visit.until(lambda: plane.vehicle.is_autonomous)
    visit.until_text("mode-status", "Autonomous")
    visit.page.keyboard.press("w")  # the person is told why nothing happens
    visit.until_text("notices", "is in Autonomous mode")
    assert plane.vehicle.throttle == 0
    visit.press("mode")
    visit.until(lambda: not plane.vehicle.is_autonomous)
    visit.until_text("mode-status", "Manual")
    plane.ask(SetDrivingMode("V1", True))  # and by somebody else
    visit.until_text("mode-status", "Autonomous")


def test_camera_goes_through_the_scene_cameras_and_says_which(visit: Visit) -> None:
    for camera in [*CAMERAS, *CAMERAS[:1]][1:]:
        visit.press("camera")
        assert visit.text("camera-status") == camera == visit.knows("store.camera.value")


def test_wheel_zooms_in_the_birds_eye(visit: Visit) -> None:
    while visit.knows("store.camera.value") != "Bird's Eye":
        visit.page.keyboard.press("c")
    before = visit.knows("store.birdHeight.value")
    visit.page.mouse.move(800, 400)
    visit.page.mouse.wheel(0, -300)  # up
    visit.until(lambda: visit.knows("store.birdHeight.value") == pytest.approx(before + 0.3))
    visit.page.mouse.wheel(0, 300)
    visit.until(lambda: visit.knows("store.birdHeight.value") == pytest.approx(before))


def test_scene_light_is_switched_and_the_picture_gets_dark(plane: Served, visitor: Visitor) -> None:
    visit = visitor(draws=True, size=(640, 360)).go(plane.url + "?quality=low")
    visit.until_drawn()
    canvas = visit.page.locator("#scene")
    visit.press("menu-button")
    visit.until(lambda: visit.pixels(canvas)[120:, 340:].mean() > 0.2)
    day = visit.pixels(canvas)[120:, 340:].mean()
    visit.press("scene-light")
    visit.until(lambda: not plane.frame.scene_light)
    visit.until_text("scene-light-status", "Off")
    visit.until(lambda: visit.pixels(canvas)[120:, 340:].mean() < 0.7 * day)
    visit.press("scene-light")
    visit.until(lambda: plane.frame.scene_light)
    visit.until_text("scene-light-status", "On")


def test_time_is_paused_stepped_and_resumed(plane: Served, visit: Visit) -> None:
    visit.press("pause")
    visit.until(lambda: plane.simulation.is_paused)
    visit.get("paused").wait_for(state="visible")
    visit.until_text("pause", "Resume")
    tick = plane.frame.tick
    visit.get("ticks").fill("7")
    visit.press("step")
    visit.until(lambda: plane.frame.tick == tick + 7)
    visit.page.keyboard.press("n")
    visit.until(lambda: plane.frame.tick == tick + 8)
    visit.until(lambda: visit.knows("store.frame.value.tick") == tick + 8)
    visit.press("pause")
    visit.until(lambda: plane.frame.tick > tick + 20)
    visit.until_text("pause", "Pause")


@pytest.mark.parametrize(("label", "speed"), [("¼", 0.25), ("2", 2.0), ("Max", None), ("1", 1.0)])
def test_speed_is_chosen(plane: Served, visit: Visit, label: str, speed: float | None) -> None:
    button = visit.get("speed").get_by_role("button", name=label, exact=True)
    button.click()
    visit.until(lambda: plane.simulation.speed == speed)
    visit.until(lambda: button.get_attribute("aria-pressed") == "true")


def test_another_scenario_is_loaded_and_the_page_goes_on(plane: Served, visit: Visit) -> None:
    names = visit.get("scenario").locator("option").evaluate_all("(all) => all.map((one) => one.value)")
    assert {"plane", "mini_map", "two_cars", "night"} <= set(names)
    visit.get("scenario").select_option("two_cars")
    visit.until(lambda: len(plane.frame.vehicles) == 2)
    visit.until(lambda: visit.knows("store.scene.value.scenario") == "two_cars")
    visit.until(lambda: visit.get("scenario").is_enabled())
    visit.get("vehicle").select_option("V2")
    visit.get("vehicle").blur()
    visit.page.keyboard.down("w")
    visit.until(lambda: plane.frame.vehicles["V2"].speed > 0.05)
    visit.page.keyboard.up("w")
    assert plane.frame.vehicles["V1"].throttle == 0
    visit.page.keyboard.press("v")
    visit.until(lambda: visit.get("vehicle").input_value() == "V1")


def test_theme_is_chosen_and_kept(plane: Served, visit: Visit) -> None:
    colour = "() => getComputedStyle(document.querySelector('#menu')).backgroundColor"
    visit.get("theme").get_by_role("button", name="Light").click()
    light = visit.page.evaluate(colour)
    visit.get("theme").get_by_role("button", name="Dark").click()
    assert visit.page.evaluate(colour) != light
    assert visit.page.evaluate("() => document.documentElement.dataset.theme") == "dark"
    other = Visit(visit.page.context.new_page()).go(plane.url + "?quality=low")
    assert other.page.evaluate("() => document.documentElement.dataset.theme") == "dark"
    other.page.close()
    visit.get("theme").get_by_role("button", name="System").click()


def test_quality_and_lidar_are_chosen(visit: Visit) -> None:
    visit.get("quality").select_option("high")
    visit.until(lambda: visit.knows("view.stats().profile") == "high")
    visit.get("quality").select_option("low")
    visit.until(lambda: visit.knows("view.stats().profile") == "light")  # in software GL
    visit.get("lidar").uncheck()
    assert visit.knows("store.isScanShown.value") is False
    visit.get("lidar").check()
    assert visit.knows("store.isScanShown.value") is True
