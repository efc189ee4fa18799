"""Projection of points and rays of pixels of a camera with lens distortion.

Brown-Conrady model, same as OpenCV and ROS 'plumb_bob': the lens moves a point at x, y = X / Z, Y / Z to

    x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), similarly y, with r^2 = x^2 + y^2.

Far from the axis this polynomial may decrease again and would map points outside the field of view into the image.
Points beyond its maximum are therefore not visible.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from autodrive.protocol.messages import CameraIntrinsics

if TYPE_CHECKING:
    from numpy.typing import NDArray

Distortion: TypeAlias = tuple[float, float, float, float, float]
"""k1, k2, p1, p2, k3."""

NO_DISTORTION: Distortion = (0.0, 0.0, 0.0, 0.0, 0.0)


def project(intrinsics: CameraIntrinsics, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixel coordinates, shape (n, 2), of points in the optical frame [m], shape (n, 3).

    nan behind the camera and beyond the field of view of the lens. Pixels outside the image are not clipped.
    """
    k = intrinsics
    points = np.asarray(points, np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        x, y = distorted(x, y, k.distortion)
    pixels = np.column_stack([k.cx + k.fx * x, k.cy + k.fy * y])
    pixels[points[:, 2] <= 0.0] = np.nan
    return pixels


def rays(intrinsics: CameraIntrinsics) -> NDArray[np.float64]:
    """Unit vectors through the centres of the pixels, in the optical frame, shape (height, width, 3)."""
    x, y = _grid(intrinsics)
    ahead = np.stack([x, y, np.ones_like(x)], axis=-1)
    return ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)


def distorted(
    x: NDArray[np.float64], y: NDArray[np.float64], distortion: Distortion
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distorted coordinates of ideal x, y (tangents of the angles to the axis); nan if not visible."""
    if distortion == NO_DISTORTION:
        return x, y
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    f = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    f = np.where(r2 < reach(distortion), f, np.nan)
    return x * f + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * f + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y


def undistorted(
    x: NDArray[np.float64], y: NDArray[np.float64], distortion: Distortion
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inverse of `distorted` by Newton's method; nan if there is no solution."""
    if distortion == NO_DISTORTION:
        return x, y
    u, v = x, y
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(20):
            step = _newton_step(u, v, x, y, distortion)
            if step is None:
                break
            u, v = step
        again_x, again_y = distorted(u, v, distortion)
        is_found = (again_x - x) ** 2 + (again_y - y) ** 2 < 1e-18
    return np.where(is_found, u, np.nan), np.where(is_found, v, np.nan)


def _newton_step(
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    distortion: Distortion,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """A better solution of distorted(u, v) = x, y; None if it is good enough."""
    k1, k2, p1, p2, k3 = distortion
    r2 = u * u + v * v
    f = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2)
    error_x = u * f + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u) - x
    error_y = v * f + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v - y
    if np.fmax.reduce(np.abs(error_x) + np.abs(error_y), axis=None) < 1e-13:
        return None
    xx = f + 2.0 * u * u * slope + 2.0 * p1 * v + 6.0 * p2 * u
    yy = f + 2.0 * v * v * slope + 6.0 * p1 * v + 2.0 * p2 * u
    xy = 2.0 * (u * v * slope + p1 * u + p2 * v)
    determinant = xx * yy - xy * xy
    return u - (yy * error_x - xy * error_y) / determinant, v - (xx * error_y - xy * error_x) / determinant


def reach(distortion: Distortion) -> float:
    """Maximum visible r^2, where the radial polynomial has its maximum; inf if it has none."""
    k1, k2, _, _, k3 = distortion
    turns = np.roots([1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3])  # polynomial in 1 / r^2: its first coefficient is never 0
    real = turns.real[(abs(turns.imag) < 1e-9) & (turns.real > 1e-9)]
    return 1.0 / float(real.max()) if len(real) else math.inf


def covers_whole_image(intrinsics: CameraIntrinsics) -> bool:
    """Whether every pixel has a ray; only the border pixels are tested, since the inner ones follow."""
    k = intrinsics
    across = (np.arange(k.width) + 0.5 - k.cx) / k.fx
    down = (np.arange(k.height) + 0.5 - k.cy) / k.fy
    x = np.concatenate([across, across, np.full(k.height, across[0]), np.full(k.height, across[-1])])
    y = np.concatenate([np.full(k.width, down[0]), np.full(k.width, down[-1]), down, down])
    return bool(np.isfinite(undistorted(x, y, k.distortion)[0]).all())


def least_zoom(intrinsics: CameraIntrinsics) -> float:
    """Factor of the focal length with which the lens just covers the whole image; infinity: none up to 100."""
    too_small, enough = 1.0, 100.0
    if not covers_whole_image(_zoomed(intrinsics, enough)):
        return math.inf
    while enough > 1.001 * too_small:
        middle = math.sqrt(too_small * enough)
        if covers_whole_image(_zoomed(intrinsics, middle)):
            enough = middle
        else:
            too_small = middle
    return enough


def _zoomed(k: CameraIntrinsics, factor: float) -> CameraIntrinsics:
    return CameraIntrinsics(k.width, k.height, factor * k.fx, factor * k.fy, k.cx, k.cy, k.distortion)


def ideal_pinhole(intrinsics: CameraIntrinsics) -> tuple[CameraIntrinsics, NDArray[np.float32]]:
    """An ideal camera that covers the field of view of this one, and the coordinates of this one's pixels in its image.

    Both have the same focal length in pixels. The coordinates, shape (height, width, 2), are x and y of pixel centres;
    the four neighbours for bilinear interpolation are always within the ideal image.
    """
    k = intrinsics
    x, y = _grid(k)
    left, top = math.floor(x.min() * k.fx) - 1, math.floor(y.min() * k.fy) - 1
    right, bottom = math.ceil(x.max() * k.fx) + 1, math.ceil(y.max() * k.fy) + 1
    ideal = CameraIntrinsics(right - left, bottom - top, k.fx, k.fy, float(-left), float(-top))
    places = np.stack([ideal.cx + k.fx * x - 0.5, ideal.cy + k.fy * y - 0.5], axis=-1)
    return ideal, places.astype(np.float32)


@lru_cache(maxsize=2)  # the cameras of a vehicle are often equal, and each needs the grid twice
def _grid(k: CameraIntrinsics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Undistorted x and y (tangents of the angles to the axis) of the pixel centres, shape (height, width) each."""
    grid = np.empty((2, k.height, k.width))
    grid[0] = (np.arange(k.width) + 0.5 - k.cx) / k.fx
    grid[1] = ((np.arange(k.height) + 0.5 - k.cy) / k.fy)[:, None]
    return undistorted(grid[0], grid[1], k.distortion)
