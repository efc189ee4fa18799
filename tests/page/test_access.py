"""Keyboard use, accessible names, and layout at several window sizes."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import pytest

from autodrive.protocol.messages import Pause, Resume
from tests.support.page import PageServer, Tab, box, overlap

CONTROLS = 'button, input, select, summary, textarea, a[href], [tabindex="0"]'
VISIBLE = f"""() => [...document.querySelectorAll('{CONTROLS}')]
    .filter((control) => control.checkVisibility() && !control.disabled && control.tabIndex >= 0)"""
"""The controls that can be used now."""

WRONG_TARGETS = f"""(least) => ({VISIBLE})().flatMap((control) => {{
    control.scrollIntoView({{ block: 'center' }})
    const target = (least && control.labels?.[0]) || control
    const box = target.getBoundingClientRect()
    const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2)
    const isOnTop = top && [target, control.labels?.[0]].some((one) => one?.contains(top) || top.contains(one ?? null))
    const isInside = box.left >= 0 && box.right <= innerWidth && box.top >= 0 && box.bottom <= innerHeight
    const isLarge = box.width >= least && box.height >= least
    const name = control.dataset.testid || control.getAttribute('aria-label') || control.textContent
    const found = {{ name, isOnTop, isInside, left: box.left, top: box.top, width: box.width, height: box.height }}
    return isOnTop && isInside && isLarge ? [] : [JSON.stringify(found)]
}})"""


def wrong_targets(tab: Tab, least: float = 0) -> list[str]:
    """The controls that are covered, outside of the screen or smaller than that, with their labels [px]."""
    return tab.page.evaluate(WRONG_TARGETS, least)


CARDS = ("isMapOpen", "isLogOpen")
PARTS = ("programs", "view", "scenario")
"""The tabs of the menu."""

FOCUS_STYLE = "() => { const s = getComputedStyle(document.activeElement); return [s.outlineStyle, s.boxShadow] }"


@pytest.fixture
def panels(two_cars: PageServer, tab: Tab) -> Iterator[Tab]:
    """The tab with open menu, HUD, small map and log; the simulation is paused, so that nothing is drawn anew."""
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    tab.show("menu", "hud", tab="view")
    for panel in CARDS:
        tab.page.evaluate(f"() => {{ autodrive.store.{panel}.value = true }}")
    tab.wait_until(lambda: tab.get("vehicle").is_visible())
    tab.click("menu-tab-scenario")
    two_cars.request(Pause())
    yield tab
    two_cars.request(Resume())
    for panel in CARDS:
        tab.page.evaluate(f"() => {{ autodrive.store.{panel}.value = false }}")


def test_tab_key_reaches_every_control_in_order(panels: Tab) -> None:
    page = panels.page
    count = page.evaluate(
        f"""() => {{
            window.controls = ({VISIBLE})()
            window.reached = []
            document.addEventListener('focusin', (event) => reached.push(controls.indexOf(event.target)))
            controls[0].focus()
            return controls.length
        }}"""
    )
    for _ in range(count - 1):
        page.keyboard.press("Tab")
    assert count > 25
    assert page.evaluate("() => window.reached") == list(range(count))
    panels.get("reset").focus()
    page.keyboard.press("Tab")
    outline, shadow = page.evaluate(FOCUS_STYLE)
    assert outline != "none" or shadow != "none"


def test_each_control_has_an_accessible_name(panels: Tab) -> None:
    tools = panels.page.context.new_cdp_session(panels.page)
    nodes = []
    for part in PARTS:
        panels.click(f"menu-tab-{part}")
        nodes += tools.send("Accessibility.getFullAXTree")["nodes"]
    tools.detach()
    roles = {"button", "textbox", "combobox", "checkbox", "switch", "spinbutton", "DisclosureTriangle", "dialog", "tab"}
    controls = [node for node in nodes if not node["ignored"] and node["role"]["value"] in roles]
    assert len(controls) > 25
    assert [node for node in controls if not node["name"]["value"].strip()] == []


def test_keys_press_buttons_and_open_the_help(two_cars: PageServer, panels: Tab) -> None:
    two_cars.request(Resume())
    keyboard = panels.page.keyboard
    for key in ("Enter", "Space"):
        is_day = two_cars.frame.scene_light
        panels.wait_for_text("scene-light-status", "On" if is_day else "Off")
        panels.get("scene-light").focus()
        keyboard.press(key)
        panels.wait_until(lambda is_day=is_day: two_cars.frame.scene_light != is_day)
    dialog = panels.get("help-dialog")
    for opens, closes in (("?", "Escape"), ("F1", "?")):
        keyboard.press(opens)
        dialog.wait_for(state="visible")
        keyboard.press("w")
        keyboard.press(closes)
        dialog.wait_for(state="hidden")
    assert all(vehicle.throttle == 0 for vehicle in two_cars.frame.vehicles.values())
    assert panels.get("menu").is_visible()  # Escape closed only the dialog


def test_every_control_can_be_reached_and_panels_do_not_overlap(panels: Tab) -> None:
    for width, height in ((1920, 1080), (1280, 720), (1024, 768)):
        panels.page.set_viewport_size({"width": width, "height": height})
        panels.page.evaluate("() => new Promise((done) => setTimeout(done))")
        for part in PARTS:
            panels.click(f"menu-tab-{part}")
            assert wrong_targets(panels) == [], part
        cards = {name: panels.get(name) for name in ("menu", "hud", "minimap", "log")}
        cards["toolbar"] = panels.page.locator(".toolbar")
        for (name, one), (other, another) in combinations(cards.items(), 2):
            assert not overlap(one, another), f"{name} and {other} overlap at {width} x {height}"
        assert panels.page.evaluate("() => document.documentElement.scrollWidth") <= width
        text = box(panels.get("log").locator("td").last)
        assert text["right"] - text["left"] > 170, f"the text of the log is a few words wide at {width} x {height}"
