"""Fixtures of the physics tests."""

from functools import partial
from pathlib import Path

import pytest

from tests.support.physics import WorldWith, world_with_car


@pytest.fixture
def world_with(tmp_path: Path) -> WorldWith:
    """`world_with_car`, with its files in a temporary folder."""
    return partial(world_with_car, tmp_path)
