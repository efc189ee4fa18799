"""Fixtures of the hardening tests."""

from tests.bridge.conftest import one_world, simulation
from tests.support.hardening import LONG

__all__ = ["one_world", "simulation"]

collect_ignore = [] if LONG else ["test_crowd.py"]
"""Two hundred connections need a quiet machine: only in the long form."""
