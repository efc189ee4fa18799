"""Lit lamps of traffic lights in camera pictures, against the tone curve of their emission."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

import autodrive
from autodrive.graphics.cameras.viewpoints import orbit
from autodrive.graphics.meshes.map_solids import LENSES
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.look import DAY, NIGHT
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.messages import TrafficLightState
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.props import HOUSING_DEPTH, LAMP_HEIGHTS
from autodrive.world.factory import compile_scenario
from tests.support.scenes import needs_gl, render_state

pytestmark = needs_gl

STATES = {"red": TrafficLightState.RED, "yellow": TrafficLightState.YELLOW, "green": TrafficLightState.GREEN}
NUMBER = 2
"""Of the traffic light that is looked at, from 0."""
DISTANCE = 0.4


@pytest.fixture(scope="module", params=["software", "gpu"])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    with Renderer(scene_of(compile_scenario(ScenarioSpec(map="crossing"))), request.param) as made:
        yield made


def before_the_light() -> View:
    """The lenses are in the middle column, the yellow one in the middle of the image."""
    name = load_map("crossing").traffic_lights[NUMBER]
    x, y, yaw = next(prop.pose for prop in load_map("crossing").props if prop.name == name)
    ahead = HOUSING_DEPTH / 2.0
    target = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw), LAMP_HEIGHTS["yellow"]
    return orbit(target, DISTANCE, math.degrees(yaw), 0.0, 30.0).view(320, 240)


def showing(state: TrafficLightState, *, is_day: bool) -> RenderState:
    made = render_state(1, is_day=is_day)
    made.header["traffic_lights"][NUMBER] = state
    return made


def lens_colors(renderer: Renderer, state: RenderState) -> dict[str, np.ndarray]:
    """Mean colour of the pixels in the middle of each lens, 0 to 255."""
    look = before_the_light()
    image = renderer.draw(state, [look])[0].rgba[..., :3].astype(float)
    rows = {
        c: round(120 - look.intrinsics.fy * (h - LAMP_HEIGHTS["yellow"]) / DISTANCE) for c, h in LAMP_HEIGHTS.items()
    }
    return {color: image[row - 1 : row + 2, 158:162].mean((0, 1)) for color, row in rows.items()}


def toned(light: np.ndarray) -> np.ndarray:
    """Khronos PBR Neutral without its toe, and the transfer function of sRGB (IEC 61966-2-1), 0 to 255."""
    peak, start = light.max(), 0.76
    if peak >= start:
        d = 1.0 - start
        bright = 1.0 - d * d / (peak + d - start)
        grey = 1.0 - 1.0 / (0.15 * (peak - bright) + 1.0)
        light = light * (bright / peak) * (1.0 - grey) + bright * grey
    return 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("color", LAMP_HEIGHTS)
def test_the_lit_lens_has_the_colour_of_its_emission_at_night_and_the_others_are_dark(
    renderer: Renderer, color: str
) -> None:
    seen = lens_colors(renderer, showing(STATES[color], is_day=False))
    # moonlight and the approximation of the transfer function: a few levels
    assert seen[color] == pytest.approx(toned(np.array(LENSES[color].emission) * NIGHT.glow), abs=8.0)
    assert all(seen[other].max() < 80.0 for other in LAMP_HEIGHTS if other != color)


@pytest.mark.parametrize("color", LAMP_HEIGHTS)
def test_by_day_the_lit_lens_is_brighter_than_its_emission_and_the_others_as_before(
    renderer: Renderer, color: str
) -> None:
    dark = lens_colors(renderer, showing(TrafficLightState.OFF, is_day=True))
    seen = lens_colors(renderer, showing(STATES[color], is_day=True))
    assert (seen[color] > toned(np.array(LENSES[color].emission) * DAY.glow) - 8.0).all()
    assert np.abs(seen[color] - dark[color]).max() > 60.0
    for other in LAMP_HEIGHTS:
        if other != color:
            assert (seen[other] == dark[other]).all()


@pytest.mark.parametrize("is_day", [True, False])
def test_depth_and_labels_are_those_of_a_dark_light(renderer: Renderer, is_day: bool) -> None:
    dark, lit = (
        renderer.draw(showing(state, is_day=is_day), [before_the_light()], depth=True, labels=True)[0]
        for state in (TrafficLightState.OFF, TrafficLightState.GREEN)
    )
    assert dark.depth is not None
    assert lit.labels is not None
    assert (dark.depth == lit.depth).all()
    assert (dark.labels == lit.labels).all()
    assert (dark.rgba != lit.rgba).any()


def test_pictures_show_what_the_lights_of_the_frame_show(renderer: Renderer) -> None:
    """Flashing at night: on in the first half of each second, off in the second."""
    fields = {"map": "crossing", "time_of_day": "23:30", "tick": 0.1, "substep": 0.005}
    world = autodrive.make(ScenarioSpec.model_validate(fields))
    frame, shown = world.frame, []
    for _ in range(20):
        lens = lens_colors(renderer, RenderState.of(frame))["yellow"]
        shown.append(bool(lens[0] > 200.0))
        frame = world.step()
    assert shown == 2 * [*5 * [True], *5 * [False]]
