"""Overlays of the 3D view: their pixels, their keys and names, and what the page asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from autodrive.protocol.messages import Pause, Resume, Step
from tests.support.page import NewTab, PageServer, Tab

CYAN = (0.2, 0.9, 1.0)
LIME = (0.75, 1.0, 0.2)
BLUE = (0.3, 0.5, 1.0)


def pixels(tab: Tab, colour: tuple[float, float, float]) -> int:
    """How many pixels of the image are near that colour; the toolbar and the legend are left out."""
    image: Any = tab.pixels()[60:380]
    return int((np.abs(image - colour).max(axis=2) < 0.17).sum())


@pytest.mark.parametrize("quality", ["low", "stream"])
@pytest.mark.parametrize(
    ("key", "switch", "colour"),
    [("1", "shapes-switch", CYAN), ("2", "forces-switch", LIME), ("3", "axes-switch", BLUE)],
)
def test_an_overlay_is_switched_by_its_key_and_its_switch(
    plane: PageServer, new_tab: NewTab, key: str, switch: str, colour: tuple[float, float, float], quality: str
) -> None:
    tab = new_tab(draws=True).open(plane.url + f"?quality={quality}#camera=orbit&orbit=120,20,0.5&scan=0")
    plane.request(Pause())
    try:
        if quality == "stream":
            tab.wait_until(lambda: not tab.value("store.isStreamStarting.value"))
        else:
            tab.wait_for_image()
        before = pixels(tab, colour)
        tab.page.keyboard.press(key)
        if key == "2":  # forces are those of a tick
            tab.page.wait_for_timeout(300)
            plane.request(Step(1))
        tab.wait_until(lambda: pixels(tab, colour) > before + 40)
        assert tab.get("legend").is_visible()
        if key == "2":
            tab.wait_for_text("force-scale", "an arrow of 10 cm is 5 N")  # a quarter of the weight is 4.3 N
        tab.show("menu", tab="view")
        field = tab.get(switch)
        assert field.is_checked()
        assert field.get_attribute("role") == "switch"
        field.click()
        tab.show()
        tab.wait_until(lambda: pixels(tab, colour) <= before + 5)
        assert not tab.get("legend").is_visible()
        if key == "2":
            tab.wait_until(lambda: not plane.simulation.world.watches_contacts)
    finally:
        plane.request(Resume())


def test_the_link_holds_the_overlays_and_nothing_is_asked_for_without_them(plane: PageServer, new_tab: NewTab) -> None:
    tab = new_tab().open(plane.url + "?quality=low")
    assert not plane.simulation.world.watches_contacts
    assert tab.value("store.shapes.value") is None
    for key in "123":
        tab.page.keyboard.press(key)
    tab.wait_until(lambda: "shapes=1&forces=1&axes=1" in tab.page.url)
    tab.wait_until(lambda: tab.value("Object.keys(store.contacts.value).length") == 1)
    other = new_tab().open(tab.page.url)
    other.wait_until(lambda: other.value("store.shapes.value") is not None)
    assert other.get("legend").is_visible()
