"""Small generated textures (asphalt, grass ...) that tile without a seam and are always the same.

sRGB, shape (512, 512, 3), designed by eye. Noise is shaped in the frequency domain, where it is periodic.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.base.transforms import Vector

SIZE = 512
"""Width and height [pixels]."""


@cache
def texture(name: str) -> NDArray[np.uint8]:
    """The texture of that name, one of `NAMES`; read-only."""
    pixels = np.clip(np.round(_MAKERS[name]()), 0, 255).astype(np.uint8)
    pixels.flags.writeable = False
    return pixels


def noise(seed: int, low: float, high: float) -> Floats:
    """Periodic noise with mean 0, deviation 1 and waves of `low` to `high` periods a tile; shape (512, 512)."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((SIZE, SIZE), np.float32))
    waves = np.hypot(np.fft.fftfreq(SIZE, 1.0 / SIZE)[:, None], np.fft.rfftfreq(SIZE, 1.0 / SIZE))
    field = np.fft.irfft2(spectrum * (np.exp(-((waves / high) ** 2)) - np.exp(-((waves / low) ** 2))), s=(SIZE, SIZE))
    return np.asarray(field / field.std(), np.float64)


def _shades(color: Vector, *layers: tuple[Floats, Vector]) -> Floats:
    """A colour plus patterns, each with its change of colour per unit."""
    return sum((field[..., None] * np.array(change) for field, change in layers), np.array(color))  # pyright: ignore[reportReturnType]


def _grass() -> Floats:
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    mown = np.tanh(6.0 * np.sin(2.0 * np.pi * 2.0 * (x + y)))  # diagonal stripes, two in each direction of a tile
    blades = noise(11, 70, 330)
    return _shades((99, 114, 70), (mown, (4.5, 5, 3)), (blades, (10, 11, 7)), (noise(12, 4, 22), (4.5, 2.4, 1.6)))


def _asphalt() -> Floats:
    grain, stones = noise(1, 90, 400), np.maximum(noise(2, 60, 170) - 1.6, 0.0)
    return _shades((61, 62, 65), (grain, (6, 6, 6)), (stones, (17, 17, 16)), (noise(3, 3, 14), (1.6, 1.6, 1.7)))


def _cardboard() -> Floats:
    y = np.arange(SIZE) / SIZE
    flutes = np.sin(2.0 * np.pi * 128 * y)[None, :] * np.ones((SIZE, 1))
    fibres = noise(61, 50, 300)
    return _shades((186, 146, 100), (flutes, (1.5, 1.4, 1.1)), (fibres, (4, 4, 3.4)), (noise(62, 2, 12), (3, 2.6, 2.2)))


def _clouds() -> Floats:
    """Noise for the shape of clouds: heaps (red) and streaks (green). Squared linear values are spread evenly."""
    heaps = np.sum([noise(70 + k, 2.0**k, 2.0 ** (k + 1)) / 1.7**k for k in range(1, 7)], axis=0)
    streaks = np.sum([noise(80 + k, 2.0**k, 2.0 ** (k + 1)) / 1.5**k for k in range(1, 6)], axis=0)
    channels = [_spread_evenly(heaps), _spread_evenly(streaks), np.zeros((SIZE, SIZE))]
    linear = np.stack(channels, axis=-1) ** 2
    return 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def _spread_evenly(field: Floats) -> Floats:
    """The ranks of the values, from 0 to 1."""
    ranks = np.empty(field.size)
    ranks[np.argsort(field, axis=None, kind="stable")] = np.linspace(0.0, 1.0, field.size)
    return ranks.reshape(field.shape)


def _speckled(color: Vector, *layers: tuple[int, float, float, Vector]) -> Callable[[], Floats]:
    """A colour with layers of noise: the arguments of `noise`, and the change of colour per unit."""
    return lambda: _shades(color, *((noise(seed, low, high), change) for seed, low, high, change in layers))


_MAKERS: dict[str, Callable[[], Floats]] = {
    "asphalt": _asphalt,
    "grass": _grass,
    "floor": _speckled((163, 161, 155), (21, 100, 400, (2.6, 2.6, 2.6)), (22, 2, 9, (2.2, 2.2, 2.3))),
    "kerb": _speckled((166, 164, 157), (31, 90, 380, (7, 7, 7)), (32, 6, 40, (3, 3, 3))),
    "pavement": _speckled((137, 134, 128), (41, 100, 400, (7, 7, 7)), (42, 4, 26, (3, 3, 2.6))),
    "plaster": _speckled((205, 200, 190), (51, 60, 300, (2.5, 2.5, 2.5)), (52, 3, 16, (2.0, 2.0, 2.2))),
    "cardboard": _cardboard,
    "clouds": _clouds,
}
NAMES = tuple(_MAKERS)
