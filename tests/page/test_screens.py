"""The page on screens of all sizes: controls can be reached and touched, text is readable, the layout is stable."""

from __future__ import annotations

import pytest

from tests.page.test_access import wrong_targets
from tests.page.test_stream import HELD_IMAGES
from tests.support.page import NewTab, PageServer, Tab, box, overlap, touch
from tests.support.waiting import free_port

FULL_HD = (1920, 1080)
MIN_TARGET = 44
"""Smallest width and height of a control on a touch screen [px] (WCAG 2.2, success criterion 2.5.5)."""
MIN_CONTRAST = 4.5
"""Smallest contrast of text (WCAG 2.2, success criterion 1.4.3)."""
MIN_TEXT = 13.0
"""Smallest size of text [px]."""

SHOW_CARDS = "() => { autodrive.store.isLogOpen.value = autodrive.store.isMapOpen.value = true }"
"""Shows the log and the small map."""

FONTS = """
window.canvasFonts = new Set()
const font = Object.getOwnPropertyDescriptor(CanvasRenderingContext2D.prototype, 'font')
Object.defineProperty(CanvasRenderingContext2D.prototype, 'font', {
    get: font.get,
    set(value) { canvasFonts.add(value); font.set.call(this, value) },
})
"""
"""Notes the fonts that are drawn on canvases."""

TEXTS = """() => {
    const canvas = Object.assign(document.createElement('canvas'), { width: 1, height: 1 })
    const pixel = canvas.getContext('2d', { willReadFrequently: true })
    const probe = document.body.appendChild(document.createElement('i'))
    const parsed = new Map()
    function parse(colour) {
        if (parsed.has(colour)) return parsed.get(colour)
        probe.style.color = colour  // computes var() and light-dark()
        pixel.clearRect(0, 0, 1, 1)
        pixel.fillStyle = getComputedStyle(probe).color
        pixel.fillRect(0, 0, 1, 1)
        const [r, g, b, a] = pixel.getImageData(0, 0, 1, 1).data
        parsed.set(colour, [r, g, b, a / 255])
        return parsed.get(colour)
    }
    const over = ([r, g, b, a], below) => [r, g, b].map((value, i) => a * value + (1 - a) * below[i])
    const linear = (value) => (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4)
    const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
    const ancestors = (element) => (element ? [element, ...ancestors(element.parentElement)] : [])
    const backgroundOf = (element, scene) =>
        ancestors(element)
            .reverse()
            .reduce((below, each) => over(parse(getComputedStyle(each).backgroundColor), below), scene)
    function contrast(element, colour) {
        const opacity = ancestors(element).reduce((all, each) => all * getComputedStyle(each).opacity, 1)
        return Math.min(...[[0, 0, 0], [255, 255, 255]].map((scene) => {  // the scene behind a panel can be anything
            const background = backgroundOf(element, scene)
            const [r, g, b, a] = parse(colour)
            const text = over([r, g, b, a * opacity], background)
            const [low, high] = [text, background].map(luminance).sort((x, y) => x - y)
            return (high + 0.05) / (low + 0.05)
        }))
    }
    const texts = []
    const add = (element, text, colour = getComputedStyle(element).color) => texts.push(
        { text, contrast: contrast(element, colour), size: parseFloat(getComputedStyle(element).fontSize) })
    const isClipped = (element) => getComputedStyle(element).clipPath.startsWith('inset(50%')
    for (const element of document.body.querySelectorAll('*')) {
        const isShown = element.checkVisibility({ visibilityProperty: true }) && element.getClientRects().length > 0
        if (!isShown || ancestors(element).some(isClipped) || element.closest('option, svg, noscript')) continue
        const own = [...element.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE)
        const text = own.map((node) => node.data).join('').trim()
        if (text) add(element, text)
        if (element.matches('input:not([type=checkbox]), select')) add(element, element.value)
        if (element.placeholder) add(element, element.placeholder, getComputedStyle(element, '::placeholder').color)
    }
    const hud = document.querySelector('#hud')
    for (const name of ['text', 'muted', 'plot-1', 'plot-2'])  // drawn on the canvases of the HUD
        texts.push({ text: name, contrast: contrast(hud, `var(--${name})`), size: 99 })
    probe.remove()
    return texts
}"""
"""All texts that are shown, with their contrast and size [px]; the worst contrast over any scene."""


