"""What programs draw, in the 3D view of the page: the pixels of a point, a path and a text; lifetime; the switch."""

from __future__ import annotations

import numpy as np
import pytest

from autodrive.protocol.messages import Draw, Drawing, Pause, Reset, Resume, Step
from tests.support.page import NewTab, PageServer, Tab

MAGENTA = (1.0, 0.0, 1.0, 1.0)


def magenta(tab: Tab) -> int:
    """How many pixels of the page have the colour that only the drawings have."""
    return int((np.abs(tab.pixels() - MAGENTA[:3]).max(axis=2) < 0.25).sum())


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
