"""Generated textures tile without a visible seam."""

from __future__ import annotations

import numpy as np
import pytest

from autodrive.graphics.assets.textures import NAMES, texture


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_texture_continues_across_its_edge(name: str, axis: int) -> None:
    """The step from the last row to the first is like any other step."""
    pixels = texture(name).astype(float)
    steps = np.abs(np.diff(pixels, axis=axis, append=np.take(pixels, [0], axis=axis))).mean((1 - axis, 2))
    assert steps[-1] < steps[:-1].mean() + 4.0 * steps[:-1].std()


@pytest.mark.parametrize("name", NAMES)
def test_a_texture_is_uniform_from_afar(name: str) -> None:
    """Means over squares of 64 pixels differ little, so the repetition is not visible."""
    means = texture(name).reshape(8, 64, 8, 64, 3).mean((1, 3))
    assert means.std((0, 1)).max() < 6.0
