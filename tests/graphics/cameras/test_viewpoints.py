"""Viewpoints of the scene cameras, compared with geometry computed by hand."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from autodrive.base.transforms import inverse, quaternion_from_yaw, rotate
from autodrive.graphics.cameras.viewpoints import (
    GodsEye,
    Viewpoint,
    birds_eye,
    drivers_eye,
    orbit,
    scene_cameras,
)
from autodrive.physics.sensors.camera import project


def seen(viewpoint: Viewpoint, *points: tuple[float, float, float]) -> np.ndarray:
    """Pixels of points of the map in an image of 800 x 600 pixels."""
    view = viewpoint.view(800, 600)
    back = inverse(view.orientation)
    local = [rotate(back, tuple(np.subtract(point, view.position).tolist())) for point in points]
    return project(view.intrinsics, np.array(local))


def test_drivers_eye_is_behind_and_above_the_car_and_looks_over_it() -> None:
    viewpoint = drivers_eye((1.0, 2.0, 0.0325), quaternion_from_yaw(math.pi / 2))
    np.testing.assert_allclose(viewpoint.position, (1.0, 1.58, 0.26), atol=1e-12)
    # its axis meets the height of the rear axle at 0.2275 / tan 15 degrees = 0.849 m ahead of it
    np.testing.assert_allclose(seen(viewpoint, (1.0, 1.58 + 0.2275 / math.tan(math.radians(15)), 0.0325)), [[400, 300]])
    left, right = seen(viewpoint, (0.9, 2.0, 0.0), (1.1, 2.0, 0.0))
    assert left[0] < 400 < right[0]


def test_birds_eye_has_x_up_on_the_screen_and_y_to_the_left() -> None:
    viewpoint = birds_eye((1.0, -0.5, 0.03), 2.0)
    f = 300.0 / math.tan(math.radians(30.0))
    pixels = seen(viewpoint, (1.0, -0.5, 0.0), (1.4, -0.5, 0.0), (1.0, -0.1, 0.0))
    np.testing.assert_allclose(pixels, [[400, 300], [400, 300 - 0.2 * f], [400 - 0.2 * f, 300]], atol=1e-9)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "place"),
    [(0.0, 0.0, (3.0, 1.0, 0.5)), (90.0, 0.0, (1.0, 3.0, 0.5)), (0.0, 30.0, (1.0 + math.sqrt(3.0), 1.0, 1.5))],
)
def test_orbit_looks_at_its_target(azimuth: float, elevation: float, place: tuple[float, float, float]) -> None:
    viewpoint = orbit((1.0, 1.0, 0.5), 2.0, azimuth, elevation)
    np.testing.assert_allclose(viewpoint.position, place, atol=1e-12)
    centre, above = seen(viewpoint, (1.0, 1.0, 0.5), (1.0, 1.0, 0.6))
    np.testing.assert_allclose(centre, (400, 300), atol=1e-9)
    assert above[0] == pytest.approx(400, abs=1e-9)
    assert above[1] < 300


def test_gods_eye_starts_on_its_target_and_keeps_it_centred() -> None:
    eye = GodsEye(0.15)
    np.testing.assert_allclose(seen(eye.step((2.0, -1.0, 0.03), 0.0), (2.0, -1.0, 0.03)), [[400, 300]], atol=1e-9)
    viewpoint = [eye.step((-1.5, 0.7, 0.03), 0.1) for _ in range(200)][-1]
    np.testing.assert_allclose(seen(viewpoint, (-1.5, 0.7, 0.03)), [[400, 300]], atol=1e-6)
    distance = math.hypot(1.5, 0.7, 2.47)
    assert viewpoint.field_of_view_deg == pytest.approx(5.0 * math.degrees(math.atan(0.15 / distance)), rel=1e-6)


def test_gods_eye_turns_in_a_tenth_of_a_second_and_zooms_in_a_second() -> None:
    here, there = (3.0, 0.0, 2.5), (0.0, 3.0, 2.5)  # level with it: a pan of 90 degrees
    eye = GodsEye(0.15)
    eye.step(here, 0.0)
    ahead = rotate(eye.step(there, 0.1).orientation, (0.0, 0.0, 1.0))
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx((1.0 - math.exp(-1.0)) * math.pi / 2)

    def angle(distance: float) -> float:
        return 5.0 * math.degrees(math.atan(0.15 / distance))

    eye = GodsEye(0.15)
    eye.step((2.0, 0.0, 2.5), 0.0)
    expected = angle(4.0) + math.exp(-1.0) * (angle(2.0) - angle(4.0))
    assert eye.step((4.0, 0.0, 2.5), 1.0).field_of_view_deg == pytest.approx(expected)


def test_gods_eye_does_not_depend_on_the_time_step() -> None:
    whole, parts = GodsEye(0.15), GodsEye(0.15)
    for eye in (whole, parts):
        eye.step((1.0, 1.0, 0.0), 0.0)
    one = whole.step((-2.0, 1.0, 0.0), 0.3)
    other = [parts.step((-2.0, 1.0, 0.0), 0.01) for _ in range(30)][-1]
    np.testing.assert_allclose(one.orientation, other.orientation, atol=1e-12)
    assert one.field_of_view_deg == pytest.approx(other.field_of_view_deg)


def test_gods_eye_turns_the_short_way_and_accepts_a_target_straight_below() -> None:
    eye = GodsEye(0.15)
    eye.step((-1.0, 0.1, 2.5), 0.0)
    ahead = rotate(eye.step((-1.0, -0.1, 2.5), 0.05).orientation, (0.0, 0.0, 1.0))
    assert ahead[0] < -0.99
    below = eye.step((0.0, 0.0, 0.0), 10.0)
    np.testing.assert_allclose(rotate(below.orientation, (0.0, 0.0, 1.0)), (0.0, 0.0, -1.0), atol=1e-9)


def test_the_table_for_the_page_is_plain_data_in_the_order_of_the_button() -> None:
    table = scene_cameras()
    assert json.loads(json.dumps(table)) == table
    assert list(table) == ["Driver's Eye", "Bird's Eye", "God's Eye"]
