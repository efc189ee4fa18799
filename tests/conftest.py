"""Settings of all tests."""

import os

from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("local", deadline=None)  # a first call may compile
settings.load_profile("ci" if os.environ.get("CI") else "local")
