"""Small scenes whose images can be computed by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.base.transforms import compose, quaternion_from_euler
from autodrive.graphics.assets.asset import Asset, AssetNode, Material, MeshSurface
from autodrive.graphics.render.gl import GlUnavailable, probe
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.scene import RenderScene
from autodrive.physics.actuators.lights import LampSpec, LightsSpec
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import CameraIntrinsics

OPTICAL = (0.5, -0.5, 0.5, -0.5)
"""Body axes (x forward) from the optical frame (z forward)."""

GREY = Material("grey", (0.4, 0.4, 0.4), roughness=0.9)
WHITE = Material("white", (0.9, 0.9, 0.9), roughness=0.9)
BLACK = Material("black", (0.0, 0.0, 0.0), roughness=1.0)


def _gl_error() -> str:
    try:
        probe()
    except GlUnavailable as error:
        return str(error)
    return ""


_GL_ERROR = _gl_error()

needs_gl = pytest.mark.skipif(bool(_GL_ERROR), reason=_GL_ERROR)
"""Skips tests that draw, with the reason, if there is no OpenGL."""


def box(
    center: tuple[float, float, float], size: tuple[float, float, float], material: Material, label: Label
) -> MeshSurface:
    """A closed box, parallel to the axes."""
    positions, normals, triangles = [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            n = sign * np.eye(3)[axis]
            start = len(positions)
            positions += [n + a * sign * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            normals += [n] * 4
            triangles += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    points = np.array(positions) * np.array(size) / 2 + center
    return MeshSurface(
        material, points.astype(np.float32), np.array(normals, np.float32), np.array(triangles, np.uint32), label
    )


def ground(
    x0: float, y0: float, x1: float, y1: float, material: Material = GREY, label: Label = Label.ROAD
) -> MeshSurface:
    """A level rectangle at height 0."""
    points = np.array([(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)], np.float32)
    return MeshSurface(
        material,
        points,
        np.tile(np.array([0, 0, 1], np.float32), (4, 1)),
        np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        label,
    )


def node(name: str, *surfaces: MeshSurface, casts: bool = True, **rest: object) -> AssetNode:
    """A node with the same surfaces at every level of detail."""
    details = ("full", "reduced", "shadow") if casts else ("full", "reduced")
    return AssetNode(name, surfaces=dict.fromkeys(details, surfaces), **rest)  # type: ignore[arg-type]


def thing(name: str, *surfaces: MeshSurface) -> Asset:
    """An asset with one node."""
    return Asset(name, (node(name, *surfaces),))


def lights() -> LightsSpec:
    """Lamps of a small car; all white."""

    def lamp(x: float) -> LampSpec:
        return LampSpec(position=(x, 0.04, 0.03), color=(1.0, 1.0, 1.0), range=10.0)

    front, rear = lamp(0.2), lamp(-0.05)
    return LightsSpec(head=front, high_beam=front, front_indicator=front, rear_indicator=rear, tail=rear, reverse=rear)


CAR = thing("car", box((0.08, 0.0, 0.05), (0.26, 0.14, 0.08), GREY, Label.VEHICLE))


def scene(*static: AssetNode, vehicles: int = 0, objects: tuple[Asset, ...] = ()) -> RenderScene:
    """A scene with that many cars."""
    return RenderScene(Asset("static", static), [CAR] * vehicles, objects, [lights()] * vehicles)


def render_state(vehicles: int = 0, objects: int = 0, *, is_day: bool = True) -> RenderState:
    """Everything at the origin and unrotated, no lamp lit."""
    made = RenderState.empty(vehicles, objects)
    made.header["is_day"] = is_day
    made.vehicles["orientation"][:, 0] = made.objects["orientation"][:, 0] = 1.0
    return made


def pinhole(width: int = 320, height: int = 240, fov_deg: float = 60.0) -> CameraIntrinsics:
    """Square pixels, centred."""
    f = height / 2 / math.tan(math.radians(fov_deg) / 2)
    return CameraIntrinsics(width, height, f, f, width / 2, height / 2)


def view(
    x: float, y: float, z: float, yaw_deg: float = 0.0, pitch_deg: float = 0.0, own: CameraIntrinsics | None = None
) -> View:
    """A view from a position along x, turned by yaw (left) and pitch (down)."""
    turn = quaternion_from_euler(0.0, math.radians(pitch_deg), math.radians(yaw_deg))
    return View((x, y, z), compose(turn, OPTICAL), own or pinhole())
