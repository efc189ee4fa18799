"""Fixtures of the hardening tests."""

from tests.connect.bridge.conftest import one_world, simulation

__all__ = ["one_world", "simulation"]
