"""The running Simulation of the bridge tests, as a fixture."""

from tests.connect.bridge.conftest import one_world, simulation

__all__ = ["one_world", "simulation"]
