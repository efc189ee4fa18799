"""The ROS 1 packages as people use them: a real master, roslaunch, and the simulator's own Frame to know better."""

from __future__ import annotations

import contextlib
import math
import os
import pty
import re
import signal
import subprocess
from base64 import b64decode
from collections.abc import Callable, Iterator
from typing import Any
from xmlrpc.client import ServerProxy

import numpy as np
import pytest
import simplejpeg

from autodrive import Client
from autodrive.protocol.messages import Headlights, Indicators, VehicleFrame
from autodrive.ros import Config
from autodrive.ros.topics import WORLD_TOPICS, VehicleTopics
from autodrive.vehicles.spec import load_vehicle
from tests.ros.ros1 import Stage, launched, master, witness
from tests.ros.running import ROOT, Running, Witness, await_that, client, simulator

NIGEL = "/autodrive/nigel_1"
TOPICS = VehicleTopics(Config(), is_direct=True)
TYPES = {f"/{topic.name}".replace("//", "/"): topic.type for topic in [*TOPICS.all, *WORLD_TOPICS]}


@pytest.fixture(scope="module")
def bridge(stage: Stage) -> Iterator[Running]:
    """In direct mode."""
    with launched(stage, "simulator_bringup_headless.launch", f"port:={stage.port}") as running:
        yield running


@pytest.fixture(scope="module")
def hearing(stage: Stage, bridge: Running) -> Iterator[Witness]:
    """Of all but the pictures, each of which has been heard once."""
    with witness(stage.environment, stage.folder) as one:
        for name, kind in TYPES.items():
            if "camera" not in name:
                one.listen(name, kind)
        rare = topic_of("collision")
        await_that(lambda: {*TYPES} <= {*one.counts(), rare, *(name for name in TYPES if "camera" in name)})
        yield one


@pytest.fixture
def sim(stage: Stage) -> Iterator[Client]:
    """Reset, and running again afterwards."""
    with client(stage.port) as one:
        one.reset()
        yield one
        one.resume()


def topic_of(name: str) -> str:
    return f"{NIGEL}/{name}"


def heard(hearing: Witness, name: str) -> dict[str, Any]:
    """The latest message of a topic of the vehicle, or of all where it begins with a slash."""
    return hearing.latest(name if name.startswith("/") else topic_of(name))["message"]


def agree(told: Callable[[], Any], right: Any, tolerance: float = 1e-6) -> None:
    """At last: what is on its way when time stops comes a little later."""
    try:
        await_that(lambda: np.allclose(told(), right, rtol=1e-6, atol=tolerance, equal_nan=True), 5.0)
    except AssertionError:
        np.testing.assert_allclose(told(), right, rtol=1e-6, atol=tolerance)


def numbers(message: Any) -> list[float]:
    """All numbers of a message, in the order of its fields."""
    if isinstance(message, dict):
        return [number for value in message.values() for number in numbers(value)]
    return [number for value in message for number in numbers(value)] if isinstance(message, list) else [message]


def drive_a_little(hearing: Witness, sim: Client, side: float = 1.0) -> VehicleFrame:
    """Until no reading is zero, then stop time."""
    say(hearing, throttle=0.6, steering=0.5 * side, headlights=1, indicators=1)
    await_that(lambda: sim.wait().vehicles["V1"].ips.position[1] * side > 0.05)
    vehicle = sim.pause().vehicles["V1"]
    say(hearing, throttle=None, steering=None, headlights=None, indicators=None)
    return vehicle


def say(hearing: Witness, **commands: float | None) -> None:
    for name, value in commands.items():
        kind = "std_msgs/Float32" if name in {"throttle", "steering"} else "std_msgs/Int32"
        hearing.say(topic_of(f"{name}_command"), kind, value)


# -- what is published -------------------------------------------------------------------------------------------


def test_the_topics_are_those_of_the_table_with_their_types(bridge: Running, hearing: Witness) -> None:
    commands = {topic_of(f"{name}_command") for name in ("throttle", "steering", "headlights", "indicators")}
    there = await_that(lambda: (found := hearing.topics()) and commands <= set(found) and found)
    assert {name: there.get(name) for name in TYPES} == TYPES


