"""Fixtures of ROS 1 that its modules share."""

from tests.ros.ros1 import environment, stage

__all__ = ["environment", "stage"]