@pytest.mark.parametrize(
    "size", [(390, 844), (360, 640), (844, 390), (820, 1180)], ids=lambda size: "x".join(map(str, size))
)
def test_touch_screens_reach_all_controls(plane: PageServer, new_tab: NewTab, size: tuple[int, int]) -> None:
    tab = new_tab(size=size, touch=True).open(f"{plane.url}?quality=low")
    pads = {axis: tab.get(f"pad-{axis}") for axis in ("throttle", "steering")}
    for panels, part in (
        ((), ""),
        (("menu",), "scenario"),
        (("menu",), "view"),
        (("menu",), "programs"),
        (("hud",), ""),
    ):
        tab.show(*panels, tab=part)
        assert wrong_targets(tab, MIN_TARGET) == [], (panels, part)
        for pad in pads.values():
            assert pad.is_visible()
            place = box(pad)
            assert place["left"] >= 0
            assert place["right"] <= size[0]
            assert place["bottom"] <= size[1]
            assert not any(overlap(pad, tab.get(panel)) for panel in panels)
    tab.show()
    tab.page.evaluate(SHOW_CARDS)
    assert wrong_targets(tab, MIN_TARGET) == []
    assert not any(overlap(pad, tab.get(card)) for pad in pads.values() for card in ("minimap", "log"))
    assert not overlap(tab.get("minimap"), tab.get("log"))
    tab.page.keyboard.press("Escape")
    assert not overlap(*pads.values())
    throttle, steering = (box(pads[axis]) for axis in ("throttle", "steering"))
    forward = ((throttle["left"] + throttle["right"]) / 2, throttle["top"] + 10)
    left = (steering["left"] + 10, (steering["top"] + steering["bottom"]) / 2)
    tools = tab.page.context.new_cdp_session(tab.page)
    touch(tools, "touchStart", forward, left)  # two thumbs
    tab.wait_until(lambda: plane.vehicle.throttle > 0.9 and plane.vehicle.steering > 0.3)
    touch(tools, "touchEnd")
    tab.wait_until(lambda: plane.vehicle.throttle == 0 and abs(plane.vehicle.steering) < 0.01)
    tab.click("help")
    place = box(tab.get("help-dialog"))
    assert min(place["left"], place["top"]) >= 0
    assert place["right"] <= size[0]
    assert place["bottom"] <= size[1]
    tab.click("help-close")
    assert tab.page.evaluate("() => document.documentElement.scrollWidth") <= size[0]
    for panels in ((), ("menu",), ("hud",)):
        tab.show(*panels)
        tab.page.evaluate("() => { autodrive.store.notice.value = 'A notice of a few words that is read in one go' }")
        notice = tab.page.locator(".notice").last
        assert not any(overlap(notice, other) for other in (*pads.values(), tab.get("touch-camera")))


