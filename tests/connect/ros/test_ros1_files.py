"""Files of the ROS 1 packages agree with the code; tested without ROS."""

from __future__ import annotations

import dataclasses
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import yaml

from autodrive.connect.ros import Config
from autodrive.connect.ros.topics import VehicleTopics
from tests.support.ros.ros1_tables import DOCUMENT, tables
from tests.support.tables import rewritten

PACKAGE = Path(__file__).parents[3] / "ros" / "ros1" / "autodrive_ros"


def test_the_tables_of_the_document_are_those_of_the_code() -> None:
    text = DOCUMENT.read_text()
    assert text == rewritten(text, tables()), "run  python -m tests.support.ros.ros1_tables"


def test_every_parameter_is_an_argument_with_the_same_default() -> None:
    arguments = {
        one.attrib["name"]: one.attrib["default"]
        for one in ElementTree.parse(PACKAGE / "launch" / "autodrive.launch").iterfind("arg")
    }
    del arguments["use_sim_time"], arguments["urdf"], arguments["car"]
    for field in dataclasses.fields(Config):
        if field.name != "robot_description":
            default = arguments.pop(field.name)
            assert (str(field.default).lower() == default) or float(default) == field.default, field.name
    assert not arguments


def test_rviz_shows_published_topics() -> None:
    displays = yaml.safe_load((PACKAGE / "rviz" / "autodrive.rviz").read_text())["Visualization Manager"]["Displays"]
    shown = {one[key] for one in displays for key in ("Topic", "Image Topic") if key in one}
    topics = VehicleTopics(Config(), is_direct=True)
    published = {topic.name.removeprefix(f"{topics.root}/") for topic in topics.all}
    assert shown - published == {"route"}  # published by the example
    assert {"lidar", "odom", "front_camera", "rear_camera"} <= shown


def test_the_messages_of_both_generations_are_the_same_files() -> None:
    messages = PACKAGE.parent / "autodrive_msgs" / "msg"
    assert messages.is_symlink()
    assert messages.resolve() == PACKAGE.parents[1] / "ros2" / "autodrive_msgs" / "msg"


def test_the_script_is_plain_sh() -> None:
    script = PACKAGE.parents[2] / "scripts" / "ros1"
    assert subprocess.run(["sh", "-n", script], check=False).returncode == 0
