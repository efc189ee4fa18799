"""The parts of a mesh: each triangle is in one of them, and a view gets those in sight, the nearest first."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.meshes.store import vehicle
from autodrive.graphics.render.parts import Parts
from autodrive.graphics.render.renderer import clip_from_optical
from autodrive.graphics.render.scene import Geometry, Skeleton, geometry, rigid
from autodrive.physics.sensors.camera.view import View
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.scenes import pinhole

AHEAD = (0.5, -0.5, 0.5, -0.5)
"""Optical frame of a camera that looks along x."""


@pytest.fixture(scope="module")
def car() -> tuple[Geometry, np.ndarray]:
    """Triangles of a car, and its bones at rest."""
    asset: Asset = vehicle(load_vehicle("roboracer"))
    skeleton = Skeleton(asset)
    layers = {name: ("textures", i) for i, name in enumerate(asset.textures)}
    signals = dict.fromkeys({node.joint.signal for node in asset.nodes if node.joint}, 0.0)
    return geometry(asset, skeleton, "reduced", layers, is_whole=True), skeleton.pose(np.eye(4), signals)


def clip_at(x: float) -> np.ndarray:
    """Clip space from map axes for a camera on the x axis that looks along it."""
    view = View((x, 0.0, 0.05), AHEAD, pinhole(), near=0.01, far=10.0)
    return clip_from_optical(view) @ np.linalg.inv(rigid(view.position, view.orientation))


@pytest.mark.parametrize("size", [0.06, math.inf])
def test_each_triangle_is_in_one_part_and_inside_its_sphere(car: tuple[Geometry, np.ndarray], size: float) -> None:
    own, _ = car
    parts = Parts.of(own, size)
    everything = parts.indices_of(np.arange(len(parts.first))).reshape(-1, 3)
    assert sorted(map(tuple, everything.tolist())) == sorted(map(tuple, own.indices.reshape(-1, 3).tolist()))
    for number in range(len(parts.first)):
        indices = parts.indices_of(np.array([number]))
        vertices = own.vertices[indices]
        r = own.ranges[parts.range[number]]
        assert np.isin(indices, own.indices[r.first : r.first + r.length]).all()
        assert (vertices["bone_lamp"][:, 0] == parts.bone[number]).all()
        away = np.linalg.norm(vertices["position"] - parts.center[number], axis=1)
        assert away.max() <= parts.radius[number] + 1e-6


def test_a_view_gets_what_is_in_sight_the_nearest_first(car: tuple[Geometry, np.ndarray]) -> None:
    own, bones = car
    parts = Parts.of(own, 0.06)
    points = np.einsum("nij,nj->ni", bones[parts.bone, :3, :3], parts.center) + bones[parts.bone, :3, 3]
    behind, within, beyond = (parts.in_sight(clip_at(x), bones) for x in (-2.0, 0.1, 2.0))
    assert sorted(behind.tolist()) == list(range(len(parts.first)))  # the whole car is in front of the camera
    assert (np.diff(points[behind, 0]) >= -1e-9).all()
    assert 0 < len(within) < len(behind)
    assert (points[within, 0] > 0.1 - parts.radius[within]).all()
    assert len(beyond) == 0


def test_parts_move_with_their_bones(car: tuple[Geometry, np.ndarray]) -> None:
    own, bones = car
    parts = Parts.of(own, 0.06)
    away = rigid((5.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    assert len(parts.in_sight(clip_at(2.0), away @ bones)) == len(parts.first)


def test_a_mesh_without_triangles_has_no_parts() -> None:
    empty = geometry(Asset("nothing", ()), Skeleton(Asset("nothing", ())), "reduced", {})
    parts = Parts.of(empty, math.inf)
    assert len(parts.first) == 0
    assert len(parts.in_sight(clip_at(0.0))) == 0
