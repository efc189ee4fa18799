"""A picture of each view by day and by night is kept in test-artefacts/page, for people."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from autodrive.protocol.messages import Command, Headlights, Pause, SetSceneLight, Step
from tests.page.conftest import visits_with
from tests.page.visits import ROOT, Served, Visit

CAMERAS = ["Driver's Eye", "Bird's Eye", "God's Eye", "Orbit"]
FOLDER = ROOT / "test-artefacts" / "page"
QUALITY = os.environ.get("PAGE_PICTURES", "low")
"""Of the pictures that are kept: 'high' is nicer, and takes minutes in software GL."""


@pytest.fixture(scope="module")
def visit(served: Served, browser: Browser) -> Iterator[Visit]:
    """Full size; the world stands still."""
    served.renew("mini_map")
    FOLDER.mkdir(parents=True, exist_ok=True)
    with visits_with(browser) as visitor:
        visit = visitor(size=(1920, 1080)).go(f"{served.url}?quality={QUALITY}")
        visit.until_drawn()
        served.ask(Pause())
        yield visit


def kept(visit: Visit, name: str) -> float:
    """The picture as it is after some drawing, in a file; how bright the scene is in the middle, 0 to 1."""
    visit.page.evaluate(
        "() => { window.drawn = 0; const count = () => (++drawn, requestAnimationFrame(count)); count() }"
    )
    visit.until(lambda: visit.page.evaluate("() => window.drawn") > 3)
    visit.page.screenshot(path=FOLDER / f"{name}.png", animations="disabled")
    middle = visit.pixels()[200:900, 500:1400]
    assert middle.std() > 0.01, "all of one colour"
    return float(middle.mean())


@pytest.mark.parametrize("camera", CAMERAS)
def test_each_camera_shows_day_and_night(served: Served, visit: Visit, camera: str) -> None:
    name = camera.lower().replace("'", "").replace(" ", "-")
    while visit.knows("store.camera.value") != camera:
        visit.page.keyboard.press("c")
    bright = {}
    for time in ("day", "night"):
        served.ask(SetSceneLight(time == "day"))
        lamps = Headlights.OFF if time == "day" else Headlights.LOW
        frame = served.ask(Step(1, {"V1": Command(headlights=lamps)}))
        visit.until(lambda frame=frame: visit.knows("store.frame.value.tick") == frame.tick)
        bright[time] = kept(visit, f"{name}-{time}")
    assert bright["night"] < 0.7 * bright["day"]


def test_menu_and_hud_are_kept_open(served: Served, visit: Visit) -> None:
    served.ask(SetSceneLight(True))
    while visit.knows("store.camera.value") != CAMERAS[0]:
        visit.page.keyboard.press("c")
    visit.press("menu-button")
    visit.press("hud-button")
    for theme in ("Light", "Dark"):
        visit.get("theme").get_by_role("button", name=theme).click()
        kept(visit, f"menu-and-hud-{theme.lower()}")
