"""Fixtures of the server's tests."""

from tests.connect.bridge.conftest import one_world, simulation

__all__ = ["one_world", "simulation"]
