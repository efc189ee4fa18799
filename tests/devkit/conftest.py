"""A running Simulation for the tests of this folder, as those of the bridge have it."""

from tests.bridge.conftest import one_world, simulation

__all__ = ["one_world", "simulation"]
