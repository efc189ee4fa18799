"""Exported bags are read by the Python library of ROS 1, and played by `rosbag play` to subscribers that come late."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from autodrive.recording import open as open_recording
from autodrive.recording.exports import export
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.ros.processes import Probe, Program
from tests.support.ros.ros1 import Ros1, master
from tests.support.waiting import free_port, wait_until

READ = """
import json, sys
import rosbag
from roslib.message import get_message_class

topics = {}
with rosbag.Bag(sys.argv[1]) as bag:
    for topic, message, time in bag.read_messages():
        of = topics.setdefault(topic, {"count": 0, "first": time.to_nsec()})
        of["count"] += 1
        if topic.endswith("camera_info"):
            of.update(D=list(message.D), K=list(message.K), R=list(message.R), P=list(message.P))
        if message._type != "tf2_msgs/TFMessage":
            assert message._md5sum == get_message_class(message._type)._md5sum, message._type
print(json.dumps(topics))
"""
"""Prints what `rosbag.Bag` finds; the messages must be those of the installed packages."""


@pytest.fixture(scope="module")
def bag(two_cars: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with open_recording(two_cars) as recording:
        return export(recording, "rosbag1", tmp_path_factory.mktemp("bag") / "drive.bag")


def test_the_library_of_ros_1_reads_all_messages_as_those_of_the_installed_packages(
    ros1_session: Ros1, bag: Path
) -> None:
    read = ["/usr/bin/python3", "-c", READ, str(bag)]
    topics = json.loads(subprocess.run(read, env=ros1_session.environment, capture_output=True, check=True).stdout)
    assert all(of["first"] > 0 for of in topics.values())  # ROS 1 takes time 0 as no time
    assert (topics["/clock"]["count"], topics["/tf_static"]["count"]) == (31, 1)
    info = topics["/autodrive/nigel_1/front_camera/camera_info"]
    lens = load_vehicle("nigel").cameras["front"].intrinsics
    cx, cy = lens.cx - 0.5, lens.cy - 0.5  # in ROS, the centre of the first pixel is (0, 0)
    np.testing.assert_allclose(info["K"], [lens.fx, 0.0, cx, 0.0, lens.fy, cy, 0.0, 0.0, 1.0])
    np.testing.assert_allclose(info["P"], [lens.fx, 0.0, cx, 0.0, 0.0, lens.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
    assert info["R"] == [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    assert info["D"] == [*lens.distortion]


def test_a_node_that_comes_after_the_first_messages_gets_descriptions_and_static_frames(
    ros1_session: Ros1, bag: Path, tmp_path: Path
) -> None:
    environment = ros1_session.environment | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}
    core = master(environment, tmp_path)
    try:
        with Program(environment, tmp_path, "rosbag", "play", "--keep-alive", bag, stdin=subprocess.DEVNULL) as player:
            wait_until(lambda: re.search(r"Duration: 0\.[1-9]", player.output))
            with Probe(environment, tmp_path, "/usr/bin/python3", "ros1_probe.py") as probe:
                for vehicle, name, prefix in (("nigel", "nigel_1", ""), ("roboracer", "roboracer_2", "roboracer_2/")):
                    spec = load_vehicle(vehicle)
                    topic = f"/autodrive/{name}/robot_description"
                    probe.subscribe(topic, "std_msgs/String")
                    description = probe.latest(topic, 0, 20.0)["message"]["data"]
                    assert ElementTree.fromstring(description).get("name") == vehicle
                    assert spec.sensors.lidar is not None
                    position, _, _ = probe.transform(f"{prefix}base_link", f"{prefix}lidar", 20.0)
                    assert position == pytest.approx(spec.sensors.lidar.mount.position)
    finally:
        core.stop()
