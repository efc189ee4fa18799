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


@pytest.mark.parametrize("name", [name for name in NAMES if name != "clouds"])  # clouds are large
def test_a_texture_is_uniform_from_afar(name: str) -> None:
    """Means over squares of 64 pixels differ little, so the repetition is not visible."""
    means = texture(name).reshape(8, 64, 8, 64, 3).mean((1, 3))
    assert means.std((0, 1)).max() < 6.0


def test_the_noise_of_clouds_is_spread_evenly() -> None:
    """A threshold is then the share of the sky that is clear."""
    shown = texture("clouds")[..., :2] / 255.0
    linear = np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
    for share in (0.1, 0.5, 0.9):
        # a level of the image is 0.4 %, more in the dark
        assert (np.sqrt(linear) < share).mean((0, 1)) == pytest.approx(share, abs=0.02)
