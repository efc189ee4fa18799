"""Controls of the menu act on the simulation and show its state. Rules of single controls: web/tests/panels.test.ts."""

from __future__ import annotations

from autodrive.protocol.messages import Reset, SetDrivingMode, SetTimeOfDay, SetWeather, Weather
from autodrive.protocol.weather import PRESETS
from tests.support.command_line import call
from tests.support.page import PageServer, Tab, box


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


def test_time_controls(plane: PageServer, tab: Tab) -> None:
    tab.show("menu")
    tab.click("pause")
    tab.wait_until(lambda: plane.simulation.is_paused)
    tab.get("paused").wait_for(state="visible")
    tick = plane.frame.tick
    tab.get("ticks").fill("7")
    tab.click("step")
    tab.wait_until(lambda: plane.frame.tick == tick + 7)
    tab.page.keyboard.press("n")
    tab.wait_until(lambda: plane.frame.tick == tick + 8)
    tab.wait_until(lambda: tab.value("store.frame.value.tick") == tick + 8)
    tab.click("pause")
    tab.wait_until(lambda: plane.frame.tick > tick + 20)
    for label, speed in (("Max", None), ("1", 1.0)):
        button = tab.get("speed").get_by_role("button", name=label, exact=True)
        button.click()
        tab.wait_until(lambda speed=speed: plane.simulation.speed == speed)
        tab.wait_until(lambda button=button: button.get_attribute("aria-pressed") == "true")


def test_another_scenario_and_another_vehicle(plane: PageServer, tab: Tab) -> None:
    tab.show("menu")
    tab.get("scenario").select_option("two_cars")
    tab.wait_until(lambda: tab.value("store.scene.value.scenario") == "two_cars")
    tab.wait_until(lambda: tab.get("scenario").is_enabled())
    tab.get("vehicle").select_option("V2")
    tab.get("vehicle").blur()
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: plane.frame.vehicles["V2"].speed > 0.02)
    tab.page.keyboard.up("w")
    assert plane.frame.vehicles["V1"].throttle == 0
    tab.page.keyboard.press("v")
    tab.wait_until(lambda: tab.get("vehicle").input_value() == "V1")


def test_weather_and_time_of_day_are_set_with_the_keyboard(tab: Tab, plane: PageServer) -> None:
    tab.show("menu")
    tab.get("weather-heavy_rain").focus()
    tab.page.keyboard.press("Enter")
    tab.wait_until(lambda: "LIDAR" in tab.get("weather-numbers").inner_text())
    tab.get("time-of-day").focus()
    for _ in range(3):
        tab.page.keyboard.press("ArrowRight")
    tab.wait_until(lambda: tab.value("store.frame.value.time_of_day") == 60 * (12 * 60 + 15))
    assert tab.get("time-of-day").get_attribute("aria-valuetext") == "12:15"
    assert tab.value("store.frame.value.weather.rain") == 0.8
    plane.request(SetWeather())
    plane.request(Reset())


def test_intensity_and_dial_are_set_with_the_mouse(tab: Tab, plane: PageServer) -> None:
    plane.request(SetWeather(PRESETS["heavy_rain"]))
    tab.show("menu")
    intensity, dial = tab.get("weather-intensity"), tab.get("time-of-day")
    tab.wait_until(lambda: intensity.input_value() == "1")
    place = box(intensity)
    tab.page.mouse.click((place["left"] + place["right"]) / 2, (place["top"] + place["bottom"]) / 2)
    tab.wait_until(lambda: plane.frame.weather is not None and plane.frame.weather.rain == 0.4)
    assert plane.frame.weather is not None
    assert plane.frame.weather.clouds == 0.5
    dial.scroll_into_view_if_needed()
    place = box(dial)
    x, y = (place["left"] + place["right"]) / 2, (place["top"] + place["bottom"]) / 2
    tab.page.mouse.move(x + 40, y)  # noon is on top, 18:00 on the right
    tab.page.mouse.down()
    tab.page.mouse.move(x + 30, y + 30)
    tab.page.mouse.move(x, y + 40)
    tab.page.mouse.move(x - 40, y)
    tab.page.mouse.up()
    tab.wait_until(lambda: plane.frame.time_of_day == 6 * 3600.0)
    assert dial.get_attribute("aria-valuetext") == "06:00"
    plane.request(SetWeather())
    plane.request(Reset())


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
