"""What Build mode shows, and when: a piece that was set at once, a new image of the scene only if it differs."""

from __future__ import annotations

import numpy as np
import pytest
import simplejpeg

from autodrive.protocol.messages import EditMap, MapModule, MapWall, Pause
from tests.page.test_build import begin, opened, parts, press, wait_for_parts
from tests.page.test_edit import on_screen
from tests.support.page import NewTab, PageServer, Tab

COUNT = """
window.drawn = 0
for (const name of ['drawArrays', 'drawArraysInstanced', 'drawElements', 'drawElementsInstanced'])
  WebGL2RenderingContext.prototype[name] = () => { window.drawn += 1 }
"""
"""Counts what WebGL is asked to draw."""

NOTE = """() => {
  const note = (what) => {
    const shown = [...document.querySelectorAll('.build-picture:not(.ghost)')].filter((one) => one.style.display === '')
    events.push([what, shown.length])
  }
  window.events = []
  autodrive.store.scene.watch(() => note('Scene'))
  autodrive.store.shownScene.watch(() => note('shown'))
}"""
"""Notes how many pieces that were set are drawn over the scene, when a Scene comes and when an image shows it."""


@pytest.fixture
def building(plane: PageServer, new_tab: NewTab) -> Tab:
    plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8), "w": MapWall(((2, 2), (3, 2)), 0.2)}))
    tab = opened(plane, new_tab)
    wait_for_parts(tab, "a", "w")
    return tab


def placed(tab: Tab) -> int:
    """Number of pieces that were set and are drawn over the scene."""
    return tab.page.locator(".build-picture:not(.ghost):visible").count()


def test_a_piece_is_shown_from_when_it_is_set_until_the_scene_shows_it(building: Tab) -> None:
    press(building, "n")  # the button of Build mode, which has the focus, is not pressed again
    building.wait_until(lambda: building.get("build-set").is_enabled())
    building.wait_until(lambda: building.value("store.shownScene.value === store.scene.value"))
    building.page.evaluate(NOTE)
    press(building, "Enter")
    assert placed(building) == 1 or "curved_road_1" in parts(building)
    building.wait_until(lambda: placed(building) == 0)
    assert "curved_road_1" in building.value("store.shownScene.value.map_scene.parts")
    events = building.page.evaluate("() => events.slice(2)")  # without those of the watches
    assert events[0] == ["Scene", 1]  # it was there before the Scene came
    assert events[1][0] == "shown"


def test_a_piece_that_is_refused_disappears_with_the_message(plane: PageServer, building: Tab) -> None:
    building.page.mouse.click(*on_screen(building, 0.0, 0.8))
    building.wait_until(lambda: building.text("build-selected").startswith("a"))
    # as if an edit of somebody else were still on its way to this page
    building.page.evaluate("() => { autodrive.store.scene.value.map_scene.parts.a.yaw = 0.1 }")
    before = plane.simulation.undo_name
    press(building, "r")
    building.wait_for_notice("was changed by another client in the meantime")
    building.wait_until(lambda: placed(building) == 0)
    assert plane.simulation.undo_name == before


def test_nothing_is_drawn_while_time_stands_and_nothing_changes(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1000, 640), draws=True, script=COUNT).open(plane.url + "?quality=low")
    tab.wait_for_image()
    plane.request(Pause())
    tab.click("build-button")
    tab.wait_until(lambda: tab.get("build-bar").is_visible())

    def is_still() -> bool:
        """Whether ten frames of the browser pass without an image."""
        drawn, frames = tab.page.evaluate("() => [drawn, autodrive.store.imageCount.value]")
        tab.wait_until(lambda: tab.value("store.imageCount.value") >= frames + 10)
        return tab.page.evaluate("() => drawn") == drawn

    tab.page.mouse.move(500, 400)
    tab.wait_until(is_still)
    for change in (
        lambda: tab.page.mouse.wheel(0, 100),  # over the scene
        lambda: plane.request(EditMap({"a": MapModule("straight_road", 0.0, 0.8)})),
        lambda: tab.page.evaluate("() => { autodrive.store.areAxesShown.value = true }"),
        lambda: tab.page.evaluate("() => autodrive.view.lookAt(11.7, 33.3)"),  # where the camera is rounded
    ):
        before = tab.page.evaluate("() => drawn")
        change()
        tab.wait_until(lambda before=before: tab.page.evaluate("() => drawn") > before)
        tab.wait_until(is_still)
    press(tab, "z")
    tab.wait_until(lambda: tab.get("build-bar").is_hidden())
    assert not is_still()  # outside of Build mode each frame is drawn


def test_with_quality_stream_the_page_draws_the_map_itself_while_it_is_built(
    plane: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(1000, 640)).open(plane.url + "?quality=stream")
    jpeg = simplejpeg.encode_jpeg(np.zeros((36, 64, 3), np.uint8), colorspace="RGB")
    # as if an image of the simulator had come
    send = "jpeg => { autodrive.store.rendered.value = { time: 0, jpeg: Uint8Array.from(jpeg) } }"
    image = tab.page.locator("#scene + canvas")
    tab.wait_until(lambda: tab.value("!!view"))
    tab.wait_until(lambda: tab.page.evaluate(send, [*jpeg]) or image.is_visible())
    begin(tab)
    tab.page.evaluate(send, [*jpeg])
    assert tab.value("store.isStreamPaused.value")
    assert not image.is_visible()
    tab.click("build-done")
    tab.wait_until(lambda: tab.page.evaluate(send, [*jpeg]) or image.is_visible())
