"""Lens distortion compared with closed forms and with its inverse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autodrive.physics.sensors.camera.optics import (
    Distortion,
    covers_whole_image,
    distorted,
    ideal_pinhole,
    project,
    rays,
    reach,
    undistorted,
)
from autodrive.protocol.messages import CameraIntrinsics

RASPBERRY: Distortion = (0.03034574724223343, -0.1510961279565394, 0.005326365853523378, -0.003855361950537075, 0.0)


def pinhole(distortion: Distortion = RASPBERRY, width: int = 64, height: int = 48) -> CameraIntrinsics:
    return CameraIntrinsics(width, height, 63.0, 63.0, 0.5 * width, 0.5 * height, distortion)


def test_radial_distortion_scales_the_radius() -> None:
    x, y = distorted(np.array([0.3]), np.array([0.4]), (0.1, 0.02, 0.0, 0.0, -0.3))
    factor = 1.0 + 0.1 * 0.25 + 0.02 * 0.0625 - 0.3 * 0.015625  # r^2 = 0.25
    np.testing.assert_allclose((x[0], y[0]), (0.3 * factor, 0.4 * factor))


def test_tangential_distortion_follows_the_brown_conrady_model() -> None:
    x, y = distorted(np.array([0.3]), np.array([0.4]), (0.0, 0.0, 0.01, -0.02, 0.0))
    np.testing.assert_allclose(x[0], 0.3 + 2 * 0.01 * 0.12 - 0.02 * (0.25 + 2 * 0.09))
    np.testing.assert_allclose(y[0], 0.4 + 0.01 * (0.25 + 2 * 0.16) - 2 * 0.02 * 0.12)


small = st.floats(-0.2, 0.2)
tiny = st.floats(-0.01, 0.01)


@given(st.tuples(small, small, tiny, tiny, small), st.floats(-0.45, 0.45), st.floats(-0.35, 0.35))
def test_undistorted_is_the_inverse_of_distorted(distortion: Distortion, x: float, y: float) -> None:
    moved = distorted(np.array([x]), np.array([y]), distortion)
    np.testing.assert_allclose(np.ravel(undistorted(*moved, distortion)), (x, y), atol=1e-9)


def test_points_on_rays_project_to_their_pixels() -> None:
    k = pinhole()
    directions = rays(k)
    assert directions.shape == (48, 64, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1.0)
    across, down = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    centres = np.column_stack([across.ravel(), down.ravel()])
    np.testing.assert_allclose(project(k, 3.0 * directions.reshape(-1, 3)), centres, atol=1e-6)


def test_points_beyond_the_maximum_of_the_polynomial_have_no_pixel() -> None:
    # r (1 - 0.3 r^2) has its maximum at r = 1 / sqrt(0.9); r = 1.8 would be mapped to 0.05, inside the image
    assert reach((-0.3, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(1.0 / 0.9)
    k = pinhole((-0.3, 0.0, 0.0, 0.0, 0.0))
    pixels = project(k, np.array([[1.0, 0.0, 1.0], [1.8, 0.0, 1.0], [5.0, 5.0, 1.0]]))
    np.testing.assert_allclose(pixels[0], (32.0 + 63.0 * 0.7, 24.0))
    assert np.isnan(pixels[1:]).all()
    assert reach((0.1, 0.0, 0.0, 0.0, 0.0)) == math.inf


def test_a_lens_with_dark_corners_does_not_cover_the_image() -> None:
    assert covers_whole_image(pinhole())
    assert not covers_whole_image(pinhole((-0.9, 0.0, 0.0, 0.0, 0.0)))  # the largest distorted radius is 0.406


@pytest.mark.parametrize("k1", [-0.25, 0.3])
def test_the_ideal_image_contains_all_pixels_of_the_distorted_one(k1: float) -> None:
    k = pinhole((k1, 0.0, 0.004, -0.003, 0.0))
    ideal, places = ideal_pinhole(k)
    assert (places >= 0.0).all()
    assert (places[..., 0] <= ideal.width - 1).all()
    assert (places[..., 1] <= ideal.height - 1).all()
    # barrel distortion has a larger field of view than the ideal lens, pincushion a smaller one
    assert (ideal.width > k.width) == (k1 < 0.0)
    # the same direction in both images
    seen = project(ideal, 2.0 * rays(k).reshape(-1, 3)).reshape(48, 64, 2)
    np.testing.assert_allclose(seen - 0.5, places, atol=1e-4)