def test_a_phone_shows_speed_buttons_and_readable_notices_and_its_help_begins_with_touch(
    two_cars: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(390, 844), touch=True).open(f"{two_cars.url}?quality=low")
    tab.show()
    place = box(tab.get("pad-throttle"))
    tools = tab.page.context.new_cdp_session(tab.page)
    touch(tools, "touchStart", ((place["left"] + place["right"]) / 2, place["top"] + 10))
    tab.wait_until(lambda: tab.text("touch-speed") not in {"", "0.00 m/s"})
    touch(tools, "touchEnd")
    tab.click("touch-camera")
    assert tab.value("store.camera.value") == "Bird's Eye"
    tab.page.evaluate("() => { autodrive.store.camera.value = 'Fly' }")
    touch(tools, "touchStart", ((place["left"] + place["right"]) / 2, place["top"] + 10))
    tab.wait_until(lambda: tab.value("store.flyInput.ahead") > 0.5)  # the pad flies, and does not drive
    touch(tools, "touchEnd")
    tab.wait_until(lambda: tab.value("store.flyInput.ahead") == 0)
    tab.click("touch-vehicle")
    assert tab.value("store.vehicle.value") == "V2"
    tab.click("touch-record")
    tab.wait_until(lambda: tab.value("store.status.value.recording.state") == "recording")
    tab.click("touch-record")
    tab.wait_for_text("recorded-text", "Recorded ")
    tab.click("recorded-close")
    tab.page.evaluate(SHOW_CARDS)  # which a panel hides
    for panel in ("menu", "hud"):
        tab.show(panel)
        tab.page.evaluate("() => { autodrive.store.notice.value = 'A notice of a few words that is read in one go' }")
        notice = box(tab.page.locator(".notice").last)
        assert notice["right"] - notice["left"] > 250
        assert notice["top"] > 400, "it covers the speed"
    tab.click("help")
    headings = tab.get("help-dialog").locator("h3").all_text_contents()
    assert headings[:2] == ["Touch", "Drive"]
    tab.click("help-close")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_text_is_large_enough_and_has_contrast(two_cars: PageServer, new_tab: NewTab, theme: str) -> None:
    saved = f"localStorage.setItem('autodrive.theme', '{theme}');"
    tab = new_tab(size=FULL_HD, script=saved + FONTS).open(f"{two_cars.url}?quality=low")
    tab.page.emulate_media(reduced_motion="reduce")
    tab.show("menu", "hud", tab="programs")

    def check() -> None:
        texts = tab.page.evaluate(TEXTS)
        assert len(texts) > 80
        assert [each for each in texts if each["contrast"] < MIN_CONTRAST or each["size"] < MIN_TEXT] == []

    tab.page.evaluate(SHOW_CARDS)
    tab.wait_until(lambda: tab.page.locator(".vehicle-labels span").count() == 2)
    check()
    tab.get("ip").fill("")
    tab.get("port").fill(str(free_port()))
    tab.click("connect")  # refused: the address is empty
    tab.wait_for_text("bridge-error", "empty")
    tab.click("menu-tab-scenario")
    tab.get("ticks").fill("0")
    tab.click("step")
    check()
    tab.click("menu-tab-view")
    check()
    tab.click("menu-tab-programs")
    tab.page.evaluate("() => { autodrive.store.notice.value = 'a notice' }")
    tab.get("ip").fill("127.0.0.1")
    tab.click("connect")
    tab.wait_for_text("bridge-error", "trying again")  # the fields are disabled now
    check()
    tab.click("disconnect")
    tab.click("programs")
    tab.get("connect-dialog").wait_for()
    check()
    tab.click("connect-close")
    tab.click("help")
    check()
    fonts = tab.page.evaluate("() => [...canvasFonts]")
    sizes = [float(word.removesuffix("px")) for font in fonts for word in font.split() if word.endswith("px")]
    assert sizes
    assert min(sizes) >= MIN_TEXT


def test_camera_images_are_visible_on_a_small_screen_without_scrolling(plane: PageServer, tab: Tab) -> None:
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    tab.show("hud")
    for side in ("front", "rear"):
        assert box(tab.get(f"hud-{side}-camera"))["bottom"] <= box(tab.get("hud"))["bottom"]


def test_the_first_camera_images_move_nothing_in_the_hud(gl: str, plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 720), script=HELD_IMAGES).open(f"{plane.url}?quality=low#hud=1")
    tab.wait_until(lambda: tab.value("store.cameraImages.size") == 2)
    place = box(tab.get("hud-polar"))
    previews = [tab.get(f"hud-{side}-camera") for side in ("front", "rear")]
    assert [preview.get_attribute("data-state") for preview in previews] == ["none", "none"]
    tab.page.evaluate("() => releaseImages()")
    tab.wait_until(lambda: all(preview.get_attribute("data-state") != "none" for preview in previews))
    assert box(tab.get("hud-polar")) == place


def test_an_error_of_the_bridge_moves_no_control(plane: PageServer, tab: Tab) -> None:
    tab.show("menu", tab="programs")
    places = {name: box(tab.get(name)) for name in ("menu-tab", "programs", "ip", "port")}

    def are_places_kept() -> bool:
        return {name: box(tab.get(name)) for name in places} == places

    tab.get("ip").fill("http://127.0.0.1")
    tab.click("connect")
    tab.wait_for_text("bridge-error", "Enter only the address")
    assert are_places_kept()
    tab.get("ip").fill("127.0.0.1")
    tab.get("port").fill(str(free_port()))
    tab.click("connect")
    tab.wait_for_text("bridge-error", "trying again")
    assert are_places_kept()
    tab.click("disconnect")
    tab.wait_for_text("bridge-status", "Disconnected")
    assert are_places_kept()
