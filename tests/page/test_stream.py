"""Images that the simulator renders for the page: what is shown until the first one, and after the last one."""

from __future__ import annotations

from autodrive.protocol.messages import SetSceneLight
from tests.page.test_load import NO_WEBGL
from tests.support.page import NewTab, PageServer, Tab

HELD_IMAGES = """
const decode = window.createImageBitmap.bind(window)
let release
const held = new Promise((done) => { release = done })
window.releaseImages = () => release()
window.createImageBitmap = async (image, ...more) => {
    if (more.length === 0) await held  // textures have options
    return decode(image, ...more)
}
"""
"""Images of the simulator arrive, and are shown only after `releaseImages()`."""


def brightness(tab: Tab) -> float:
    """Mean brightness of the scene below the notes, 0 to 1."""
    return float(tab.pixels()[160:400].mean())


def test_the_page_says_that_the_first_image_takes_time(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(640, 480), script=NO_WEBGL + HELD_IMAGES, expects="WebGL").open(plane.url)
    tab.wait_until(lambda: tab.value("store.rendered.value !== null"))
    assert tab.get("stream-note").is_visible()
    assert "first image takes some seconds" in tab.text("stream-note")
    tab.page.evaluate("() => releaseImages()")
    tab.get("stream-note").wait_for(state="hidden")
    tab.wait_until(lambda: tab.pixels()[100:-20].std() > 0.03)


def test_the_view_is_never_frozen_when_the_quality_changes_to_stream_and_back(
    plane: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(640, 480), draws=True, script=HELD_IMAGES).open(f"{plane.url}?quality=low")
    tab.wait_for_image()
    day = brightness(tab)
    tab.page.evaluate("() => { autodrive.store.quality.value = 'stream' }")
    tab.wait_until(lambda: tab.value("store.rendered.value !== null"))
    assert tab.get("stream-note").is_visible()
    plane.request(SetSceneLight(False))
    tab.wait_until(lambda: brightness(tab) < 0.6 * day)  # the page still draws
    plane.request(SetSceneLight(True))
    tab.wait_until(lambda: brightness(tab) > 0.8 * day)
    tab.page.evaluate("() => releaseImages()")
    tab.get("stream-note").wait_for(state="hidden")
    plane.request(SetSceneLight(False))
    tab.wait_until(lambda: brightness(tab) < 0.6 * day)  # images of the simulator
    tab.page.evaluate("() => { autodrive.store.quality.value = 'low' }")
    plane.request(SetSceneLight(True))
    tab.wait_until(lambda: brightness(tab) > 0.8 * day)  # the page draws again
