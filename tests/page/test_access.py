"""The page can be used with the keyboard alone, is named for those who hear it, and fits small screens."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.page.conftest import visits_with
from tests.page.visits import Served, Visit

CONTROLS = "button, input, select, summary, textarea, a[href]"
OPEN = f"""() => [...document.querySelectorAll('{CONTROLS}')]
    .filter((one) => one.checkVisibility() && !one.disabled && one.tabIndex >= 0)"""


@pytest.fixture(scope="module")
def tab(served: Served, browser: Browser) -> Iterator[Visit]:
    served.renew("two_cars")
    with visits_with(browser) as visitor:
        yield visitor().go(served.url + "?quality=low")


@pytest.fixture
def visit(two_cars: Served, tab: Visit) -> Visit:
    """One for all, with menu and HUD open."""
    tab.page.set_viewport_size({"width": 1280, "height": 720})
    tab.until(lambda: tab.knows("store.scene.value.scenario") == "two_cars")
    for panel in ("menu", "hud"):
        tab.until(lambda panel=panel: tab.get(panel).count() == 1)
        if not tab.get(panel).is_visible():
            tab.press(f"{panel}-button")
        tab.get(panel).wait_for(state="visible")
    tab.until(lambda: tab.get("vehicle").is_visible())
    return tab


def test_tab_reaches_every_control_in_the_order_of_the_page(visit: Visit) -> None:
    visit.page.evaluate("() => document.activeElement?.blur()")
    visit.page.evaluate(f"() => {{ window.controls = ({OPEN})() }}")
    count = visit.page.evaluate("() => window.controls.length")
    reached = []
    visit.page.evaluate("() => window.controls[0].focus()")
    for _ in range(count):
        reached.append(visit.page.evaluate("() => window.controls.indexOf(document.activeElement)"))
        visit.page.keyboard.press("Tab")
    assert count > 25
    assert reached == list(range(count))


def test_focus_can_be_seen(visit: Visit) -> None:
    visit.get("reset").focus()
    visit.page.keyboard.press("Tab")
    looks = "() => { const its = getComputedStyle(document.activeElement); return [its.outlineStyle, its.boxShadow] }"
    outline, shadow = visit.page.evaluate(looks)
    assert outline != "none" or shadow != "none"


def test_each_control_has_a_name_that_can_be_read_out(visit: Visit) -> None:
    tools = visit.page.context.new_cdp_session(visit.page)
    nodes = tools.send("Accessibility.getFullAXTree")["nodes"]
    roles = {"button", "textbox", "combobox", "checkbox", "switch", "spinbutton", "DisclosureTriangle", "dialog"}
    controls = [node for node in nodes if not node["ignored"] and node["role"]["value"] in roles]
    assert len(controls) > 25
    assert [node for node in controls if not node["name"]["value"].strip()] == []


def test_buttons_are_pressed_with_the_keyboard(two_cars: Served, visit: Visit) -> None:
    for key in ("Enter", "Space"):
        is_day = two_cars.frame.scene_light
        visit.until_text("scene-light-status", "On" if is_day else "Off")  # what the page switches from
        visit.get("scene-light").focus()
        visit.page.keyboard.press(key)
        visit.until(lambda is_day=is_day: two_cars.frame.scene_light != is_day)


def test_help_opens_and_closes_and_keys_drive_nothing_meanwhile(two_cars: Served, visit: Visit) -> None:
    help_ = visit.get("help-dialog")
    for opens, closes in (("?", "Escape"), ("F1", "?")):
        visit.page.keyboard.press(opens)
        help_.wait_for(state="visible")
        visit.page.keyboard.press("w")
        visit.page.keyboard.press(closes)
        help_.wait_for(state="hidden")
    visit.press("help")
    help_.wait_for(state="visible")
    visit.press("help-close")
    help_.wait_for(state="hidden")
    assert all(vehicle.throttle == 0 for vehicle in two_cars.frame.vehicles.values())
    assert visit.get("menu").is_visible()  # Escape closed one thing


@pytest.mark.parametrize("size", [(1920, 1080), (1280, 720), (1024, 768)])
def test_every_control_can_be_reached_and_no_panel_covers_another(visit: Visit, size: tuple[int, int]) -> None:
    width, height = size
    visit.page.set_viewport_size({"width": width, "height": height})
    visit.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
    hidden = visit.page.evaluate(
        f"""() => ({OPEN})().filter((one) => {{
            one.scrollIntoView({{ block: 'center' }})
            const box = one.getBoundingClientRect()
            const [x, y] = [box.x + box.width / 2, box.y + box.height / 2]
            const top = document.elementFromPoint(x, y)
            const isThere = top && (one.contains(top) || top.contains(one) || one.labels?.[0]?.contains(top))
            return !(isThere && box.left >= 0 && box.right <= innerWidth && box.top >= 0 && box.bottom <= innerHeight)
        }}).map((one) => one.outerHTML.slice(0, 120))"""
    )
    assert hidden == []
    panels: dict[str, Any] = {name: visit.get(name).bounding_box() for name in ("menu", "hud")}
    panels["toolbar"] = visit.page.locator(".toolbar").bounding_box()
    for (name, a), (other, b) in combinations(panels.items(), 2):
        is_apart = (
            a["x"] + a["width"] <= b["x"]
            or b["x"] + b["width"] <= a["x"]
            or a["y"] + a["height"] <= b["y"]
            or b["y"] + b["height"] <= a["y"]
        )
        assert is_apart, f"{name} and {other} overlap"
    assert visit.page.evaluate("() => document.documentElement.scrollWidth") <= width
