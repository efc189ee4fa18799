"""Hints name the keys of the user's keyboard: five layouts, and a browser that does not tell the layout.

The tables of the layouts are those of X.Org (xkeyboard-config: us, fr, de, us(dvorak), ru).
"""

from __future__ import annotations

import re

from tests.support.page import NewTab, PageServer, Tab

ROWS = ("QWERTYUIOP", "ASDFGHJKL", "ZXCVBNM")
LAYOUTS = {
    "us": ("qwertyuiop", "asdfghjkl", "zxcvbnm"),
    "fr": ("azertyuiop", "qsdfghjkl", "wxcvbn,"),
    "de": ("qwertzuiop", "asdfghjkl", "yxcvbnm"),
    "dvorak": ("',.pyfgcrl", "aoeuidhtn", ";qjkxbm"),
    "ru": ("йцукенгшщз", "фывапролд", "ячсмить"),
}
CODES = [f"Key{letter}" for row in ROWS for letter in row]

FAKE = """
window.layout = null
const getLayoutMap = async () => new Map(Object.entries(window.layout))
Object.defineProperty(navigator, 'keyboard', { get: () => (window.layout ? { getLayoutMap } : undefined) })
"""
NAMED = r"\((?:key )?([^\s()]+)(?:: one tick)?\)$|^Key (.+)$"
"""What a tooltip calls its key."""
STATES = """() => Object.fromEntries([...document.querySelectorAll('[data-testid][title]')].map((element) =>
    [element.dataset.testid, [element.title,
        element.getAttribute('aria-expanded') ?? element.getAttribute('aria-pressed')
        ?? (element.type === 'checkbox' ? String(element.checked) : null)]]))"""
CAPS = """() => [...document.querySelectorAll('.help-body section')]
    .filter((section) => /^(Drive|Lamps|View|Simulation|Fly camera)$/.test(section.querySelector('h3').textContent))
    .flatMap((section) => [...section.querySelectorAll('kbd')].map((cap) => cap.textContent))"""


def press(tab: Tab, code: str, key: str) -> None:
    for type_ in ("keydown", "keyup"):
        tab.page.evaluate(
            "([type, code, key]) => document.body.dispatchEvent(new KeyboardEvent(type, {code, key, bubbles: true}))",
            [type_, code, key],
        )


def test_the_key_that_a_tooltip_names_does_what_it_says(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab(size=(1280, 800), script=FAKE).open(plane.url + "?quality=low")
    for name, rows in LAYOUTS.items():
        layout = dict(zip(CODES, "".join(rows), strict=True))
        tab.page.evaluate("(layout) => { window.layout = layout; window.dispatchEvent(new Event('focus')) }", layout)
        tab.wait_until(
            lambda layout=layout: f"({layout['KeyM'].upper()})" in (tab.get("menu-button").get_attribute("title") or "")
        )
        codes = {cap.upper(): code for code, cap in layout.items()}
        tried = []
        for testid in tab.page.evaluate(STATES):
            title, state = tab.page.evaluate(STATES)[testid]
            named = re.search(NAMED, title)
            cap = named and (named[1] or named[2])
            if state is None or cap not in codes or testid == "full-screen":
                continue
            press(tab, codes[cap], cap.lower())
            assert tab.page.evaluate(STATES)[testid][1] not in {state, None}, (name, testid, title)
            press(tab, codes[cap], cap.lower())
            if testid in {"edit-button", "build-button"}:
                tab.wait_until(lambda testid=testid: tab.get(testid).get_attribute("aria-expanded") == "false")
            tried.append(testid)
        assert len(tried) >= 9, (name, tried)
        caps = set(tab.page.evaluate(CAPS))
        assert {layout[f"Key{letter}"].upper() for letter in "WASDGHLRECBMUOQTXYFIJZKVPN"} <= caps, name
        assert {"1", "2", "3", "+", "-", "↑", "Esc"} <= caps
        assert not {cap for cap in caps if len(cap) == 1 and cap.isalpha()} - {cap.upper() for cap in layout.values()}


def test_without_a_layout_the_caps_are_learnt_from_the_keys_that_are_pressed(
    plane: PageServer, new_tab: NewTab
) -> None:
    tab = new_tab(size=(640, 480), script=FAKE).open(plane.url + "?quality=low")
    tab.click("help")
    note = tab.page.locator(".help .by-position")
    assert note.is_visible()
    assert tab.get("build-button").get_attribute("title") == "Build (Z by position)"
    press(tab, "KeyZ", "w")  # AZERTY
    assert tab.get("build-button").get_attribute("title") == "Build (W)"
    press(tab, "KeyW", "z")
    assert not note.is_visible()
    drive = tab.page.locator(".help section").filter(has_text="Drive forward").first
    assert drive.locator("kbd").first.text_content() == "Z"
