"""Lit lamps of traffic lights in the 3D view of the page."""

from __future__ import annotations

from pathlib import Path

import pytest

from autodrive.protocol.messages import SetSceneLight, SetTrafficLight, TrafficLightState
from autodrive.scenario.maps.props import LAMP_HEIGHTS
from tests.support.page import NewTab, PageServer, Tab

LIGHT, FOOT = "traffic_light_1", (0.92, -0.7)
"""A light of the map `crossing`, which looks along -x, and the place of its post [m]."""
LENS_X = FOOT[0] - 0.012
"""Of the front of its lenses [m]."""


@pytest.fixture
def before_the_light(running: PageServer, tmp_path: Path) -> PageServer:
    file = tmp_path / "light.yaml"
    file.write_text(f"map: crossing\nvehicles:\n  V1: {{type: nigel, x: {FOOT[0] - 0.12}, y: {FOOT[1] + 0.15}}}\n")
    running.restart(str(file))
    return running


def lit(tab: Tab) -> dict[str, bool]:
    """Whether each lens is far from its dark colour: bright, and red, yellow or green; of one image."""
    image, found = tab.pixels(), {}
    for color, height in LAMP_HEIGHTS.items():
        column, row = map(round, tab.value(f"view.screenPoint({LENS_X}, {FOOT[1]}, {height})"))
        red, green, blue = image[row - 1 : row + 2, column - 1 : column + 2].mean((0, 1))
        has_hue = {"red": red > 1.5 * green, "yellow": red > green > 1.5 * blue, "green": green > 1.5 * red}[color]
        found[color] = bool(max(red, green) > 0.85 and has_hue)
    return found


def test_the_lit_lamp_is_seen_by_day_and_at_night(
    before_the_light: PageServer, new_tab: NewTab, tmp_path: Path
) -> None:
    view = "scan=0&camera=orbit&orbit=180,10,0.45"  # behind the car, which stands beside the light
    tab = new_tab(size=(640, 480), draws=True).open(f"{before_the_light.url}?quality=low#{view}")
    tab.wait_for_image()
    for is_day in (True, False):
        before_the_light.request(SetSceneLight(is_day))
        for state in TrafficLightState:
            before_the_light.request(SetTrafficLight(LIGHT, state))
            expected = {color: color == state.name.lower() for color in LAMP_HEIGHTS}
            tab.wait_until(lambda expected=expected: lit(tab) == expected)
