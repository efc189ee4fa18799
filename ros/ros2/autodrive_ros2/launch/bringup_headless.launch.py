"""Starts the bridge, and RViz if requested: ros2 launch autodrive_ros2 bringup_headless.launch.py."""
# pyright: reportAttributeAccessIssue=false
# `launch` is the ROS package; pyright takes it for this folder

import tempfile
from pathlib import Path

import yaml
from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

SHARE = Path(get_package_share_directory("autodrive_ros2"))

ARGUMENTS = {
    "namespace": ("", "prefix of all topics and services except /tf, /tf_static and /clock"),
    "mode": (
        "direct",
        "'direct': a client of this simulator; 'devkit': a server that any AutoDRIVE simulator connects to",
    ),
    "host": ("127.0.0.1", "direct: address of the simulator; devkit: address to listen at"),
    "port": ("0", "0: the default, 8730 (direct) or 4567 (devkit)"),
    "params_file": (str(SHARE / "config" / "autodrive_bridge.yaml"), "parameters of the bridge"),
    "use_sim_time": ("true", "whether RViz uses simulated time, which the bridge publishes"),
    "rviz": ("false", "whether RViz is started"),
    "rviz_config": (str(SHARE / "rviz" / "autodrive.rviz"), "configuration of RViz"),
}


def generate_launch_description() -> LaunchDescription:
    """Launch arguments and nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=text) for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=_nodes)])


def _nodes(context: object) -> list[Node]:
    values = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    chosen = {"mode": values["mode"], "host": values["host"], "port": int(values["port"])}
    bridge = Node(
        package="autodrive_ros2",
        executable="autodrive_bridge",
        name="autodrive_bridge",
        namespace=values["namespace"],
        parameters=[values["params_file"], chosen],
        output="screen",
        emulate_tty=True,
    )
    if values["rviz"].lower() != "true":
        return [bridge]
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        name="autodrive_rviz",
        arguments=["-d", _within(values["namespace"], Path(values["rviz_config"]))],
        parameters=[{"use_sim_time": values["use_sim_time"].lower() == "true"}],
    )
    return [bridge, rviz]


def _within(namespace: str, config: Path) -> str:
    """A copy of the RViz file with the namespace prepended to its topics."""
    if not namespace.strip("/"):
        return str(config)
    root = "/" + namespace.strip("/")

    def moved(node: object) -> object:
        if isinstance(node, dict):
            return {
                key: root + value if key == "Value" and str(value).startswith("/autodrive/") else moved(value)
                for key, value in node.items()
            }
        return [moved(one) for one in node] if isinstance(node, list) else node

    with tempfile.NamedTemporaryFile("w", encoding="utf-8", suffix=".rviz", delete=False) as file:
        yaml.safe_dump(moved(yaml.safe_load(config.read_text(encoding="utf-8"))), file)
    return file.name
