"""Pinhole, pose and schedule of cameras, compared with independent computations."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.transforms import quaternion_from_euler, rotate
from autodrive.graphics.render.render_state import VEHICLE
from autodrive.physics.sensors.camera import project
from autodrive.physics.sensors.camera.camera import Camera, CameraSpec, world_from_camera
from autodrive.physics.sensors.camera.view import RenderedImage
from autodrive.physics.sensors.sensor import Mount
from autodrive.scenario.vehicles.spec import load_vehicle

MILLISECOND = Fraction(1, 1000)


def spec(**changes: Any) -> CameraSpec:
    return CameraSpec(**{"mount": Mount(), "width": 640, "height": 480, "field_of_view_deg": 41.669, **changes})


def row(position: Any = (0.0, 0.0, 0.0), yaw: float = 0.0) -> np.void:
    vehicle = np.zeros(1, VEHICLE)[0]
    vehicle["position"], vehicle["orientation"] = position, quaternion_from_euler(0.0, 0.0, yaw)
    return vehicle


# -- the pinhole ------------------------------------------------------------------------------------------------


def test_nigel_has_the_vertical_field_of_view_of_table_8_and_square_pixels() -> None:
    k = load_vehicle("nigel").cameras["front"].intrinsics
    # half of the image, 240 pixels, is half of 41.669 degrees
    assert math.degrees(math.atan2(240.0, k.fy)) == pytest.approx(20.8345, abs=1e-9)
    assert k.fx == k.fy == pytest.approx(630.66026, abs=1e-3)
    # the width of the sensor of table 8 gives 55.15 degrees; square pixels and 4:3 give 53.81
    assert 2.0 * math.degrees(math.atan2(320.0, k.fx)) == pytest.approx(53.81, abs=0.01)


def test_nigel_2023_has_the_intrinsics_of_the_later_build() -> None:
    k = load_vehicle("nigel_2023").cameras["rear"].intrinsics
    assert (k.cx, k.cy) == (640.0, 360.0)
    assert k.fx == k.fy == pytest.approx(1057.4, abs=0.05)  # from the scene file of that build
    assert 2.0 * math.degrees(math.atan2(640.0, k.fx)) == pytest.approx(62.37, abs=0.01)
    assert 2.0 * math.degrees(math.atan2(360.0, k.fy)) == pytest.approx(37.60, abs=0.01)


def test_fit_sensor_uses_width_and_height_of_the_sensor() -> None:
    k = spec(fit="sensor", focal_length=0.0036, sensor_size=(0.00376, 0.00274)).intrinsics
    assert k.fx == pytest.approx(640 * 3.6 / 3.76)
    assert k.fy == pytest.approx(480 * 3.6 / 2.74)


def test_the_matrix_of_a_resized_image_is_that_of_the_same_camera_with_that_size() -> None:
    full = spec(width=640, height=480).intrinsics
    assert full.resized(320, 240) == spec(width=320, height=240).intrinsics
    # the middle of an image of 320 pixels is between those with the numbers 159 and 160
    np.testing.assert_array_equal(full.resized(320, 240).matrix[:, 2], [159.5, 119.5, 1.0])


# -- pose -------------------------------------------------------------------------------------------------------


def test_optical_frame_is_right_down_forward() -> None:
    _, orientation = world_from_camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), Mount())
    np.testing.assert_allclose(rotate(orientation, (0.0, 0.0, 1.0)), (1.0, 0.0, 0.0), atol=1e-15)  # forward: x
    np.testing.assert_allclose(rotate(orientation, (1.0, 0.0, 0.0)), (0.0, -1.0, 0.0), atol=1e-15)  # right: -y
    np.testing.assert_allclose(rotate(orientation, (0.0, 1.0, 0.0)), (0.0, 0.0, -1.0), atol=1e-15)  # down: -z


def test_cameras_of_nigel_point_forward_and_backward_down_to_the_road() -> None:
    cameras = load_vehicle("nigel").cameras
    for name, sign, x in (("front", 1.0, 0.186), ("rear", -1.0, -0.026)):
        position, orientation = world_from_camera((0.0, 0.0, 0.0325), (1.0, 0.0, 0.0, 0.0), cameras[name].mount)
        np.testing.assert_allclose(position, (x, 0.0, 0.14465), atol=1e-12)
        ahead = rotate(orientation, (0.0, 0.0, 1.0))
        # the axis hits the road 0.14465 / tan(7.294 degrees) = 1.130 m away
        np.testing.assert_allclose(ahead, (sign * 0.991907, 0.0, -0.126961), atol=1e-5)


def homogeneous(roll: float, pitch: float, yaw: float, position: Any) -> np.ndarray:
    """Homogeneous 4 x 4 matrix with R = Rz Ry Rx."""
    (sr, sp, sy), (cr, cp, cy) = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rz @ ry @ rx, position
    return matrix


angles = st.floats(-1.4, 1.4)
places = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(places, st.tuples(angles, angles, angles), places, st.tuples(angles, angles, angles))
def test_projection_agrees_with_homogeneous_matrices(position: Any, attitude: Any, mounted: Any, turned: Any) -> None:
    camera = spec(mount=Mount(position=mounted, rotation_deg=tuple(np.degrees(turned).tolist())))
    place, orientation = world_from_camera(position, quaternion_from_euler(*attitude), camera.mount)
    pose = homogeneous(*attitude, position=position) @ homogeneous(*turned, position=mounted)
    points = np.array([[2.0, 0.3, -0.2, 1.0], [1.0, -0.4, 0.3, 1.0], [5.0, 0.0, 0.0, 1.0]])  # x ahead of the mount
    in_map = (points @ pose.T)[:, :3]
    # transform to the optical frame by the published pose
    w, x, y, z = orientation
    seen = np.array([rotate((w, -x, -y, -z), p - place) for p in in_map])
    expected = [[320.0 - 630.66026 * y / x, 240.0 - 630.66026 * z / x] for x, y, z, _ in points]
    np.testing.assert_allclose(project(camera.intrinsics, seen), expected, atol=1e-3)


def test_points_behind_the_camera_have_no_pixel() -> None:
    pixels = project(spec().intrinsics, np.array([[0.0, 0.0, -1.0], [0.1, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(pixels[:2]).all()
    np.testing.assert_allclose(pixels[2], (320.0, 240.0))


# -- schedule and readings --------------------------------------------------------------------------------------


def test_images_are_due_at_the_first_tick_at_or_after_their_time() -> None:
    camera = Camera(spec(rate=30.0), vehicle="V1", name="front", substep=MILLISECOND)
    due = []
    for now in range(0, 1000, 10):
        if camera.is_due(now):
            due.append(now)
            camera.image_from([picture()], row(), now)
    assert due == [math.ceil(Fraction(n * 100, 30)) * 10 for n in range(30)]


def test_without_a_rate_each_tick_has_an_image() -> None:
    camera = Camera(spec(), vehicle="V1", name="front", substep=MILLISECOND)
    for now in (0, 10, 20):
        assert camera.is_due(now)
        camera.image_from([picture()], row(), now)


def picture() -> RenderedImage:
    shape = (480, 640)
    depth = np.full(shape, 2.0, np.float32)
    return RenderedImage(np.full((*shape, 4), 255, np.uint8), depth, np.ones(shape, np.uint8))


def test_an_ideal_camera_returns_the_rendered_image_with_its_time_and_pose() -> None:
    camera = Camera(spec(depth=True), vehicle="V1", name="front", substep=MILLISECOND)
    (view,) = camera.views(row((1.0, 2.0, 0.0), yaw=0.5), 0.12)
    drawn = picture()
    image = camera.image_from([drawn], row((1.0, 2.0, 0.0), yaw=0.5), 120)
    assert image.rgba is drawn.rgba
    assert image.depth is drawn.depth
    assert image.labels is None  # not configured
    assert image.time == 0.12
    assert image.rgb.shape == (480, 640, 3)
    np.testing.assert_array_equal(image.pose.position, view.position)
    np.testing.assert_array_equal(image.pose.orientation, view.orientation)
    assert image.intrinsics == view.intrinsics == camera.intrinsics


def test_a_restored_camera_continues_its_schedule() -> None:
    camera = Camera(spec(rate=10.0), vehicle="V1", name="front", substep=MILLISECOND)
    camera.image_from([picture()], row(), 100)
    saved = camera.save()
    camera.reset(0)
    assert camera.is_due(150)
    camera.restore(saved)
    assert not camera.is_due(150)
    assert camera.is_due(200)
