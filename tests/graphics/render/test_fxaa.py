"""Anti-aliasing of images in memory, compared with the formulas of FXAA in floating point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autodrive.graphics.render.fxaa import smoothed

HEIGHT, WIDTH = 40, 50


def slanted(dark: int = 30, light: int = 220) -> NDArray[np.uint8]:
    """Light above a slanted line, dark below, in a colour."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    image = np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    image[..., :3] = np.where(y < 12 + 0.3 * x, light, dark)[..., None] * (1.0, 0.8, 0.6)
    return image


def sample(image: NDArray[np.float64], x: float, y: float) -> NDArray[np.float64]:
    """Linear interpolation between the centres of pixels; outside the image, the nearest pixel."""
    x, y = np.clip(x, 0.0, WIDTH - 1.001), np.clip(y, 0.0, HEIGHT - 1.001)
    i, j = int(x), int(y)
    top, bottom = (image[j + k, i] * (1.0 - x + i) + image[j + k, i + 1] * (x - i) for k in (0, 1))
    return top * (1.0 - y + j) + bottom * (y - j)


def reference(image: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The colours after FXAA; and which pixels are so near a threshold that rounding decides."""
    rgb = image[..., :3].astype(float)
    luma = rgb @ (0.299, 0.587, 0.114)
    out, is_close = rgb.copy(), np.zeros(luma.shape, bool)
    for y in range(1, HEIGHT - 1):
        for x in range(1, WIDTH - 1):
            nw, ne, sw, se = luma[y - 1, x - 1], luma[y - 1, x + 1], luma[y + 1, x - 1], luma[y + 1, x + 1]
            around = (nw, ne, sw, se, luma[y, x])
            contrast, least = max(around) - min(around), max(0.03 * 255.0, max(around) / 8.0)
            is_close[y, x] = abs(contrast - least) < 2.0
            if contrast < least:
                continue
            along = np.array([sw + se - nw - ne, nw + sw - ne - se])
            along = np.clip(along / (abs(along).min() + max((nw + ne + sw + se) / 32.0, 2.0)), -8.0, 8.0)
            ends = {
                step: [sample(rgb, *((x, y) + sign * step * along)) for sign in (-1.0, 1.0)] for step in (1 / 6, 0.5)
            }
            near = np.mean(ends[1 / 6], axis=0)
            wide = 0.5 * near + 0.5 * np.mean(ends[0.5], axis=0)
            brightness = wide @ (0.299, 0.587, 0.114)
            is_close[y, x] |= min(abs(brightness - min(around)), abs(brightness - max(around))) < 2.0
            out[y, x] = wide if min(around) <= brightness <= max(around) else near
    return out, is_close


def test_the_result_is_that_of_the_formulas() -> None:
    rng = np.random.default_rng(1)
    rough = np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    rough[..., :3] = np.repeat(np.repeat(rng.integers(0, 256, (10, 10, 3)), 4, axis=0), 5, axis=1)
    for image in (slanted(), slanted(220, 30), rough):
        expected, is_close = reference(image)
        result = smoothed(image)
        assert (
            np.abs(result[..., :3] - expected)[~is_close].max() < 6.0
        )  # brightness, which gives the direction, is rounded
        assert is_close.mean() < 0.4
        assert (result != image).any(axis=2).mean() > 0.03


def test_an_edge_gets_intermediate_colours_and_stays_in_place() -> None:
    image = slanted()
    result = smoothed(image)
    red = result[1:-1, 1:-1, 0].astype(int)
    assert len(np.unique(image[..., 0])) == 2
    assert len(np.unique(red)) > 5
    assert abs(red.mean() - image[1:-1, 1:-1, 0].mean()) < 1.0
    assert (result[..., 3] == 255).all()


def test_faint_differences_and_the_outermost_pixels_stay_as_they_are() -> None:
    faint = slanted(100, 106)
    assert np.array_equal(smoothed(faint), faint)
    image = slanted()
    result = smoothed(image)
    for side in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        assert np.array_equal(result[side], image[side])


def test_the_given_image_is_unchanged_and_may_have_any_size() -> None:
    image = slanted()
    smoothed(image)
    assert np.array_equal(image, slanted())
    for height, width in ((1, 1), (2, 5), (5, 2), (3, 3)):
        small = np.ascontiguousarray(image[:height, :width])
        assert np.array_equal(smoothed(small)[0], small[0])
