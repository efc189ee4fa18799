"""What programs draw, in the 3D view of the page: the pixels of a point, a path and a text; lifetime; the switch."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray

from autodrive.protocol.messages import Draw, Drawing, Pause, Reset, Resume, Step
from tests.support.page import NewTab, PageServer, Tab

MAGENTA = (1.0, 0.0, 1.0, 1.0)


def magenta(tab: Tab) -> int:
    """How many pixels of the page have the colour that only the drawings have."""
    return int((np.abs(tab.pixels() - MAGENTA[:3]).max(axis=2) < 0.25).sum())


def magenta_box(tab: Tab) -> NDArray[np.int64]:
    """First and last row and column of those pixels."""
    rows, columns = np.nonzero(np.abs(tab.pixels() - MAGENTA[:3]).max(axis=2) < 0.25)
    return np.array([rows.min(), rows.max(), columns.min(), columns.max()]) if len(rows) else np.full(4, 10**6)


@pytest.mark.parametrize("kind", ["points", "path", "lines", "text"])
def test_drawings_are_seen_until_they_disappear_and_can_be_hidden(
    kind: str, plane: PageServer, new_tab: NewTab
) -> None:
    plane.request(Pause())
    try:
        x, y, _ = plane.vehicle.pose.position.tolist()
        above = [(x + 0.8, y + 0.05 * side, 0.25) for side in ((0,) if kind == "text" else (-1, 1))]
        shape = {"kind": kind, "points": tuple(above), "text": "HHHH" if kind == "text" else ""}
        drawing = Drawing(**shape, color=MAGENTA, size=0.1, lifetime=0.2)
        tab = new_tab(draws=True).open(plane.url + "?quality=low")
        tab.show()
        tab.wait_for_image()
        assert magenta(tab) == 0
        plane.request(Draw({"it": drawing}))
        tab.wait_until(lambda: magenta(tab) > 100)  # also in a pause
        tab.page.evaluate("() => (autodrive.store.areDrawingsShown.value = false)")
        tab.wait_until(lambda: magenta(tab) == 0)
        tab.wait_until(lambda: "drawings=0" in tab.page.url)
        tab.page.evaluate("() => (autodrive.store.areDrawingsShown.value = true)")
        tab.wait_until(lambda: magenta(tab) > 100)
        plane.request(Step(1 + round(0.2 / plane.simulation.world.tick_duration)))
        tab.wait_until(lambda: magenta(tab) == 0)
        assert tab.value("store.drawings.size") == 0
    finally:
        plane.request(Resume())
        plane.request(Reset())


@pytest.mark.parametrize("kind", ["points", "path", "text"])
def test_drawings_are_in_the_images_of_the_simulator(
    kind: Literal["points", "path", "text"], plane: PageServer, new_tab: NewTab
) -> None:
    plane.request(Pause())
    try:
        x, y, _ = plane.vehicle.pose.position.tolist()
        above = [(x + 0.8, y + 0.05 * side, 0.25) for side in ((0,) if kind == "text" else (-1, 1))]
        drawing = Drawing(kind, tuple(above), "HHHH" if kind == "text" else "", color=MAGENTA, size=0.1)
        tab = new_tab(draws=True).open(plane.url + "?quality=low")
        tab.show()
        plane.request(Draw({"it": drawing}))
        tab.wait_until(lambda: magenta(tab) > 100)
        drawn = magenta_box(tab)
        tab.page.evaluate("() => (autodrive.store.quality.value = 'stream')")
        tab.wait_until(lambda: tab.value("view.stats().profile") == "stream")
        tab.wait_until(lambda: not tab.value("store.isStreamStarting.value"))
        # at the same place; a text has other letters, and its image is cut at other edges
        tab.wait_until(lambda: magenta(tab) > 100 and np.abs(magenta_box(tab) - drawn).max() < 12)
        below = tuple((x, y, z - 1.0) for x, y, z in above)
        plane.request(Draw({"it": replace(drawing, points=below)}))
        tab.wait_until(lambda: magenta(tab) == 0)  # the ground hides it, also in a pause
        plane.request(Draw({"it": drawing}))
        tab.wait_until(lambda: magenta(tab) > 100)
        tab.page.evaluate("() => (autodrive.store.areDrawingsShown.value = false)")
        tab.wait_until(lambda: magenta(tab) == 0)
    finally:
        plane.request(Resume())
        plane.request(Reset())
