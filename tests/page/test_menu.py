"""Controls of the menu act on the simulation and show its state. Rules of single controls: web/tests/panels.test.ts."""

from __future__ import annotations

from autodrive.protocol.messages import Reset, SetDrivingMode, SetTimeOfDay, SetWeather, Weather
from tests.support.command_line import call
from tests.support.page import PageServer, Tab


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
