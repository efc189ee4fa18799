"""Controls of the menu act on the simulation and show its state. Rules of single controls: web/tests/panels.test.ts."""

from __future__ import annotations

from autodrive.protocol.messages import Reset, SetDrivingMode, SetTimeOfDay, SetWeather, Weather
from tests.support.command_line import call
from tests.support.page import NewTab, PageServer, Tab, box


def test_simulator_controls(plane: PageServer, tab: Tab) -> None:
    tab.show("menu")
    tab.click("mode")
    tab.wait_until(lambda: plane.vehicle.is_autonomous)
    tab.wait_for_text("mode-status", "Autonomous")
    tab.page.keyboard.press("w")
    tab.wait_for_notice("is in Autonomous mode")
    plane.request(SetDrivingMode("V1", False))  # by another client
    tab.wait_for_text("mode-status", "Manual")
    tab.click("scene-light")
    tab.wait_until(lambda: not plane.frame.scene_light)
    tab.wait_for_text("scene-light-status", "Off")
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.vehicle.pose.position[0] > 0.1)
    tab.page.keyboard.up("w")
    tab.wait_until(lambda: plane.vehicle.throttle == 0)
    before = plane.frame.time
    tab.click("reset")
    tab.wait_until(lambda: plane.frame.time < before and plane.frame.scene_light)
    tab.wait_for_text("time", "00:00:0")
    tab.wait_for_notice("Reset to the initial state.")
    tab.wait_until(lambda: tab.value("store.frame.value.vehicles.V1.pose.position[0]") < 0.05)


def test_the_page_shows_the_lines_that_the_command_prints(tab: Tab, plane: PageServer) -> None:
    printed = call("weather", "rain=0.6", "time=18:30").stdout.rstrip("\n")
    assert "stops from 8 m/s" in printed
    tab.show("menu")
    plane.request(SetWeather(Weather(rain=0.6, wetness=1.0, snow_cover=0.0)))
    plane.request(SetTimeOfDay(18.5 * 3600.0))
    tab.wait_until(lambda: tab.get("weather-lines").text_content() == printed)
    plane.request(SetWeather(Weather(wetness=0.0, snow_cover=0.0)))
    tab.wait_until(lambda: not tab.get("weather-lines").is_visible())
    plane.request(SetWeather())
    plane.request(Reset())


MENU = {
    "IP Address Field": ("programs", "ip"),
    "Port Number Field": ("programs", "port"),
    "Connection Button": ("programs", "connect"),
    "Reset Button": ("scenario", "reset"),
    "Driving Mode Button": ("scenario", "mode"),
    "Camera Button": ("view", "camera"),
    "Scene Light Button": ("scenario", "scene-light"),
}
"""The items of the menu panel (report, table 13), with their tab and test identifier."""

STATES = {
    "connect": "bridge-status",
    "mode": "mode-status",
    "camera": "camera-status",
    "scene-light": "scene-light-status",
}
"""What the report wants to see beside the buttons."""

BAR = ("bar-speed", "bar-mode", "bar-camera", "bar-weather", "record-button", "bar-reset", "menu-button", "help")


def test_each_item_of_the_report_is_in_the_menu_at_the_first_visit(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720), is_first_visit=True).open(f"{plane.url}?quality=low")
    assert [name for name in BAR if not tab.get(name).is_visible()] == []
    tab.click("menu-button")
    tab.get("menu-tab-scenario").wait_for()
    first = [tab.get(name).first for name in ("scenario", "weather", "speed")]
    assert [box(one)["top"] for one in first] == sorted(box(one)["top"] for one in first)
    assert not tab.get("ip").is_visible()
    tab.click("menu-tab-programs")
    bridge = tab.get("bridge")
    line = box(bridge)
    assert line["bottom"] - line["top"] < 40, "the bridge is one line"
    bridge.locator("summary").click()
    for item, (part, testid) in MENU.items():
        tab.click(f"menu-tab-{part}")
        assert tab.get(testid).is_visible(), item
        assert tab.get(testid).is_enabled(), item
        if testid in STATES:
            assert tab.get(STATES[testid]).is_visible(), item
    tab.page.reload()
    tab.wait_until(lambda: tab.get("bridge").count() == 1)
    assert bridge.evaluate("(bridge) => bridge.open"), "the choice is kept"
