"""Fixtures of both generations of ROS."""

from tests.ros.ros1 import environment as environment
