"""Exposure model of a camera: integrates light over time, adds shot and read noise, and converts to sRGB.

Light is summed in linear units: sRGB values are decoded first. The tone curve of the renderer is not inverted, so that
a lamp and white paper, both white in an image, have the same brightness.
"""

from __future__ import annotations

from functools import cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from autodrive.base.elementary import exp, log
from autodrive.base.jit import jit
from autodrive.protocol.messages import CameraIntrinsics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.physics.sensors.camera.imperfections import CameraImperfections

_STEPS = 1 << 14
"""Number of steps of linear light in the sRGB table; in the dark part one step is a fifth of an sRGB value."""


def shutter(spec: CameraImperfections, height: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Render times [s] relative to the time of the image, and their weights in each row.

    Shapes (n,) and (n, height); n is odd, the middle time is 0. Each row is the mean over its own exposure; light is
    interpolated linearly between render times. The exposure of the middle row is centred at the time of the image.
    """
    if spec.duration == 0.0:
        return np.zeros(1), np.ones((1, height), np.float32)
    n = spec.exposures
    times = spec.duration * (np.arange(n) / (n - 1) - 0.5)
    # mean of the hat function at each time over the exposure of each row: difference of its integral
    gap = times[1] - times[0]
    middle = spec.readout_time * ((np.arange(height) + 0.5) / height - 0.5)
    if spec.exposure_time > 1e-3 * gap:
        ends = [
            _tent_integral((middle + sign * 0.5 * spec.exposure_time - times[:, None]) / gap) for sign in (1.0, -1.0)
        ]
        shares = gap * (ends[0] - ends[1]) / spec.exposure_time
    else:
        shares = np.clip(1.0 - np.abs(middle - times[:, None]) / gap, 0.0, None)
    shares[shares < 1e-6] = 0.0
    return times, (shares / shares.sum(axis=0)).astype(np.float32)


def _tent_integral(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral of max(1 - |x|, 0) from -inf to x."""
    x = np.clip(x, -1.0, 1.0)
    return np.where(x < 0.0, 0.5 * (1.0 + x) ** 2, 1.0 - 0.5 * (1.0 - x) ** 2)


def lens_shading(spec: CameraImperfections, rays: NDArray[np.float64]) -> NDArray[np.float32]:
    """Factor of the light of each pixel, shape (height, width), given the rays of the pixels."""
    shading = np.empty(rays.shape[:2], np.float32)
    _shade(rays, spec.exposure * log(2.0), 4.0 * spec.vignetting, shading)
    return shading


@jit
def _shade(rays: NDArray[np.float64], exposure: float, power: float, shading: NDArray[np.float32]) -> None:
    for y in range(shading.shape[0]):
        for x in range(shading.shape[1]):
            shading[y, x] = exp(exposure + power * log(rays[y, x, 2]))


class Exposure:
    """Integrates the light of one image."""

    def __init__(self, intrinsics: CameraIntrinsics, places: NDArray[np.float32] | None) -> None:
        """`places`: coordinates of each pixel in the ideal images; None without distortion."""
        self._places = places
        self._light = np.zeros((intrinsics.height, intrinsics.width, 3), np.float32)

    def begin(self) -> None:
        """Start a new image."""
        self._light[:] = 0.0

    def add(self, rgba: NDArray[np.uint8], shares: NDArray[np.float32]) -> None:
        """Add the light of an ideal image, multiplied by the weight of each row, shape (height,)."""
        if self._places is None:
            _add(rgba, shares, _LIGHT, self._light)
        else:
            _add_distorted(rgba, self._places, shares, _LIGHT, self._light)

    def read(
        self, shading: NDArray[np.float32], white_electrons: float, read_noise: float, rng: np.random.Generator
    ) -> NDArray[np.uint8]:
        """The sRGB image, shape (height, width, 4)."""
        height, width, _ = self._light.shape
        out = np.empty((height, width, 4), np.uint8)
        is_noisy = white_electrons > 0.0
        indices = np.frombuffer(rng.bytes(6 * height * width), np.uint16) if is_noisy else np.empty(0, np.uint16)
        normals = _normals() if is_noisy else np.empty(0, np.float32)
        white, read_variance = np.float32(white_electrons), np.float32(read_noise * read_noise)
        _read(self._light, shading, white, read_variance, indices, normals, _VALUE, out)
        return out


def _light_of_values() -> NDArray[np.float32]:
    """Linear light of each sRGB value."""
    return np.array([_light(value) for value in range(256)], np.float32)


def _values_of_light() -> NDArray[np.uint8]:
    """SRGB value of each of the `_STEPS` + 1 steps of linear light: how many values begin at or below it."""
    begins = [_light(value - 0.5) for value in range(1, 256)]
    return np.searchsorted(begins, np.arange(_STEPS + 1) / _STEPS, side="right").astype(np.uint8)


def _light(value: float) -> float:
    """Linear light of an sRGB value in [0, 255] (IEC 61966-2-1)."""
    value /= 255.0
    return value / 12.92 if value <= 0.04045 else exp(2.4 * log((value + 0.055) / 1.055))


@cache
def _normals() -> NDArray[np.float32]:
    """Quantiles of the standard normal distribution at 2^16 equidistant probabilities; the largest is 4.3.

    A table look-up takes a tenth of the time of drawing a normal number, and an image needs a million numbers.
    """
    upper = [NormalDist().inv_cdf(0.5 + (i + 0.5) / 65536) for i in range(32768)]
    both = np.concatenate([-np.array(upper), np.array(upper)])
    return (both / both.std()).astype(np.float32)


_LIGHT, _VALUE = _light_of_values(), _values_of_light()


@jit
def _add(
    rgba: NDArray[np.uint8], shares: NDArray[np.float32], light_of: NDArray[np.float32], light: NDArray[np.float32]
) -> None:
    for y in range(light.shape[0]):
        share = shares[y]
        if share != 0.0:
            for x in range(light.shape[1]):
                for c in range(3):
                    light[y, x, c] += share * light_of[rgba[y, x, c]]


@jit
def _add_distorted(
    rgba: NDArray[np.uint8],
    places: NDArray[np.float32],
    shares: NDArray[np.float32],
    light_of: NDArray[np.float32],
    light: NDArray[np.float32],
) -> None:
    for y in range(light.shape[0]):
        share = shares[y]
        if share == 0.0:
            continue
        for x in range(light.shape[1]):
            left, top = np.int64(places[y, x, 0]), np.int64(places[y, x, 1])
            across, down = places[y, x, 0] - np.float32(left), places[y, x, 1] - np.float32(top)
            for c in range(3):
                a, b = light_of[rgba[top, left, c]], light_of[rgba[top, left + 1, c]]
                d, e = light_of[rgba[top + 1, left, c]], light_of[rgba[top + 1, left + 1, c]]
                upper, lower = a + across * (b - a), d + across * (e - d)
                light[y, x, c] += share * (upper + down * (lower - upper))


@jit
def _read(
    light: NDArray[np.float32],
    shading: NDArray[np.float32],
    white: np.float32,
    read_variance: np.float32,
    indices: NDArray[np.uint16],
    normals: NDArray[np.float32],
    value_of: NDArray[np.uint8],
    out: NDArray[np.uint8],
) -> None:
    steps = np.float32(len(value_of) - 1)
    zero, full, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    index = 0
    for y in range(light.shape[0]):
        for x in range(light.shape[1]):
            for c in range(3):
                share = light[y, x, c] * shading[y, x]
                if white > zero:  # shot noise: the variance equals the number of electrons
                    deviation = np.sqrt(white * share + read_variance)
                    share += deviation * normals[indices[index]] / white
                    index += 1
                out[y, x, c] = value_of[np.int64(min(max(share, zero), full) * steps + half)]
            out[y, x, 3] = 255
