"""Conformance checks for sensors and bridges that are written outside of this package.

Call them from your own tests. Each check runs the part against a real world, and raises one `ConformanceError` that
lists everything that is wrong.
"""

from autodrive.run.testing.bridges import Bridge, check_bridge
from autodrive.run.testing.conformance import ConformanceError
from autodrive.run.testing.sensors import check_sensor

__all__ = ["Bridge", "ConformanceError", "check_bridge", "check_sensor"]
