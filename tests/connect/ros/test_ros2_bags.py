"""Exported bags in ROS 2: rclpy reads each message, and subscribers that come late get what a player publishes first.

rosbag2 itself is not on PyPI. What its player does with a topic is in the script: a publisher with the QoS that the bag
says was offered, and the bytes of the messages.
"""

from __future__ import annotations

import base64
import json
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from mcap.reader import make_reader

from autodrive.connect.ros import Config
from autodrive.connect.ros.topics import WORLD_TOPICS, VehicleTopics
from autodrive.recording import open as open_recording
from autodrive.recording.exports import export
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.ros.ros2 import ENVIRONMENT

SCRIPT = """
import base64, importlib, json, sys, time
import rclpy
from autodrive_ros2.qos import QOS
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

def get_message(type_):
    package, _, name = type_.split("/")
    return getattr(importlib.import_module(package + ".msg"), name)

def profile(of):
    duration = lambda name: Duration(seconds=of[name]["sec"], nanoseconds=of[name]["nsec"])
    return QoSProfile(
        history=HistoryPolicy(of["history"]), depth=of["depth"], reliability=ReliabilityPolicy(of["reliability"]),
        durability=DurabilityPolicy(of["durability"]), deadline=duration("deadline"), lifespan=duration("lifespan"),
        liveliness=LivelinessPolicy(of["liveliness"]), liveliness_lease_duration=duration("liveliness_lease_duration"),
    )

topics = json.load(open(sys.argv[1]))
rclpy.init()
node = rclpy.create_node("player")
kept = []
for name, topic in topics.items():
    kind, (offered,) = get_message(topic["type"]), map(profile, topic["qos"])
    expected = QOS[topic["class"]]
    for policy in ("history", "depth", "reliability", "durability"):
        assert getattr(offered, policy) == getattr(expected, policy), (name, policy)
    data = base64.b64decode(topic["data"])
    assert type(deserialize_message(data, kind)) is kind
    kept.append(node.create_publisher(kind, name, offered))
    kept[-1].publish(data)
time.sleep(0.5)
late = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
received = {}
for name in sys.argv[2:]:
    store = lambda message, name=name: received.setdefault(name, message)
    kept.append(node.create_subscription(get_message(topics[name]["type"]), name, store, late))
end = time.monotonic() + 60.0
while len(received) < len(sys.argv) - 2 and time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.2)
frames = {}
for one in received["/tf_static"].transforms if "/tf_static" in received else ():
    at = one.transform.translation
    frames[one.child_frame_id] = [one.header.frame_id, at.x, at.y, at.z]
texts = {name: message.data for name, message in received.items() if name != "/tf_static"}
print(json.dumps([frames, texts]))
rclpy.shutdown()
"""


def topics_of(bag: Path) -> dict[str, dict[str, Any]]:
    """Of each topic: type, offered QoS by the metadata and by the MCAP file, and the data of the first message."""
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    (file,) = metadata["relative_file_paths"]
    first: dict[str, Any] = {}
    with (bag / file).open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            qos = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            first.setdefault(channel.topic, {"qos": qos, "data": base64.b64encode(message.data).decode()})
            assert message.log_time > 0
    for one in (one["topic_metadata"] for one in metadata["topics_with_message_count"]):
        assert yaml.safe_load(one["offered_qos_profiles"]) == first[one["name"]]["qos"]
        first[one["name"]]["type"] = one["type"]
    return first


def test_players_offer_what_the_node_offers_and_late_subscribers_get_static_frames_and_descriptions(
    ros2_environment: dict[str, str], two_cars: Path, tmp_path: Path
) -> None:
    with open_recording(two_cars) as recording:
        topics = topics_of(export(recording, "rosbag2", tmp_path / "bag"))
    cars = {"nigel": "nigel_1", "roboracer": "roboracer_2"}
    known = list(WORLD_TOPICS)
    for number, type_ in enumerate(cars, 1):
        known += VehicleTopics(Config(), number, type_, is_direct=True).all
    for topic in known:
        if (name := f"/{topic.name.lstrip('/')}") in topics:
            topics[name]["class"] = topic.qos
    (tmp_path / "topics.json").write_text(json.dumps(topics))
    latched = ["/tf_static", *(f"/autodrive/{name}/robot_description" for name in cars.values())]
    command = [ENVIRONMENT / "bin" / "python", "-c", SCRIPT, tmp_path / "topics.json", *latched]
    done = subprocess.run(command, env=ros2_environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    frames, descriptions = json.loads(done.stdout.splitlines()[-1])
    for (type_, name), prefix in zip(cars.items(), ("", "roboracer_2/"), strict=True):
        assert ElementTree.fromstring(descriptions[f"/autodrive/{name}/robot_description"]).get("name") == type_
        lidar = load_vehicle(type_).sensors.lidar
        assert lidar is not None
        assert frames[f"{prefix}lidar"][0] == f"{prefix}base_link"
        assert frames[f"{prefix}lidar"][1:] == pytest.approx(lidar.mount.position)
