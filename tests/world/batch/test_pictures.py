"""The rows of a batch are shown as the Frames of single Worlds are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive.base.errors import CommandError
from autodrive.graphics.render.render_state import HEADER, OBJECT, VEHICLE, RenderState
from autodrive.physics.actuators.lights import LAMPS
from autodrive.protocol.messages import Headlights
from autodrive.scenario import ScenarioSpec
from autodrive.world.batch import BatchWorld
from tests.support.pictures import SCENARIO, random_pictures

HIGH_BEAMS = ["high_beam_left", "high_beam_right"]


@pytest.mark.parametrize(("part", "dtype"), [("header", HEADER), ("vehicles", VEHICLE), ("objects", OBJECT)])
def test_all_that_a_picture_depends_on_has_the_bits_of_the_frames_of_single_worlds(part: str, dtype: np.dtype) -> None:
    """Over 200 random states, in which each field has several values."""
    of_batch, of_worlds = (getattr(states, part) for states in random_pictures())
    assert len(of_batch) == 200
    for name in dtype.names or ():
        assert np.array_equal(of_batch[name], of_worlds[name], equal_nan=True), name
        assert len(np.unique(of_batch[name].reshape(200, -1), axis=0)) > 1, name


def test_the_random_states_show_each_light() -> None:
    """Else the test above could pass with lamps that are never lit."""
    states, _ = random_pictures()
    assert {*states.header["traffic_lights"][:, :4].ravel().tolist()} >= {1.0, 2.0, 3.0}
    lit = states.vehicles["lamps"].max(axis=(0, 1))
    assert [name for name, level in zip(LAMPS, lit, strict=True) if level == 0.0] == HIGH_BEAMS
    assert {*states.header["is_day"].tolist()} == {0.0, 1.0}


def test_at_the_start_by_night_the_traffic_has_its_headlights_on() -> None:
    scenario = SCENARIO.model_copy(update={"scene_light": False})
    picture = BatchWorld(scenario, 1).pictures()
    assert np.array_equal(picture.data[0], RenderState.of(autodrive.make(scenario).frame).data, equal_nan=True)
    assert picture.vehicles["lamps"][0, :, 0].tolist() == [0.0, 0.0, 1.0, 1.0]


def test_lamps_and_light_can_be_chosen_for_a_batch() -> None:
    batch = BatchWorld(ScenarioSpec(map="mini_map", time_of_day=79200.0), 2)
    assert batch.pictures().header["is_day"].tolist() == [0.0, 0.0]
    assert batch.pictures().header["time_of_day"].tolist() == [79200.0, 79200.0]
    day = batch.pictures(is_day=True, headlights=Headlights.HIGH)
    assert day.header["is_day"].tolist() == [1.0, 1.0]
    assert np.isnan(day.header["time_of_day"]).all()
    assert day.vehicles["lamps"][0, 0, :4].tolist() == [1.0] * 4
    unchecked: Any = 7
    with pytest.raises(CommandError, match="headlights of vehicle 'V1'"):
        batch.pictures(headlights=unchecked)
    with pytest.raises(CommandError, match="is_day must be True or False, not 7"):
        batch.pictures(is_day=unchecked)
