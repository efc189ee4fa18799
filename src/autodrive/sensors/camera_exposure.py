"""From ideal pictures to what a sensor reports: light is gathered over time, counted in electrons, and written as sRGB.

Sums are of light: sRGB values are undone first. The renderer's tone curve is not, so that a lamp and white paper, both
white in a picture, count as equally bright.
"""

from __future__ import annotations

from functools import cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from autodrive.jit import jit
from autodrive.protocol.messages import CameraIntrinsics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.sensors.camera_imperfections import CameraImperfections

_STEPS = 1 << 14
"""Of light from black to white when it is written as sRGB: a fifth of a value apart at the dark end."""


def shutter(spec: CameraImperfections, height: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """Times at which to draw [s], about the picture's own time, and what share each has in each row.

    Shapes (n,) and (n, height); n is odd, the middle time is 0. A row sees the mean over its own exposure of what
    changes linearly from one time to the next; the middle of the picture is exposed about the picture's time.
    """
    if spec.duration == 0.0:
        return np.zeros(1), np.ones((1, height), np.float32)
    n = spec.exposures
    times = spec.duration * (np.arange(n) / (n - 1) - 0.5)
    # mean of the tent about each time over each row's exposure: difference of the tent's integral
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
    """Of max(1 - |x|, 0), from -inf to x."""
    x = np.clip(x, -1.0, 1.0)
    return np.where(x < 0.0, 0.5 * (1.0 + x) ** 2, 1.0 - 0.5 * (1.0 - x) ** 2)


def lens_shading(spec: CameraImperfections, rays: NDArray[np.float64]) -> NDArray[np.float32]:
    """What the light of each pixel is multiplied by, shape (height, width), given the pixels' rays."""
    return (2.0**spec.exposure * rays[..., 2] ** (4.0 * spec.vignetting)).astype(np.float32)


class Exposure:
    """Gathers the light of one picture."""

    def __init__(self, intrinsics: CameraIntrinsics, places: NDArray[np.float32] | None) -> None:
        """`places`: where each pixel is in the ideal pictures, if the lens distorts."""
        self._places = places
        self._light = np.zeros((intrinsics.height, intrinsics.width, 3), np.float32)

    def begin(self) -> None:
        """Close the shutter on black."""
        self._light[:] = 0.0

    def add(self, rgba: NDArray[np.uint8], shares: NDArray[np.float32]) -> None:
        """Let in an ideal picture's light, in each row a share of it, shape (height,)."""
        if self._places is None:
            _add(rgba, shares, _LIGHT, self._light)
        else:
            _add_bent(rgba, self._places, shares, _LIGHT, self._light)

    def read(
        self, shading: NDArray[np.float32], white_electrons: float, read_noise: float, rng: np.random.Generator
    ) -> NDArray[np.uint8]:
        """The picture, shape (height, width, 4)."""
        height, width, _ = self._light.shape
        out = np.empty((height, width, 4), np.uint8)
        is_noisy = white_electrons > 0.0
        chances = np.frombuffer(rng.bytes(6 * height * width), np.uint16) if is_noisy else np.empty(0, np.uint16)
        normals = _normals() if is_noisy else np.empty(0, np.float32)
        white, read_variance = np.float32(white_electrons), np.float32(read_noise * read_noise)
        _read(self._light, shading, white, read_variance, chances, normals, _VALUE, out)
        return out


def _light_of_values() -> NDArray[np.float32]:
    """IEC 61966-2-1: light of each sRGB value."""
    value = np.arange(256) / 255.0
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _values_of_light() -> NDArray[np.uint8]:
    """IEC 61966-2-1: sRGB value of each of the `_STEPS` + 1 steps of light."""
    light = np.arange(_STEPS + 1) / _STEPS
    value = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * value).astype(np.uint8)


@cache
def _normals() -> NDArray[np.float32]:
    """2^16 numbers that are equally likely, together of the standard normal distribution, up to 4.3.

    A look at one of them costs a tenth of what drawing a number does, and a picture needs a million.
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
def _add_bent(
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
    chances: NDArray[np.uint16],
    normals: NDArray[np.float32],
    value_of: NDArray[np.uint8],
    out: NDArray[np.uint8],
) -> None:
    steps = np.float32(len(value_of) - 1)
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    chance = 0
    for y in range(light.shape[0]):
        for x in range(light.shape[1]):
            for c in range(3):
                share = light[y, x, c] * shading[y, x]
                if white > zero:  # shot noise: as many electrons as their variance
                    deviation = np.sqrt(white * share + read_variance)
                    share += deviation * normals[chances[chance]] / white
                    chance += 1
                out[y, x, c] = value_of[np.int64(min(max(share, zero), one) * steps + half)]
            out[y, x, 3] = 255
