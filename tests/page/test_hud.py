"""The HUD (report, table 13) shows the values of the Frame. Texts and numbers in detail: web/tests/hud.test.ts."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from autodrive.protocol import labels
from autodrive.protocol.messages import SetSceneLight
from tests.page.test_view import COLOURS
from tests.support.page import NewTab, PageServer, Tab

GRID = """(canvas) => {
    const small = Object.assign(document.createElement('canvas'), { width: 8, height: 6 })
    const context = small.getContext('2d')
    context.drawImage(canvas, 0, 0, 8, 6)
    return [...context.getImageData(0, 0, 8, 6).data]
}"""
"""A canvas in 8 x 6 pixels."""


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]


def test_driving_off_the_road_is_shown_and_plotted(mini_map: PageServer, tab: Tab) -> None:
    tab.show("hud")
    tab.wait_for_text("hud-driver", "None")
    assert tab.text("hud-bridge") == "Disconnected"
    assert tab.text("hud-offroad") == "On road"
    tab.page.keyboard.down("w")
    tab.page.keyboard.down("a")
    tab.wait_for_text("hud-driver", "You")
    tab.wait_for_text("hud-offroad", "Off road")
    tab.wait_for_notice("V1 left the road")
    tab.page.keyboard.up("w")
    tab.page.keyboard.up("a")
    tab.wait_until(lambda: numbers(tab.text("hud-rtf"))[0] > 0.01)
    plots = [tab.get("hud-polar"), *tab.get("hud-plot").all()]
    assert len(plots) == 3
    for plot in plots:
        canvas = plot.locator("canvas").first
        canvas.evaluate("(canvas) => canvas.scrollIntoView()")
        tab.wait_until(lambda canvas=canvas: canvas.evaluate(COLOURS) > 10)


def test_a_race_says_that_its_warm_up_lap_is_counted(race: PageServer, tab: Tab) -> None:
    tab.show("hud")
    tab.wait_for_text("hud-race-lap", "0 / 4")
    assert "Lap, 1 warm-up" in tab.text("hud-race")
    assert tab.value("store.scene.value.vehicles.V1.cameras") == ["front"]
    tab.wait_until(lambda: tab.get("hud-front-camera").is_visible() and not tab.get("hud-rear-camera").is_visible())
    assert tab.get("hud-polar").is_visible()


def test_previews_show_the_images_of_the_cameras(gl: str, mini_map: PageServer, tab: Tab) -> None:
    def shown(side: str) -> NDArray[np.float64]:
        values = tab.get(f"hud-{side}-camera").locator("canvas").evaluate(GRID)
        return np.array(values, float).reshape(6, 8, 4)[..., :3]

    def difference(side: str) -> float:
        image = mini_map.vehicle.cameras.get(side)
        if image is None:  # none was rendered since the reset
            return np.inf
        rows, columns = image.rgb.shape[0] // 6, image.rgb.shape[1] // 8
        cells = image.rgb[: 6 * rows, : 8 * columns].reshape(6, rows, 8, columns, 3).mean((1, 3))
        return float(np.abs(shown(side) - cells).mean())

    tab.show("hud")
    for side in ("front", "rear"):
        tab.wait_until(lambda side=side: tab.get(f"hud-{side}-camera").get_attribute("data-state") == "live")
        tab.wait_until(lambda side=side: shown(side).std() > 10)
        tab.wait_until(lambda side=side: difference(side) < 25)  # the browser scales differently
    day = shown("front").mean()
    mini_map.request(SetSceneLight(False))
    tab.wait_until(lambda: shown("front").mean() < 0.7 * day)


@pytest.mark.parametrize(("content", "colour"), [("depth", "#1bcfd4"), ("labels", labels.COLOURS[labels.Label.LAWN])])
def test_depth_and_labels_of_a_camera_are_shown_with_their_legend(
    mini_map: PageServer, new_tab: NewTab, content: str, colour: str
) -> None:
    tab = new_tab(size=(1024, 900)).open(mini_map.url + "?quality=low")
    tab.show("hud")
    tab.get("hud-sensor-view").select_option(f"{content}/front")
    near = """([canvas, wanted]) => {
        const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height })
        const context = copy.getContext('2d')
        context.drawImage(canvas, 0, 0)
        const { data } = context.getImageData(0, 0, copy.width, copy.height)
        let count = 0
        for (let i = 0; i < data.length; i += 4)
            count += Math.max(...[0, 1, 2].map((k) => Math.abs(data[i + k] - wanted[k]))) < 40
        return count
    }"""
    wanted = list(bytes.fromhex(colour[1:]))
    image = tab.get("hud-sensor-view-image")
    tab.wait_until(lambda: tab.page.evaluate(near, [image.element_handle(), wanted]) > 300)
    is_depth = content == "depth"
    assert tab.get("label-colours").is_visible() != is_depth
    assert tab.page.locator(".sensor-view .range-scale").is_visible() == is_depth
    assert image.get_attribute("aria-label") == f"{content.capitalize()} of the front camera"
    tab.get("hud-sensor-view").select_option("")
    tab.wait_until(lambda: not image.is_visible())


HUD = {
    "Simulation Time": "time",
    "Frame Rate": "frame-rate",
    "Driving Mode": "mode",
    "Gear": "gear",
    "Speed": "speed",
    "Throttle": "throttle",
    "Steering": "steering",
    "Encoder Ticks": "encoders",
    "Position": "position",
    "Orientation": "orientation",
    "Angular Velocity": "angular-velocity",
    "Linear Acceleration": "linear-acceleration",
    "Ranging Measurement": "lidar",
    "Front Camera Preview": "front-camera",
    "Rear Camera Preview": "rear-camera",
}
"""The items of the HUD panel (report, table 13), with the ends of their test identifiers."""

FIRST = {"speed", "gear", "mode", "front-camera"}


def test_the_hud_shows_the_first_items_and_each_item_of_the_report_on_demand(
    plane: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(1280, 720), is_first_visit=True).open(f"{plane.url}?quality=low")
    tab.wait_until(lambda: tab.get("hud").count() == 1)
    tab.click("hud-button")
    tab.wait_until(lambda: tab.value("store.frameRate.value") > 0)

    def shown() -> set[str]:
        return {name for name in HUD.values() if tab.get(f"hud-{name}").is_visible()}

    tab.wait_until(lambda: shown() == FIRST)
    tab.get("hud-more").locator("summary").first.click()
    tab.wait_until(lambda: shown() == set(HUD.values()))
    tab.page.reload()
    tab.wait_until(lambda: tab.get("hud-rear-camera").count() == 1 and tab.get("hud-rear-camera").is_visible())
