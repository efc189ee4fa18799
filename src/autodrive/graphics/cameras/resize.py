"""Resizes images: area average when shrinking, linear interpolation when growing."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from autodrive.base.jit import jit

if TYPE_CHECKING:
    from numpy.typing import NDArray


def resized(rgba: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """The image, shape (h, w, 4), at that size; the same object if it has that size. Averages sRGB values directly."""
    if rgba.shape[:2] == (height, width):
        return rgba
    out = np.empty((height, width, 4), np.uint8)
    flat = np.ascontiguousarray(rgba).reshape(rgba.shape[0], -1)
    _resize(flat, *_taps(rgba.shape[0], height), *_taps(rgba.shape[1], width), out)
    return out


@lru_cache(maxsize=64)
def _taps(old: int, new: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The first of the `old` pixels that each of `new` pixels along an edge uses, and their weights (sum 1).

    A new pixel covers old / new old pixels. If that is at least 1, weights are the covered shares; else the two nearest
    centres are interpolated.
    """
    scale = old / new
    here = (np.arange(new) + 0.5) * scale  # centre, in old pixels
    if scale >= 1.0:
        low, high = here - 0.5 * scale, here + 0.5 * scale
        first = np.floor(low).astype(np.int64)
        pixels = first[:, None] + np.arange(int(np.ceil(scale)) + 1)
        weights = np.clip(np.minimum(pixels + 1, high[:, None]) - np.maximum(pixels, low[:, None]), 0.0, None)
    else:
        here = np.clip(here, 0.5, old - 0.5)  # no extrapolation beyond the outermost centres
        first = np.floor(here - 0.5).astype(np.int64)
        pixels = first[:, None] + np.arange(2)
        weights = 1.0 - np.abs(pixels + 0.5 - here[:, None])
    weights[pixels >= old] = 0.0
    return first, (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


@jit
def _resize(
    rgba: NDArray[np.uint8],
    first_row: NDArray[np.int64],
    row_weights: NDArray[np.float32],
    first_column: NDArray[np.int64],
    column_weights: NDArray[np.float32],
    out: NDArray[np.uint8],
) -> None:
    line = np.empty(rgba.shape[1], np.float32)
    for y in range(out.shape[0]):
        line[:] = np.float32(0.5)  # rounds to nearest
        for tap in range(row_weights.shape[1]):
            weight = row_weights[y, tap]
            if weight != 0.0:
                row = rgba[first_row[y] + tap]
                for i in range(len(line)):
                    line[i] += weight * np.float32(row[i])
        for x in range(out.shape[1]):
            red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for tap in range(column_weights.shape[1]):
                weight = column_weights[x, tap]
                if weight != 0.0:
                    i = 4 * (first_column[x] + tap)
                    red += weight * line[i]
                    green += weight * line[i + 1]
                    blue += weight * line[i + 2]
            out[y, x, 0], out[y, x, 1], out[y, x, 2], out[y, x, 3] = np.uint8(red), np.uint8(green), np.uint8(blue), 255
