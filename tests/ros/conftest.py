"""Fixtures of ROS that the modules share."""

from tests.ros.ros1 import environment, stage
from tests.ros.ros2 import ros2

__all__ = ["environment", "ros2", "stage"]
