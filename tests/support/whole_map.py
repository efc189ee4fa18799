"""The reference for the slots of the engine: an engine that MuJoCo has compiled with all fixed shapes of the map."""

# pyright: reportAttributeAccessIssue=false
# (mujoco has no type information)

from typing import Any
from unittest import mock

import mujoco
import numpy as np

import autodrive
from autodrive.physics import engine
from autodrive.physics.model import ShapeTable
from autodrive.physics.near import Slots
from autodrive.scenario import ScenarioSpec
from autodrive.world import World


def whole_map_world(spec: ScenarioSpec, **arguments: Any) -> World:
    """A world whose engine contains the whole map: no fixed shape ever moves in it."""
    with mock.patch.object(engine, "with_slots", _with_all), mock.patch.object(engine, "fill", _leave):
        world = autodrive.make(spec, **arguments)
    c = world.compiled
    fixed = slice(1, 1 + c.model.shapes.n_fixed)
    rotation = c.engine.data.geom_xmat[fixed]
    np.testing.assert_allclose(rotation, c.model.shapes.rotation[: c.model.shapes.n_fixed], rtol=0.0, atol=1e-15)
    rotation[:] = c.model.shapes.rotation[: c.model.shapes.n_fixed]  # MuJoCo rounds otherwise when it makes the matrix
    world.reset()
    return world


def _with_all(spec: mujoco.MjSpec, fixed: ShapeTable) -> mujoco.MjModel:
    floor, static = spec.worldbody.first_geom(), spec.find_default("static")
    for s in range(len(fixed.kind)):
        geom = spec.worldbody.add_geom(static, type=int(fixed.kind[s]), size=fixed.size[s], pos=fixed.position[s])
        mujoco.mju_mat2Quat(geom.quat, fixed.rotation[s])
        geom.friction = floor.friction
    return spec.compile()


def _leave(fixed: ShapeTable, qpos: Any, slots: Slots) -> None:
    """In place of `fill`: each shape has its geom, and no body is ever far from where it was."""
    slots.solid[:] = np.arange(len(slots.solid))
    slots.filled_at[:] = np.nan
