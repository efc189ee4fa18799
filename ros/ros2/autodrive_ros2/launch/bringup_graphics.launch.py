"""Starts the bridge to a simulator, and RViz: ros2 launch autodrive_ros2 bringup_graphics.launch.py."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

HEADLESS = Path(get_package_share_directory("autodrive_ros2")) / "launch" / "bringup_headless.launch.py"


def generate_launch_description() -> LaunchDescription:
    """As bringup_headless, whose arguments it takes, with `rviz` true."""
    source = PythonLaunchDescriptionSource(str(HEADLESS))
    return LaunchDescription([IncludeLaunchDescription(source, launch_arguments={"rviz": "true"}.items())])