def test_the_state_is_that_of_the_frame(bridge: Running, hearing: Witness, sim: Client) -> None:
    v = drive_a_little(hearing, sim)
    time = sim.frame.time
    w, x, y, z = v.imu.orientation
    assert abs(z) > 0.01  # it has turned
    agree(lambda: heard(hearing, "throttle")["data"], v.throttle)
    agree(lambda: heard(hearing, "steering")["data"], v.steering)
    agree(lambda: heard(hearing, "speed")["data"], abs(v.speed))
    agree(lambda: [*heard(hearing, "ips").values()], v.ips.position)
    for i, side in enumerate(("left", "right")):
        agree(lambda i=i, side=side: heard(hearing, f"{side}_encoder")["position"], v.encoders.angles[i : i + 1])
        assert heard(hearing, f"{side}_encoder")["name"] == [f"{side}_encoder"]
    for name in ("imu", "imu/data"):
        agree(lambda name=name: [*heard(hearing, name)["orientation"].values()], [x, y, z, w])
    for name in ("imu", "imu/data", "imu/data_raw"):
        agree(lambda name=name: [*heard(hearing, name)["angular_velocity"].values()], v.imu.angular_velocity)
        agree(lambda name=name: [*heard(hearing, name)["linear_acceleration"].values()], v.imu.linear_acceleration)
        agree(lambda name=name: heard(hearing, name)["header"]["stamp"], v.imu.time)
        assert heard(hearing, name)["header"]["frame_id"] == "imu"
    truth = lambda: heard(hearing, "ground_truth/odom")  # noqa: E731
    agree(lambda: truth()["header"]["stamp"], time)
    agree(lambda: [*truth()["pose"]["pose"]["position"].values()], v.pose.position)
    agree(lambda: [*truth()["pose"]["pose"]["orientation"].values()], np.roll(v.pose.orientation, -1))
    agree(lambda: [*truth()["twist"]["twist"]["linear"].values()], v.velocity)
    agree(lambda: [*truth()["twist"]["twist"]["angular"].values()], v.angular_velocity)
    assert (truth()["header"]["frame_id"], truth()["child_frame_id"]) == ("map", "base_link")
    odom = heard(hearing, "odom")
    assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("odom", "base_link")
    assert odom["pose"]["pose"]["position"]["x"] == pytest.approx(v.ips.position[0], rel=0.2)  # its tyres slip
    agree(lambda: heard(hearing, "/clock")["clock"], time)


def test_lamps_wheels_and_joints_are_those_of_the_frame(bridge: Running, hearing: Witness, sim: Client) -> None:
    v = drive_a_little(hearing, sim)
    lights = ("headlights", "indicators", "tail_lights", "left_indicator", "right_indicator", "reverse_lights")
    agree(lambda: [int(heard(hearing, "lights")[name]) for name in lights], [int(getattr(v.lights, n)) for n in lights])
    assert (v.lights.headlights, v.lights.indicators) == (Headlights.LOW, Indicators.LEFT)
    quantities = ("steering_angle", "rotation_angle", "angular_velocity", "compression", "normal_load")
    for name in (*quantities, "slip_ratio", "slip_angle"):
        agree(lambda name=name: heard(hearing, "wheels")[name], getattr(v.wheels, name))
    joints = heard(hearing, "joint_states")
    agree(lambda: heard(hearing, "joint_states")["header"]["stamp"], sim.frame.time)
    angle = dict(zip(joints["name"], heard(hearing, "joint_states")["position"], strict=True))
    assert angle["front_left_steering_joint"] == pytest.approx(v.wheels.steering_angle[0])
    assert angle["rear_right_wheel_joint"] == pytest.approx(v.wheels.rotation_angle[3])


def test_the_scan_is_that_of_the_frame(bridge: Running, hearing: Witness, sim: Client) -> None:
    scan = drive_a_little(hearing, sim).lidar
    assert scan is not None
    for name in ("lidar", "scan"):
        agree(lambda name=name: heard(hearing, name)["header"]["stamp"], scan.time)
        message = heard(hearing, name)
        np.testing.assert_array_equal(np.float32(message["ranges"]), scan.ranges.astype(np.float32))
        np.testing.assert_array_equal(np.float32(message["intensities"]), scan.intensities.astype(np.float32))
        told = [message[f] for f in ("angle_min", "angle_increment", "range_min", "range_max", "scan_time")]
        right = [scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max, 1.0 / scan.scan_rate]
        np.testing.assert_allclose(told, right, rtol=1e-6)
        assert message["header"]["frame_id"] == "lidar"


