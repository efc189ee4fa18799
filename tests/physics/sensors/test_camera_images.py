"""Rendered images of complete cameras agree with the published pose and intrinsics, with and without distortion."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely

from autodrive.base.transforms import quaternion_from_yaw, rotation_from_quaternion
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.sensors.camera import project, rays
from autodrive.physics.sensors.camera.camera import Camera, CameraSpec, world_from_camera
from autodrive.physics.sensors.camera.imperfections import PRESETS, CameraImperfections
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.messages import CameraImage, CameraIntrinsics
from tests.support.scenes import BLACK, WHITE, ground, needs_gl, node, render_state, scene

pytestmark = [needs_gl, pytest.mark.slow]

MARKER = (0.75, -0.10, 0.95, 0.15)
"""A white rectangle on black ground: x and y of two corners [m]."""


def spec_of(imperfections: CameraImperfections) -> CameraSpec:
    return CameraSpec(
        mount=Mount(position=(0.186, 0.0, 0.112), rotation_deg=(0.0, 7.294, 0.0)),
        width=640,
        height=480,
        field_of_view_deg=41.669,
        depth=True,
        labels=True,
        imperfections=imperfections,
    )


def photograph(imperfections: CameraImperfections, at: RenderState) -> CameraImage:
    camera = Camera(spec_of(imperfections), vehicle="V1", name="front", substep=Fraction(1, 1000))
    x0, y0, x1, y1 = MARKER
    around = [
        ground(-50, -50, x0, 50, BLACK),
        ground(x1, -50, 50, 50, BLACK),
        ground(x0, -50, x1, y0, BLACK),
        ground(x0, y1, x1, 50, BLACK),
    ]
    floor = node("floor", ground(*MARKER, WHITE), *around, casts=False)
    row = at.vehicles[0]
    with Renderer(scene(floor, vehicles=1), "software") as renderer:
        return camera.image_from(renderer.draw(at, camera.views(row, 0.0), depth=True, labels=True), row, 0)


def parked() -> RenderState:
    """A vehicle near the origin with a small yaw, its wheels on the ground."""
    at = render_state(vehicles=1)
    at.vehicles[0]["position"] = (0.05, 0.02, 0.0325)
    at.vehicles[0]["orientation"] = quaternion_from_yaw(0.05)
    return at


def edge() -> np.ndarray:
    """Points along the marker's edge, shape (n, 3)."""
    x0, y0, x1, y1 = MARKER
    corners = np.array([(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0), (x0, y0, 0.0)])
    share = np.linspace(0.0, 1.0, 50)[:, None]
    return np.concatenate([a + share * (b - a) for a, b in pairwise(corners)])


def seen_at(k: CameraIntrinsics, position: Any, orientation: Any, points: np.ndarray) -> np.ndarray:
    turn = np.array(rotation_from_quaternion(orientation)).reshape(3, 3)
    return project(k, (points - position) @ turn)


def assert_is_seen(image: CameraImage, outline: np.ndarray, within: float) -> None:
    """The white pixels below the sky fill that outline [pixels]."""
    polygon = shapely.Polygon(outline)
    u, v = np.meshgrid(np.arange(640) + 0.5, np.arange(480) + 0.5)
    seen = (image.rgb[..., 1] > 180) & (v > 200)  # half of the light of white
    clear = shapely.distance(polygon.exterior, shapely.points(u, v)) > within
    assert np.array_equal(seen[clear], shapely.contains_xy(polygon, u, v)[clear])
    assert seen.sum() > 5000


LENSES = {
    "ideal": (0.0, 0.0, 0.0, 0.0, 0.0),
    "raspberry_pi_v1": PRESETS["raspberry_pi_v1"].distortion,
    "barrel": (-0.3, 0.1, 0.004, -0.003, 0.0),
}


@pytest.mark.parametrize("lens", LENSES)
def test_a_marker_is_within_half_a_pixel_of_its_projection(lens: str) -> None:
    image = photograph(CameraImperfections(distortion=LENSES[lens]), parked())
    assert_is_seen(image, seen_at(image.intrinsics, image.pose.position, image.pose.orientation, edge()), within=0.5)


@pytest.mark.parametrize("lens", LENSES)
def test_rays_times_depth_are_points_on_the_ground(lens: str) -> None:
    image = photograph(CameraImperfections(distortion=LENSES[lens]), parked())
    assert image.depth is not None
    directions = rays(image.intrinsics)
    turn = np.array(rotation_from_quaternion(image.pose.orientation)).reshape(3, 3)
    near = image.depth < 2.0
    depth = image.depth[near]
    assert len(depth) > 50_000
    points = image.pose.position + (directions[near] / directions[near][:, 2:] * depth[:, None]) @ turn.T
    # with distortion, the depth is that of the nearest pixel of the ideal image, at most 0.71 pixels away
    aside = 0.0 if lens == "ideal" else 0.75 * depth / image.intrinsics.fy
    assert (np.abs(points[:, 2]) < aside + 1e-4).all()


def test_each_row_of_a_rolling_shutter_has_the_pose_of_its_time() -> None:
    readout, turning = 0.02, parked()
    turning.vehicles[0]["angular_velocity"] = (0.0, 0.0, 2.0)
    image = photograph(CameraImperfections(readout_time=readout, exposures=33), turning)
    (x, y, z), mount = turning.vehicles[0]["position"].tolist(), spec_of(CameraImperfections()).mount

    def at(time: float, point: np.ndarray) -> np.ndarray:
        pose = world_from_camera((x, y, z), quaternion_from_yaw(0.05 + 2.0 * time), mount)
        return seen_at(image.intrinsics, *pose, point[None])[0]

    outline = []
    for point in edge():
        time = 0.0
        for _ in range(3):  # fixed-point iteration: the row depends on the time, and the time on the row
            time = readout * (at(time, point)[1] / 480 - 0.5)
        outline.append(at(time, point))
    # 33 render times are 0.6 ms apart: 1.1 pixels
    assert_is_seen(image, np.array(outline), within=1.1)
    still = seen_at(image.intrinsics, image.pose.position, image.pose.orientation, edge())
    assert abs(np.array(outline) - still).max() > 4.0


def test_a_rolling_shutter_has_no_effect_at_rest() -> None:
    ideal, rolling = (photograph(CameraImperfections(readout_time=time), parked()) for time in (0.0, 0.02))
    np.testing.assert_array_equal(rolling.rgba, ideal.rgba)
