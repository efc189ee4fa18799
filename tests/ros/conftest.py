"""Fixtures of both generations of ROS."""

from tests.ros.ros1 import environment as environment
from tests.ros.ros1 import stage as stage
