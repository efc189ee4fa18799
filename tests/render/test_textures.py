"""Small pictures that tile."""

import numpy as np
import pytest

from autodrive.render.textures import NAMES, texture


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axis", [0, 1])
def test_texture_goes_on_across_its_edge(name, axis):
    """The step from the last row to the first is like any other step."""
    pixels = texture(name).astype(float)
    steps = np.abs(np.diff(pixels, axis=axis, append=np.take(pixels, [0], axis=axis))).mean((1 - axis, 2))
    assert steps[-1] < steps[:-1].mean() + 4.0 * steps[:-1].std()


@pytest.mark.parametrize("name", NAMES)
def test_texture_is_calm_from_afar(name):
    """Means over squares of 64 pixels differ little: no tile can be told from its neighbours."""
    means = texture(name).reshape(8, 64, 8, 64, 3).mean((1, 3))
    assert means.std((0, 1)).max() < 6.0
