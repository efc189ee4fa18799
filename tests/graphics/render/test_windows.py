"""Lit windows of buildings in camera pictures: by dusk, and only in the colours."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from autodrive.graphics.cameras.viewpoints import orbit
from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.protocol.labels import Label
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import load_map
from autodrive.world.factory import compile_scenario
from tests.support.scenes import needs_gl, render_state

pytestmark = needs_gl

HOUSE = next(shape for shape in load_map("tiny_town").statics if shape.material == "block")
VIEW = orbit(HOUSE.position, 1.6, 35.0, 12.0, 40.0).view(320, 240)
HOURS = 12.0, 17.3, 17.6, 23.0


@pytest.fixture(scope="module", params=["software", "gpu"])
def renderer(request: pytest.FixtureRequest) -> Iterator[Renderer]:
    with Renderer(scene_of(compile_scenario(ScenarioSpec(map="tiny_town"))), request.param) as made:
        yield made


def at(hour: float) -> RenderState:
    state = render_state(1, is_day=6.0 < hour < 18.0)
    state.vehicles["position"][0] = 50.0, 50.0, 0.0
    state.header["time_of_day"] = 3600.0 * hour
    return state


def test_more_and_more_windows_are_lit_in_the_evening(renderer: Renderer) -> None:
    lit = []
    for hour in HOURS:
        image = renderer.draw(at(hour), [VIEW], labels=True)[0]
        red, _, blue = image.rgba[image.labels == Label.BLOCK, :3].astype(float).T
        lit.append(int(np.sum((red > 180.0) & (blue < 0.68 * red))))  # as warm as no wall
    assert lit[0] == 0
    assert 0 < lit[1] < lit[2] < lit[3]


def test_depth_labels_and_instances_do_not_show_lamps_and_windows(renderer: Renderer) -> None:
    """The same bits by day and by night with lit lamps, and with a car beside the house."""
    exact = []
    for hour in HOURS:
        state = at(hour)
        state.vehicles["position"][0] = HOUSE.position[0] + 0.9, HOUSE.position[1] + 0.6, 0.05
        state.vehicles["lamps"] = float(hour > 17.0)
        exact.append(renderer.draw(state, [VIEW], depth=True, labels=True, instances=True)[0])
    for image in exact[1:]:
        for name in ("depth", "labels", "instances"):
            assert np.array_equal(getattr(image, name), getattr(exact[0], name))
