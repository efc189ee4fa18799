"""The 3D view and its tools. Rules of single parts: web/tests/scene.test.ts, tools.test.ts."""

from __future__ import annotations

import math
import re
from pathlib import Path

from autodrive.base.png import decode_png
from autodrive.protocol.messages import Pause
from tests.support.page import NewTab, PageServer, Tab

IMAGES = """() => new Promise((done) =>
    requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))))"""
"""Waits until at least one image was drawn with the present settings."""

COLOURS = """(canvas) => {
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height)
    return new Set(new Uint32Array(data.buffer)).size
}"""
"""Number of colours of a canvas."""


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
