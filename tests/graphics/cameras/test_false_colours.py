"""Colours of depth and labels, and the views of sensor cameras that they are made of."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import AutodriveError
from autodrive.graphics.cameras.false_colours import TURBO, depth_colours, label_colours
from autodrive.graphics.cameras.rig import CameraArray
from autodrive.graphics.cameras.scene_camera import check_sensor, sensor_view
from autodrive.graphics.render.render_state import RenderState
from autodrive.protocol.labels import COLOURS, Label
from autodrive.protocol.native import ViewSensor
from autodrive.world.views.cameras import camera_rig

PAGE = Path(__file__).parents[3] / "web" / "src" / "scene" / "turbo.ts"


def rgb(colour: str) -> list[int]:
    return list(bytes.fromhex(colour[1:]))


def test_depth_goes_through_turbo_and_is_black_without_a_surface() -> None:
    depth = np.array([[0.0, 2.5, 5.0, 9.0, np.inf]], np.float32)
    colours = depth_colours(depth, 5.0)
    assert colours.shape == (1, 5, 4)
    assert colours[0, 0].tolist() == [*rgb(TURBO[0]), 255]
    np.testing.assert_allclose(colours[0, 1, :3], rgb(TURBO[7]), atol=2)  # the middle of 15 samples
    assert colours[0, 2, :3].tolist() == colours[0, 3, :3].tolist() == rgb(TURBO[-1])
    assert colours[0, 4].tolist() == [0, 0, 0, 255]


def test_the_page_has_the_same_colours() -> None:
    assert tuple(re.findall(r"#[0-9a-f]{6}", PAGE.read_text())) == TURBO


def test_each_label_has_a_colour_of_its_own() -> None:
    assert COLOURS.keys() == set(Label)
    assert len(set(COLOURS.values())) == len(Label)
    colours = label_colours(np.array([list(Label)], np.uint8))
    assert [row[:3].tolist() for row in colours[0]] == [rgb(COLOURS[label]) for label in Label]
    assert label_colours(np.array([[255]], np.uint8))[0, 0].tolist() == [0, 0, 0, 255]


def test_the_view_is_that_of_the_camera_at_another_size() -> None:
    world = autodrive.make("mini_map")
    rig = camera_rig(world.compiled)
    number = [slot.camera for slot in rig.slots].index("front")
    view = sensor_view(ViewSensor("front", width=160), rig.slots[number], world.frame)
    state = RenderState.of(world.frame)
    (own,) = CameraArray(rig).cameras[number].views(state.vehicles[0], 0.0)
    np.testing.assert_allclose(view.position, own.position, atol=1e-12)
    np.testing.assert_allclose(view.orientation, own.orientation, atol=1e-12)
    share = 160 / own.intrinsics.width
    assert (view.intrinsics.width, view.intrinsics.height) == (160, round(share * own.intrinsics.height))
    assert view.intrinsics.fx == pytest.approx(share * own.intrinsics.fx)
    large = sensor_view(ViewSensor("front", width=9999), rig.slots[number], world.frame)
    assert large.intrinsics.width == own.intrinsics.width


@pytest.mark.parametrize(
    ("view", "expected"),
    [
        (ViewSensor("frnt"), "Did you mean 'front'"),
        (ViewSensor("front", "V9"), "camera 'front' of 'V9' is not on"),
        (ViewSensor("front", farthest=float("nan")), "farthest of a ViewSensor must be 0.01 to 1e6 m, not nan"),
        (ViewSensor("front", width=-5), "16 pixels or more, not -5"),
    ],
)
def test_a_wrong_view_is_refused(view: ViewSensor, expected: str) -> None:
    slots = camera_rig(autodrive.make("plane").compiled).slots
    with pytest.raises(AutodriveError, match=re.escape(expected)):
        check_sensor(view, slots)
