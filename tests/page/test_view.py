"""The 3D view and its tools. Rules of single parts: web/tests/scene.test.ts, tools.test.ts."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import pytest

from autodrive.base.png import decode_png
from autodrive.protocol.messages import Pause
from tests.support.page import NewTab, PageServer, Tab, box

IMAGES = """() => new Promise((done) =>
    requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))))"""
"""Waits until at least one image was drawn with the present settings."""

COLOURS = """(canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)
    return new Set(new Uint32Array(data.buffer)).size
}"""
"""Number of colours of a canvas."""

BLUE = """(canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)
    let count = 0
    for (let i = 0; i < data.length; i += 4) count += data[i + 2] > data[i] + 60 && data[i + 2] > data[i + 1] + 40
    return count
}"""
"""Number of blue pixels of a canvas."""


def length_on_screen(tab: Tab) -> float:
    """Length of V1 on the screen [pixels], when the camera has come to rest."""
    ends = """() => [0, 0.14].map((ahead) => {
        const { pose } = autodrive.store.frame.value.vehicles.V1
        return autodrive.view.screenPoint(pose.position[0] + ahead, pose.position[1], pose.position[2])
    })"""
    length, before = 1.0, 0.0
    while abs(length - before) > 1e-3 * length:
        tab.page.evaluate(IMAGES)
        (x0, y0), (x1, y1) = tab.page.evaluate(ends)
        length, before = math.hypot(x1 - x0, y1 - y0), length
    return length


def test_the_mouse_wheel_zooms_all_cameras_in_the_same_direction(mini_map: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240)).open(f"{mini_map.url}?quality=low")
    mini_map.request(Pause())
    tab.wait_for_image()
    tab.page.mouse.move(160, 120)
    for camera in ("Driver's Eye", "Bird's Eye", "God's Eye", "Orbit"):
        tab.wait_until(lambda camera=camera: tab.value("store.camera.value") == camera)
        lengths = []
        for clicks in (0, 3, -3):
            if clicks:
                tab.page.mouse.wheel(0, -100 * clicks)
                tab.page.wait_for_timeout(200)
            lengths.append(length_on_screen(tab))
        assert lengths[1] > 1.05 * lengths[0], camera  # up is nearer
        assert lengths[2] == pytest.approx(lengths[0], rel=0.02), camera
        if camera != "Orbit":
            tab.page.keyboard.press("c")
    azimuth = tab.value("store.orbit.value.azimuth")
    tab.page.mouse.down()
    tab.page.mouse.move(240, 120, steps=4)
    tab.page.mouse.up()
    tab.wait_until(lambda: abs(tab.value("store.orbit.value.azimuth") - azimuth) > 0.5)  # the drag turns the camera
    tab.wait_until(lambda: f"orbit={math.degrees(tab.value('store.orbit.value.azimuth')):.0f}" in tab.page.url)


def test_the_fly_camera_flies_while_the_vehicle_stands(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(320, 240)).open(f"{plane.url}?quality=low#camera=orbit")
    tab.wait_for_image()
    tab.wait_until(lambda: tab.value("store.orbit.value"))
    rest = plane.vehicle.pose.position
    tab.page.keyboard.press("c")
    tab.wait_for_notice("Keys and pads move the camera")
    tab.wait_until(lambda: tab.value("store.fly.value"))
    before = tab.value("store.fly.value")
    orbit = tab.value("store.orbit.value")  # it starts where the Orbit camera was, which looks at the vehicle
    assert math.cos(before["azimuth"] - orbit["azimuth"]) == pytest.approx(-1.0, abs=1e-3)
    assert before["elevation"] == pytest.approx(-orbit["elevation"], abs=1e-3)
    tab.page.keyboard.down("s")
    tab.wait_until(lambda: math.dist([before[a] for a in "xyz"], [tab.value("store.fly.value")[a] for a in "xyz"]) > 1)
    tab.page.keyboard.up("s")
    tab.page.mouse.move(100, 100)
    tab.page.mouse.down()
    tab.page.mouse.move(200, 100, steps=4)
    tab.page.mouse.up()
    tab.wait_until(lambda: tab.value("store.fly.value.azimuth") < before["azimuth"] - 0.3)  # to the right
    tab.wait_until(lambda: "fly=" in tab.page.url)
    tab.wait_until(
        lambda: abs(float(tab.page.url.split("fly=")[1].split(",")[0]) - tab.value("store.fly.value.x")) < 0.01
    )
    kept = tab.value("store.fly.value")
    tab.page.keyboard.press("c")
    tab.wait_until(lambda: tab.value("store.camera.value") == "Driver's Eye")
    for _ in range(4):
        tab.page.keyboard.press("c")
    tab.page.evaluate(IMAGES)
    assert tab.value("store.fly.value") == kept
    assert plane.vehicle.pose.position == pytest.approx(rest, abs=1e-3)


def test_a_link_opens_the_same_view_and_a_reload_keeps_it(two_cars: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1024, 768)).open(two_cars.url)
    tab.wait_until(lambda: tab.value("store.scene.value.scenario") == two_cars.scenario())
    tab.wait_for_image()
    tab.page.keyboard.press("v")
    tab.wait_for_notice("V2 is viewed now.")
    for key in "cccuqo":  # Orbit, HUD, small map, log
        tab.page.keyboard.press(key)
    tab.show("hud", "menu")
    tab.get("quality").select_option("low")
    tab.wait_until(lambda: "quality=low" in tab.page.url and "orbit=" in tab.page.url)

    def view(of: Tab) -> list[object]:
        values = "store.camera.value, store.orbit.value, store.vehicle.value, store.quality.value"
        panels = [of.get(panel).is_visible() for panel in ("menu", "hud", "minimap", "log")]
        return [*of.value(f"[{values}].map((it) => JSON.stringify(it))"), *panels]

    before = view(tab)
    assert before[0] == '"Orbit"'
    assert before[2:] == ['"V2"', '"low"', True, True, True, True]
    link = tab.page.url
    tab.page.reload(wait_until="domcontentloaded")
    other = new_tab(size=(1024, 768))
    for opened in (tab, other.open(link)):
        opened.wait_until(lambda opened=opened: opened.value("store.frame.value !== null && view !== null"))
        opened.get("hud").wait_for(state="visible")
        opened.wait_for_image()
        after = view(opened)
        assert after[2:] == before[2:]
        assert json.loads(str(after[1])) == pytest.approx(json.loads(str(before[1])), abs=2e-3)
        assert after[0] == before[0]


def test_vehicles_differ_by_label_and_colour(two_cars: PageServer, new_tab: NewTab) -> None:
    two_cars.request(Pause())
    tab = new_tab(size=(640, 480), draws=True).open(f"{two_cars.url}?quality=low#camera=birds-eye&height=2&scan=0")
    tab.wait_for_image()
    labels = tab.page.locator(".vehicle-labels span")
    assert labels.all_text_contents() == ["V1", "V2"]
    hues = []
    for name in ("V1", "V2"):
        tab.page.evaluate(f"() => {{ autodrive.store.vehicle.value = '{name}' }}")
        tab.page.evaluate(IMAGES)
        tab.wait_until(lambda: length_on_screen(tab) > 0)
        assert tab.page.locator(".vehicle-labels .viewed").all_text_contents() == [name]
        # the label is above the vehicle, which is in the middle of the image
        label = box(tab.page.locator(".vehicle-labels .viewed"))
        assert abs(label["left"] + label["right"] - 640) < 80
        patch = tab.pixels()[235:246, 310:331].reshape(-1, 3)
        hues.append(patch.mean(0) / patch.mean())
    blue, orange = hues
    assert blue[2] > 1.15 > orange[2]
    assert orange[0] > 1.15 > blue[0]


def test_a_screenshot_is_a_png_of_the_view(two_cars: PageServer, new_tab: NewTab, tmp_path: Path) -> None:
    tab = new_tab(size=(640, 480), draws=True).open(f"{two_cars.url}?quality=low#camera=birds-eye")
    tab.wait_for_image()
    with tab.page.expect_download() as download:
        tab.page.keyboard.press("i")
    assert re.fullmatch(r"two_cars-\d+\.\d\ds\.png", download.value.suggested_filename)
    path = tmp_path / "view.png"
    download.value.save_as(path)
    image = decode_png(path.read_bytes())
    assert image.shape[:2] == (480, 640)  # the light profile draws fewer pixels
    assert image[..., :3].std() > 10
    tab.wait_for_notice("Saved two_cars-")


def test_full_screen_is_entered_and_left_with_a_key(plane: PageServer, tab: Tab) -> None:
    for expected in (True, False):
        tab.page.keyboard.press("f")
        tab.wait_until(lambda expected=expected: tab.page.evaluate("() => !!document.fullscreenElement") == expected)


def test_two_clicks_measure_a_distance_on_the_ground(mini_map: PageServer, tab: Tab) -> None:
    tab.page.evaluate('() => { autodrive.store.camera.value = "Bird\'s Eye" }')
    tab.wait_for_image()
    tab.wait_until(lambda: tab.value("view.groundPoint(512, 400)") is not None)
    tab.page.evaluate(IMAGES)
    tab.page.keyboard.press("x")
    points = ((400, 300), (640, 560))
    ends = [tab.value(f"view.groundPoint({x}, {y})") for x, y in points]
    for x, y in points:
        tab.page.mouse.click(x, y)
    tab.page.evaluate(IMAGES)
    # Bird's Eye looks straight down from 3 m: a pixel is 2 tan(30 degrees) 3 m / 768
    pixel = 2 * math.tan(math.radians(30)) * 3 / 768
    assert math.dist(*ends) == pytest.approx(math.dist(*points) * pixel, rel=1e-3)
    assert tab.text("distance") == f"{math.dist(*points) * pixel:.2f} m"
    tab.page.keyboard.press("Escape")
    tab.get("measure").wait_for(state="hidden")
    # with the keyboard: 160 pixels to the right of the first point; the vehicle does not move
    tab.page.keyboard.press("x")
    for key in ("Enter", *["ArrowRight"] * 10, "Enter"):
        tab.page.keyboard.press(key)
    tab.page.evaluate(IMAGES)
    assert tab.text("distance") == f"{160 * pixel:.2f} m"
    assert mini_map.vehicle.throttle == 0
    assert mini_map.vehicle.steering == 0
    tab.page.keyboard.press("Escape")


def test_a_box_hides_the_scan_points_on_its_far_side(running: PageServer, new_tab: NewTab) -> None:
    running.restart("boxes")
    tab = new_tab(size=(640, 480), draws=True).open(f"{running.url}?quality=low#camera=orbit")
    tab.wait_for_image()
    running.request(Pause())
    tab.wait_until(lambda: tab.value("store.scans.size") == 1)

    def points_from(azimuth: float) -> int:
        """Number of pixels of the middle box in which the image with the scan differs, seen from 6 m away."""
        orbit = f"{{ azimuth: {azimuth}, elevation: 0.3, distance: 6 }}"
        pictures = []
        for is_shown in ("true", "false"):
            tab.page.evaluate(
                f"() => {{ autodrive.store.orbit.value = {orbit}; autodrive.store.isScanShown.value = {is_shown} }}"
            )
            tab.page.evaluate(IMAGES)
            pictures.append(tab.pixels()[200:280, 317:323])
        return int((abs(pictures[0] - pictures[1]).max(2) > 0.15).sum())

    assert points_from(math.pi) > 10  # behind the vehicle: the side of the boxes that the LIDAR sees
    assert points_from(0.0) == 0


def test_the_driven_line_is_drawn_in_the_scene_and_on_the_small_map(mini_map: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(640, 480), draws=True, expects="willReadFrequently")
    tab.open(f"{mini_map.url}?quality=low#camera=birds-eye&map=1&scan=0")
    tab.wait_for_image()
    tab.page.keyboard.down("w")
    tab.wait_until(lambda: mini_map.vehicle.pose.position[0] > 0.9)
    tab.page.keyboard.up("w")
    mini_map.request(Pause())
    tab.wait_until(lambda: tab.value("store.frame.value.time") == mini_map.frame.time)
    canvas = tab.get("minimap").locator("canvas")
    tab.wait_until(lambda: canvas.evaluate(COLOURS) > 10)  # the drawing of the map is loaded

    def stands() -> bool:
        """Whether the next image is the same: the view shows Frames with a delay."""
        before = tab.pixels()
        tab.page.evaluate(IMAGES)
        return bool((tab.pixels() == before).all())

    tab.wait_until(stands)
    calls, blue, scene = tab.value("view.stats().calls"), canvas.evaluate(BLUE), tab.pixels()
    tab.page.evaluate("() => { autodrive.store.areTrailsShown.value = true }")
    tab.wait_until(lambda: tab.value("view.stats().calls") == calls + 1)
    tab.wait_until(lambda: canvas.evaluate(BLUE) > blue + 5)  # most of the short line is below the arrow
    tab.page.evaluate(IMAGES)
    trail_scene = tab.pixels()
    # the way from x = 0 is below the middle: up on the screen is x
    before, after = (picture[280:420, 310:330].mean((0, 1)) for picture in (scene, trail_scene))
    assert after[2] - after[0] > before[2] - before[0] + 0.03
