"""Launch files and RViz file of ROS 2, tested without `launch` and RViz 2, which are not on PyPI.

The launch files run with stubs of `launch` and `launch_ros` that record their arguments. Not tested: `ros2 launch`
itself, and the display of RViz 2.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from autodrive.connect.ros import Bridge, Config
from tests.support.ros.recorder import Recorder

PACKAGE = Path(__file__).parents[3] / "ros" / "ros2" / "autodrive_ros2"
RVIZ = PACKAGE / "rviz" / "autodrive.rviz"

TYPES = {
    "rviz_default_plugins/RobotModel": "std_msgs/String",
    "rviz_default_plugins/LaserScan": "sensor_msgs/LaserScan",
    "rviz_default_plugins/Odometry": "nav_msgs/Odometry",
    "rviz_default_plugins/Image": "sensor_msgs/Image",
}
"""Display -> type of its topic."""


class Recorded(SimpleNamespace):
    """Records constructor arguments: named ones as attributes, the others as `args`."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(args=args, **named)


class LaunchConfiguration(Recorded):
    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Stubs of the packages that a launch file imports."""
    made: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": Recorded},
        "launch.actions": dict.fromkeys(
            ("DeclareLaunchArgument", "OpaqueFunction", "IncludeLaunchDescription"), Recorded
        ),
        "launch.substitutions": {"LaunchConfiguration": LaunchConfiguration},
        "launch.launch_description_sources": {"PythonLaunchDescriptionSource": Recorded},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
        "ament_index_python": {},
        "ament_index_python.packages": {"get_package_share_directory": lambda _: str(PACKAGE)},
    }
    for name, contents in made.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))


def described(file: str) -> list[Recorded]:
    return runpy.run_path(str(PACKAGE / "launch" / file))["generate_launch_description"]().args[0]


def started(**chosen: str) -> list[Recorded]:
    """Nodes of bringup_headless with these arguments."""
    *arguments, nodes = described("bringup_headless.launch.py")
    context = {one.args[0]: one.default_value for one in arguments}
    assert set(chosen) <= set(context)
    return nodes.function(context | chosen)


def test_headless_starts_the_bridge_with_its_arguments(launch: None) -> None:
    (bridge,) = started(namespace="lab", host="10.0.0.7", port="9000", mode="devkit")
    assert (bridge.package, bridge.executable, bridge.namespace) == ("autodrive_ros2", "autodrive_bridge", "lab")
    file, chosen = bridge.parameters
    assert chosen == {"mode": "devkit", "host": "10.0.0.7", "port": 9000}
    given = yaml.safe_load(Path(file).read_text())["/**"]["ros__parameters"]
    Config(**(given | chosen))  # names and values are valid


def test_its_program_is_installed(launch: None) -> None:
    (bridge,) = started()
    assert f'f"{bridge.executable} = {{NAME}}.bridge:main"' in (PACKAGE / "setup.py").read_text()


def test_graphics_is_headless_with_rviz(launch: None) -> None:
    (included,) = described("bringup_graphics.launch.py")
    assert Path(included.args[0].args[0]).name == "bringup_headless.launch.py"
    assert dict(included.launch_arguments) == {"rviz": "true"}
    _, rviz = started(rviz="true")
    assert (rviz.package, rviz.executable, rviz.arguments) == ("rviz2", "rviz2", ["-d", str(RVIZ)])
    assert rviz.parameters == [{"use_sim_time": True}]


def test_in_a_namespace_rviz_subscribes_there(launch: None) -> None:
    _, rviz = started(rviz="true", namespace="/lab")
    text = Path(rviz.arguments[1]).read_text()
    assert "/lab/autodrive/nigel_1/scan" in text
    assert text.count("/autodrive/") == text.count("/lab/autodrive/") == RVIZ.read_text().count("/autodrive/")


def topics(display: dict[str, Any]) -> list[str]:
    return [display[name]["Value"] for name in ("Topic", "Description Topic") if name in display]


def test_rviz_shows_published_topics() -> None:
    node = Recorder()
    Bridge(Config(), node)
    known = {f"/{name}": topic for name, topic in node.topics.items()}
    displays = yaml.safe_load(RVIZ.read_text())["Visualization Manager"]["Displays"]
    shown = [(display, topic) for display in displays for topic in topics(display)]
    assert {display["Class"] for display, _ in shown} == set(TYPES)
    for display, topic in shown:
        assert known[topic].type == TYPES[display["Class"]], topic
        qos = display.get("Topic") or display["Description Topic"]
        if known[topic].qos == "latched":
            assert qos["Durability Policy"] == "Transient Local"
        else:
            assert qos["Reliability Policy"] == "Best Effort", "compatible with reliable topics too"


def test_rviz_has_a_dock_for_each_image_and_only_known_plugins() -> None:
    tree = yaml.safe_load(RVIZ.read_text())
    manager = tree["Visualization Manager"]
    plain = bytes.fromhex(tree["Window Geometry"]["QMainWindow State"]).replace(b"\0", b"").decode("latin-1")
    for display in manager["Displays"]:
        if display["Class"].endswith("/Image"):
            assert display["Name"] in plain
            assert display["Name"] in tree["Window Geometry"]
    classes = [one["Class"] for one in (*manager["Displays"], *manager["Tools"], manager["Views"]["Current"])]
    assert all(name.startswith("rviz_default_plugins/") for name in classes)
    assert all(panel["Class"].startswith("rviz_common/") for panel in tree["Panels"])
    poses = [tool for tool in manager["Tools"] if tool["Class"].endswith("/SetInitialPose")]
    node = Recorder()
    Bridge(Config(), node)
    assert poses[0]["Topic"]["Value"].removeprefix("/") in node.subscriptions
