"""Starts the bridge and RViz: ros2 launch autodrive_ros2 bringup_graphics.launch.py."""
# pyright: reportAttributeAccessIssue=false
# `launch` is the ROS package; pyright takes it for this folder

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

HEADLESS = Path(get_package_share_directory("autodrive_ros2")) / "launch" / "bringup_headless.launch.py"


def generate_launch_description() -> LaunchDescription:
    """bringup_headless with `rviz` true; it accepts the same arguments."""
    source = PythonLaunchDescriptionSource(str(HEADLESS))
    return LaunchDescription([IncludeLaunchDescription(source, launch_arguments={"rviz": "true"}.items())])
