"""Settings of all tests."""

import os

import pytest
from hypothesis import settings

from autodrive.render.gl import GlUnavailable, probe

settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)  # a first call may compile
settings.load_profile("ci" if os.environ.get("CI") else "local")


@pytest.fixture(scope="session")
def gl() -> str:
    """What draws here; a test that needs pictures is skipped where nothing does."""
    try:
        return probe()
    except GlUnavailable as error:
        pytest.skip(str(error))
