"""Colours for depth and labels, for people."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autodrive.protocol.labels import COLOURS, Label

TURBO = (
    *("#30123b", "#4145ab", "#4675ed", "#39a2fc", "#1bcfd4", "#24eca6", "#61fc6c", "#a4fc3b"),
    *("#d1e834", "#f3c63a", "#fe9b2d", "#f36315", "#d93806", "#b11901", "#7a0402"),
)
"""The colour map turbo (A. Mikhailov, 2019) by samples at equal distances; `web/src/scene/turbo.ts` has the same."""


def _rgb(colours: tuple[str, ...]) -> NDArray[np.uint8]:
    return np.array([list(bytes.fromhex(colour[1:])) for colour in colours], np.uint8)


_STEPS = 1024
_RAMP = np.full((_STEPS + 1, 4), 255, np.uint8)
"""RGBA of each step of depth, and black."""
_RAMP[_STEPS, :3] = 0
for _channel in range(3):
    _places, _known = np.linspace(0.0, len(TURBO) - 1.0, _STEPS), np.arange(len(TURBO))
    _RAMP[:_STEPS, _channel] = np.interp(_places, _known, _rgb(TURBO)[:, _channel]).round()
_PALETTE = np.zeros((256, 4), np.uint8)
"""RGBA of each label."""
_PALETTE[: len(Label), :3] = _rgb(tuple(COLOURS[label] for label in Label))
_PALETTE[:, 3] = 255


def depth_colours(depth: NDArray[np.float32], farthest: float) -> NDArray[np.uint8]:
    """RGBA of a depth image [m], shape (height, width): turbo from 0 to `farthest`, black without a surface."""
    step = np.full(depth.shape, _STEPS, np.int64)
    is_surface = np.isfinite(depth)
    step[is_surface] = np.clip(depth[is_surface] * ((_STEPS - 1) / farthest), 0, _STEPS - 1)
    return _RAMP[step]


def label_colours(labels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """RGBA of a label image, shape (height, width)."""
    return _PALETTE[labels]