@pytest.mark.parametrize("camera", ["front", "rear"])
def test_pictures_are_those_of_the_simulator(
    bridge: Running, hearing: Witness, stage: Stage, sim: Client, camera: str, gl: str
) -> None:
    name = f"{camera}_camera"
    topics = [name, f"{name}/image_raw", f"{name}/image_raw/compressed", f"{name}/camera_info"]
    seen: dict[float, bytes] = {}  # by a viewer of the native protocol

    def the_same_one() -> list[Any] | None:
        viewer.wait()
        if picture := viewer.pictures.get(("V1", camera)):
            seen[round(picture.time, 6)] = bytes(picture.jpeg)
        told = [heard(hearing, each) for each in topics]
        stamps = {round(one["header"]["stamp"], 6) for one in told}
        return told if len(stamps) == 1 and stamps <= set(seen) else None

    with Client(f"127.0.0.1:{stage.port}", picture_rate=30.0, picture_quality=90) as viewer:
        for each in topics:
            hearing.listen(topic_of(each), TYPES[topic_of(each)])
        legacy, raw, compressed, pinhole = await_that(the_same_one)
    for each in topics:
        hearing.deafen(topic_of(each))
    jpeg = seen[round(raw["header"]["stamp"], 6)]
    assert b64decode(compressed["data"]) == jpeg
    assert b64decode(raw["data"]) == simplejpeg.decode_jpeg(jpeg, colorspace="RGB").tobytes()
    assert legacy["data"] == raw["data"]
    spec = load_vehicle("nigel").cameras[camera].intrinsics
    assert (raw["width"], raw["height"], raw["encoding"]) == (spec.width, spec.height, "rgb8")
    assert raw["header"]["frame_id"] == f"{camera}_camera_optical_frame"
    np.testing.assert_allclose(pinhole["K"], [spec.fx, 0, spec.cx - 0.5, 0, spec.fy, spec.cy - 0.5, 0, 0, 1], rtol=1e-9)


# -- frames and time ---------------------------------------------------------------------------------------------


def test_tf2_finds_the_vehicle_where_it_is_and_all_frames_in_one_tree(
    bridge: Running, hearing: Witness, sim: Client
) -> None:
    hearing.forget_frames()
    v = drive_a_little(hearing, sim)
    w, x, y, z = v.pose.orientation
    agree(lambda: hearing.transform("map", "base_link")[0], v.pose.position)
    agree(lambda: hearing.transform("map", "base_link")[1], [x, y, z, w])
    assert hearing.transform("odom", "base_link")[0][0] == pytest.approx(v.pose.position[0], rel=0.2)
    sensors = load_vehicle("nigel").sensors
    assert sensors.lidar is not None
    np.testing.assert_allclose(hearing.transform("base_link", "lidar")[0], sensors.lidar.mount.position, atol=1e-9)
    # a camera looks along the z of its optical frame: forward, and a little down
    right, down, forward = columns(hearing.transform("base_link", "front_camera_optical_frame")[1])
    np.testing.assert_allclose(right, [0.0, -1.0, 0.0], atol=1e-9)
    assert forward[0] > 0.99
    assert down[2] < -0.99
    steered = hearing.transform("base_link", "front_left_steering")[1]
    assert 2.0 * math.atan2(steered[2], steered[3]) == pytest.approx(v.wheels.steering_angle[0], abs=1e-6)
    parents = dict(re.findall(r"^(\S+):\s*\n\s+parent: '?([^'\n]+)'?", hearing.frames(), re.MULTILINE))
    assert set(parents.values()) - set(parents) == {"world"}  # one root
    assert {"nigel_1", "imu", "ips", "rear_camera", "left_encoder", "rear_right_wheel"} <= set(parents)


def columns(quaternion: list[float]) -> np.ndarray:
    """Where the axes of a frame point."""
    x, y, z, w = quaternion
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross).T


# -- driving -----------------------------------------------------------------------------------------------------


def test_commands_drive_the_car_and_without_them_it_stops(bridge: Running, hearing: Witness, sim: Client) -> None:
    say(hearing, throttle=0.5, steering=0.4, headlights=2, indicators=3)
    await_that(lambda: sim.wait().vehicles["V1"].speed > 0.1)
    v = await_that(lambda: (v := sim.wait().vehicles["V1"]) and v.lights.indicators == 3 and v)
    assert v.throttle == 0.5
    assert v.steering > 0.0  # left, as since 2025
    assert v.lights.headlights == Headlights.HIGH
    await_that(lambda: sim.wait().vehicles["V1"].pose.position[1] > 0.02)
    say(hearing, throttle=None, steering=None, headlights=None, indicators=None)
    await_that(lambda: sim.wait().vehicles["V1"].throttle == 0.0)
    await_that(lambda: abs(sim.wait().vehicles["V1"].speed) < 1e-3)


@contextlib.contextmanager
def example(stage: Stage, name: str, *arguments: str) -> Iterator[None]:
    with launched(stage, f"{name}.launch", *arguments):
        yield


