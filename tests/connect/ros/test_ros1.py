"""Live smoke tests of the ROS 1 packages: a real master, roslaunch, and the Frames of a native client as reference.

Contents of messages, names and signs of all profiles are tested without ROS in test_bridge.py and test_readings.py.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any
from xmlrpc.client import ServerProxy

import numpy as np
import pytest

from autodrive import Client
from autodrive.connect.ros import Config
from autodrive.connect.ros.topics import WORLD_TOPICS, VehicleTopics
from autodrive.protocol.messages import Headlights, VehicleFrame
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.ros.markers import check_markers
from tests.support.ros.processes import ROOT, Probe, Program, client
from tests.support.ros.recorder import Recorder, running
from tests.support.ros.ros1 import Ros1
from tests.support.ros.transform_tree import matrix
from tests.support.waiting import free_port, wait_until

VEHICLE = "/autodrive/nigel_1"
TOPICS = VehicleTopics(Config(), is_direct=True)
TYPES = {f"/{topic.name}".replace("//", "/"): topic.type for topic in [*TOPICS.all, *WORLD_TOPICS]}
RARE = {f"{VEHICLE}/{name}" for name in ("collision", "range", "lap_count")}
RARE |= {f"{VEHICLE}/{name}lap_time" for name in ("", "last_", "best_")}
"""Not published here: there is neither contact nor race, and Nigel has no range sensor."""
STATES = {name: kind for name, kind in TYPES.items() if "camera" not in name and name not in RARE}


@pytest.fixture(scope="module")
def bridge(ros1_session: Ros1) -> Iterator[Program]:
    """The bridge node in direct mode."""
    with ros1_session.launch(
        "simulator_bringup_headless.launch", f"port:={ros1_session.port}", "picture_rate:=5"
    ) as started:
        yield started


@pytest.fixture(scope="module")
def probe(ros1_session: Ros1, bridge: Program) -> Iterator[Probe]:
    """Subscribes to the topics of `STATES`; has received a message of each one."""
    with ros1_session.probe() as listener:
        for name, kind in STATES.items():
            listener.subscribe(name, kind)
        wait_until(lambda: {*STATES} <= {*listener.counts()})
        yield listener


@pytest.fixture
def sim(ros1_session: Ros1, bridge: Program) -> Iterator[Client]:
    """A native client; the simulation is reset before the test and running after it."""
    with client(ros1_session.port) as simulator:
        simulator.reset()
        yield simulator
        simulator.resume()


def received(probe: Probe, name: str) -> dict[str, Any]:
    """The latest message of a topic of the vehicle, or of a global topic."""
    return probe.latest(name if name.startswith("/") else f"{VEHICLE}/{name}")["message"]


def expect(value: Callable[[], Any], expected: Any, tolerance: float = 1e-6) -> None:
    """Wait until the value is as expected: the last messages may still be on their way."""
    wait_until(lambda: np.allclose(value(), expected, rtol=1e-6, atol=tolerance, equal_nan=True))


def publish(probe: Probe, **commands: float | None) -> None:
    """Publish commands repeatedly; None stops."""
    for name, value in commands.items():
        kind = "std_msgs/Float32" if name in {"throttle", "steering"} else "std_msgs/Int32"
        probe.publish(f"{VEHICLE}/{name}_command", kind, value)


def test_all_sensors_and_transforms_are_those_of_the_bridge_without_ros(
    probe: Probe, sim: Client, ros1_session: Ros1
) -> None:
    with running(Config(port=ros1_session.port), reference := Recorder()):
        publish(probe, throttle=0.6, steering=0.5, headlights=2, indicators=3)
        wait_until(lambda: (v := sim.wait().vehicles["V1"]).ips.position[1] > 0.05 and v.lights.indicators == 3)
        probe.clear_frames()  # transforms from before the reset have later stamps
        time = sim.frame.time
        wait_until(lambda: sim.wait().time > time + 0.2)
        v = sim.pause().vehicles["V1"]
        publish(probe, throttle=None, steering=None, headlights=None, indicators=None)
        wait_until(lambda: probe.topics().items() >= TYPES.items())
        # odom begins where the bridge has begun; a Recorder has no description
        others = {f"{VEHICLE}/odom", f"{VEHICLE}/robot_description", "/tf", "/tf_static"}
        reference.agree(lambda name: received(probe, name), {*STATES} - others, sim.frame.time)
    assert received(probe, "odom")["child_frame_id"] == "base_link"
    assert received(probe, "lights")["headlights"] == Headlights.HIGH
    check_transforms(probe, v)


def check_transforms(probe: Probe, v: VehicleFrame) -> None:
    expect(lambda: probe.transform("map", "base_link")[0], v.pose.position)
    expect(lambda: probe.transform("map", "base_link")[1], np.roll(v.pose.orientation, -1))
    mount = load_vehicle("nigel").sensors.lidar
    assert mount is not None
    np.testing.assert_allclose(probe.transform("base_link", "lidar")[0], mount.mount.position, atol=1e-9)
    # optical frame: x right, y down, z forward
    right, down, forward = matrix((0, 0, 0), probe.transform("base_link", "front_camera_optical_frame")[1])[:3, :3].T
    np.testing.assert_allclose(right, [0.0, -1.0, 0.0], atol=1e-9)
    assert forward[0] > 0.99
    assert down[2] < -0.99
    parents = dict(re.findall(r"^(\S+):\s*\n\s+parent: '?([^'\n]+)'?", probe.frames(), re.MULTILINE))
    assert set(parents.values()) - set(parents) == {"world"}, "the frames form one tree"
    assert {"nigel_1", "imu", "ips", "rear_camera", "left_encoder", "rear_right_wheel"} <= set(parents)


def test_each_command_topic_drives_and_the_vehicle_stops_without_commands(probe: Probe, sim: Client) -> None:
    twist = {"linear": {"x": 0.2}, "angular": {"z": 0.4}}
    for topic, kind, value in (
        ("throttle_command", "std_msgs/Float32", 0.5),
        ("cmd_vel", "geometry_msgs/Twist", twist),
        ("cmd_vel_stamped", "geometry_msgs/TwistStamped", {"twist": twist}),
    ):
        probe.publish(f"{VEHICLE}/{topic}", kind, value)
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.15)
        if topic != "throttle_command":
            wait_until(lambda: sim.wait().vehicles["V1"].steering > 0.1)
        probe.publish(f"{VEHICLE}/{topic}", kind, None)
        wait_until(lambda: abs(sim.wait().vehicles["V1"].speed) < 1e-3)
    assert sim.frame.vehicles["V1"].throttle == 0.0


def test_markers_are_drawn(ros1_session: Ros1, probe: Probe, sim: Client) -> None:
    publish = partial(probe.publish, "/autodrive/markers")
    check_markers(publish, sim, ros1_session.port, {"secs": 2, "nsecs": 500_000_000})


def test_the_examples_and_the_program_of_the_document_drive(ros1_session: Ros1, sim: Client) -> None:
    sim.teleport("V1", 3.45, -1.73, -0.96)  # facing a corner
    with ros1_session.launch("follow_the_gap.launch"):
        wait_until(lambda: sim.wait().vehicles["V1"].speed < -0.02)  # it reverses
        wait_until(lambda: sim.wait().vehicles["V1"].pose.position[1] > -1.6)  # and drives away from the corner
    sim.reset()
    sim.teleport("V1", 1.7, 0.0, 0.0)
    with ros1_session.launch("follow_waypoints.launch"):
        wait_until(lambda: sim.wait().vehicles["V1"].pose.position[1] > 0.1)  # into the bend
    assert sim.frame.vehicles["V1"].collision_count == 0
    sim.reset()
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "ros1.md").read_text(), flags=re.DOTALL)
    program = ros1_session.folder / "careful.py"
    program.write_text(code)
    with Program(ros1_session.environment, ros1_session.folder, "python3", program):
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.1)
        sim.teleport("V1", 3.4, 0.0, 0.0)  # in front of a wall
        wait_until(lambda: sim.wait().vehicles["V1"].throttle == 0.0)


def test_the_devkit_mode_has_the_names_and_signs_of_its_profile(ros1_session: Ros1, sim: Client, probe: Probe) -> None:
    """With the profile 2020, through the arguments of the launch file."""
    port, root = free_port(), "/autodrive/ego_vehicle"
    kinds = {"steering_angle": "std_msgs/Float32", "lidar": "sensor_msgs/LaserScan", "ips": "geometry_msgs/Point"}
    variables = {"ROS_NAMESPACE": "/devkit"}  # the bridge of the other tests runs too
    arguments = ("mode:=devkit", f"port:={port}", "profile:=2020", "publish_tf:=false", "use_sim_time:=true")
    with ros1_session.launch("autodrive.launch", *arguments, variables=variables):
        for name, kind in kinds.items():
            probe.subscribe(f"/devkit{root}/{name}", kind)
        for name, value in (("throttle", 0.6), ("steering", -0.5)):  # positive is right
            probe.publish(f"/devkit{root}/{name}_command", "std_msgs/Float32", value)
        sim.connect_bridge("127.0.0.1", port)
        wait_until(lambda: (v := sim.wait().vehicles["V1"]).pose.position[1] > 0.05 and v.throttle > 0.5)
        v = sim.pause().vehicles["V1"]
        expect(lambda: received(probe, f"/devkit{root}/steering_angle")["data"], -v.steering, 5.1e-4)  # three decimals
        assert received(probe, f"/devkit{root}/lidar")["angle_min"] == pytest.approx(-np.pi)
        for name in ("throttle", "steering"):
            probe.publish(f"/devkit{root}/{name}_command", "std_msgs/Float32", None)
        sim.disconnect_bridge()


def test_the_bridge_continues_after_a_restart_of_the_master(probe: Probe, ros1_session: Ros1, sim: Client) -> None:
    ros1_session.master.stop()
    count = probe.counts()[f"{VEHICLE}/ips"]
    probe.latest(f"{VEHICLE}/ips", count + 10)  # existing connections are kept
    ros1_session.restart_master()
    with ros1_session.probe() as other:  # a node that knows only the new master
        wait_until(lambda: TYPES.items() <= other.topics().items())
        other.subscribe(f"{VEHICLE}/lidar", "sensor_msgs/LaserScan")
        other.latest(f"{VEHICLE}/lidar", 2)
        publish(other, throttle=0.5)
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.05)
    command = ("rosparam", "get", "/autodrive_ros_bridge/port")
    printed = subprocess.run(command, env=ros1_session.environment, capture_output=True, text=True, check=True).stdout
    assert printed.strip() == str(ros1_session.port)
    with ServerProxy(ros1_session.environment["ROS_MASTER_URI"]) as proxy:
        assert "<robot" in str(proxy.getParam("/test", "/robot_description"))
