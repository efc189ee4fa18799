"""Screenshots of all cameras by day and at night, in test-artefacts/page."""

from __future__ import annotations

import os

from autodrive.protocol.messages import Command, Headlights, Pause, SetSceneLight, Step
from tests.support.page import ROOT, NewTab, PageServer, Tab

CAMERAS = ["Driver's Eye", "Bird's Eye", "God's Eye", "Orbit", "Fly"]
FOLDER = ROOT / "test-artefacts" / "page"
QUALITY = os.environ.get("PAGE_PICTURES", "low")
"""Quality of the screenshots; 'high' also uses a full-size window and takes minutes with software rendering."""

SIZE = (1920, 1080) if QUALITY != "low" else (480, 270)


def screenshot(tab: Tab, name: str) -> float:
    """Save a screenshot after some frames; return the mean brightness of the middle of the scene, 0 to 1."""
    tab.page.evaluate("() => { window.drawn = 0; const next = () => (drawn++, requestAnimationFrame(next)); next() }")
    tab.wait_until(lambda: tab.page.evaluate("() => window.drawn") > 2)
    height, width = SIZE[1], SIZE[0]
    middle = tab.pixels(FOLDER / f"{name}.jpg")[height // 5 : -height // 5, width // 4 : -width // 4]
    assert middle.std() > 0.01, "a single colour"
    return float(middle.mean())


def test_each_camera_shows_day_and_night(mini_map: PageServer, new_tab: NewTab) -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    tab = new_tab(size=SIZE, draws=True).open(f"{mini_map.url}?quality={QUALITY}")
    tab.wait_for_image()
    mini_map.request(Pause())
    brightness: dict[str, list[float]] = {camera: [] for camera in CAMERAS}
    for time, headlights in (("day", Headlights.OFF), ("night", Headlights.LOW)):
        mini_map.request(SetSceneLight(time == "day"))
        frame = mini_map.request(Step(1, {"V1": Command(headlights=headlights)}))
        tab.wait_until(lambda frame=frame: tab.value("store.frame.value.tick") == frame.tick)
        for camera in CAMERAS:
            tab.wait_until(lambda camera=camera: tab.value("store.camera.value") == camera)
            name = camera.lower().replace("'", "").replace(" ", "-")
            brightness[camera].append(screenshot(tab, f"{name}-{time}"))
            tab.page.keyboard.press("c")
    for camera, (day, night) in brightness.items():
        assert night < 0.7 * day, camera