def test_the_example_in_cpp_turns_away_from_a_corner(bridge: Running, stage: Stage, sim: Client) -> None:
    sim.teleport("V1", 3.45, -1.73, -0.96)  # facing two walls that meet
    with example(stage, "follow_the_gap"):
        await_that(lambda: sim.wait().vehicles["V1"].speed < -0.02)  # no way: back
        await_that(lambda: sim.wait().vehicles["V1"].pose.position[1] > -1.4)  # and away
    assert sim.frame.vehicles["V1"].collision_count == 0


def test_the_example_in_python_goes_round_the_bend(bridge: Running, stage: Stage, sim: Client) -> None:
    sim.teleport("V1", 1.7, 0.0, 0.0)
    with example(stage, "follow_waypoints"):
        await_that(lambda: sim.wait().vehicles["V1"].pose.position[1] > 0.5)
    events = [type(event).__name__ for event in sim.frame.events]
    assert sim.frame.vehicles["V1"].collision_count == 0
    assert "OffRoad" not in events


def test_the_program_of_the_document_drives(bridge: Running, stage: Stage, sim: Client) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "ros1.md").read_text(), flags=re.DOTALL)
    program = stage.folder / "careful.py"
    program.write_text(code)
    with Running(stage.environment, stage.folder, "python3", program):
        await_that(lambda: sim.wait().vehicles["V1"].speed > 0.1)
        sim.teleport("V1", 3.4, 0.0, 0.0)  # before a wall
        await_that(lambda: sim.wait().vehicles["V1"].throttle == 0.0)
    assert sim.frame.vehicles["V1"].collision_count == 0


def test_keys_drive(bridge: Running, stage: Stage, sim: Client) -> None:
    keyboard, terminal = pty.openpty()
    try:
        with launched(stage, "teleop.launch", stdin=terminal) as running:
            await_that(lambda: "further left" in running.words.read_text())
            os.write(keyboard, b"wwali")
            v = await_that(lambda: (v := sim.wait().vehicles["V1"]) and v.lights.indicators == 1 and v)
            assert v.lights.headlights == Headlights.LOW
            await_that(lambda: sim.wait().vehicles["V1"].throttle == pytest.approx(0.4))
            await_that(lambda: sim.wait().vehicles["V1"].steering == pytest.approx(0.2 * math.radians(30.0), rel=1e-3))
            os.write(keyboard, b"s")
            await_that(lambda: sim.wait().vehicles["V1"].throttle == pytest.approx(0.2))
            os.write(keyboard, b"x")
            await_that(lambda: (v := sim.wait().vehicles["V1"]).throttle == 0.0 and abs(v.steering) < 1e-6)
    finally:
        os.close(keyboard)
        os.close(terminal)


# -- what comes and goes -----------------------------------------------------------------------------------------


def test_the_node_goes_on_with_a_simulator_that_was_started_anew(
    bridge: Running, hearing: Witness, stage: Stage
) -> None:
    stage.simulator[0].end(signal.SIGTERM)
    stage.simulator[0] = simulator(stage.folder, "mini_map", port=stage.port)
    before = hearing.counts()[topic_of("lidar")]
    hearing.latest(topic_of("lidar"), before + 1, 60.0)
    with client(stage.port) as sim:
        say(hearing, throttle=0.5)
        await_that(lambda: sim.wait().vehicles["V1"].speed > 0.05)
        say(hearing, throttle=None)


def test_the_node_goes_on_with_a_master_that_was_started_anew(
    bridge: Running, hearing: Witness, stage: Stage, sim: Client
) -> None:
    asked = ("rosparam", "get", "/autodrive_ros_bridge/port")
    stage.master[0].end(signal.SIGINT)
    before = hearing.counts()[topic_of("ips")]
    hearing.latest(topic_of("ips"), before + 10)  # who was connected hears on
    stage.master[0] = master(stage.environment, stage.folder)
    with witness(stage.environment, stage.folder) as other:  # who knows the new one only
        await_that(lambda: TYPES.items() <= other.topics().items())
        other.listen(topic_of("lidar"), "sensor_msgs/LaserScan")
        other.latest(topic_of("lidar"), 2)
        say(other, throttle=0.5)
        await_that(lambda: sim.wait().vehicles["V1"].speed > 0.05)
    told = subprocess.run(asked, env=stage.environment, capture_output=True, text=True, check=True).stdout
    assert told.strip() == str(stage.port)
    with ServerProxy(stage.environment["ROS_MASTER_URI"]) as proxy:
        assert "<robot" in str(proxy.getParam("/test", "/robot_description"))
