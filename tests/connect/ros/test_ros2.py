"""Live smoke tests of the ROS 2 packages under rclpy, with the Frames of a native client as reference.

Contents of messages, names and signs of all profiles are tested without ROS in test_bridge.py and test_readings.py.
"""

from __future__ import annotations

import base64
import json
import math
import os
import pty
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import simplejpeg

from autodrive import Client
from autodrive.connect.ros import Config
from autodrive.connect.ros.topics import VehicleTopics
from autodrive.protocol.messages import Frame
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.ros import ros2_tables
from tests.support.ros.markers import check_markers
from tests.support.ros.processes import Program, client, simulator
from tests.support.ros.recorder import Recorder, running
from tests.support.ros.ros2 import BUILT, ENVIRONMENT, PROGRAMS, VEHICLE, bridge, probe
from tests.support.ros.transform_tree import matrix
from tests.support.tables import rewritten
from tests.support.waiting import free_port, wait_until

TYPES = {f"/{topic.name}": topic.type for topic in VehicleTopics(Config(), is_direct=True).all}
STATES = {
    name: kind
    for name, kind in TYPES.items()
    # no contact, no race, no range sensor on Nigel; the description is latched
    if "camera" not in name and not name.endswith(("/collision", "/range", "/robot_description", "/lap_count", "_time"))
}

CYCLONE = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>40</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Discovery on this machine only, like ROS 2 with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST."""

OK, UNSUPPORTED, NOT_FOUND, FAILED, ALREADY = 1, 0, 2, 4, 101
STOPPED, PLAYING, PAUSED, QUITTING, NO_WORLD = 0, 1, 2, 3, 4
"""Codes of simulation_interfaces: results and states."""


class Ros2:
    """The bridge node in direct mode, a probe node and a simulator, which all tests share."""

    def __init__(self, environment: dict[str, str], folder: Path) -> None:
        self.environment, self.folder, self.port = environment, folder, free_port()
        self.node = bridge(environment, folder, port=self.port, picture_rate=5.0)
        self.probe = probe(environment, folder)
        assert self.state() == NO_WORLD
        self.simulator = simulator(folder, "boxes", port=self.port)

    def close(self) -> None:
        self.probe.__exit__()
        self.node.stop()
        self.simulator.stop(signal.SIGTERM)

    def state(self) -> int:
        return self.call("get_simulation_state")["state"]["state"]

    def call(self, service: str, **values: Any) -> dict[str, Any]:
        """The response of a service of simulation_interfaces."""
        kind = "".join(word.capitalize() for word in service.split("_"))
        return self.probe.call(f"/{service}", f"simulation_interfaces/{kind}", values)

    def result(self, service: str, **values: Any) -> int:
        return self.call(service, **values)["result"]["result"]

    def received(self, topic: str) -> dict[str, Any]:
        """The latest message of a topic of the vehicle, or of a global topic."""
        return self.probe.latest(topic if topic.startswith("/") else f"{VEHICLE}/{topic}")["message"]


@pytest.fixture(scope="module")
def ros(ros2_environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ros2]:
    one = Ros2(ros2_environment, tmp_path_factory.mktemp("ros2"))
    try:
        for name, kind in STATES.items():
            one.probe.subscribe(name, kind)
        one.probe.subscribe("/tf", "tf2_msgs/TFMessage", "RELIABLE")
        one.probe.subscribe("/clock", "rosgraph_msgs/Clock")
        wait_until(lambda: {*STATES, "/tf", "/clock"} <= {*one.probe.counts()})
        yield one
    finally:
        one.close()


@pytest.fixture
def sim(ros: Ros2) -> Iterator[Client]:
    """A native client; the simulation is reset before the test and running after it."""
    with client(ros.port) as one:
        one.resume()
        one.reset()
        yield one
        one.resume()


@pytest.fixture
def publish(ros: Ros2) -> Iterator[Callable[..., None]]:
    """Publish a message repeatedly until the end of the test; None stops."""
    kinds: dict[str, str] = {}

    def publish(topic: str, kind: str, fields: dict[str, Any] | None) -> None:
        kinds[topic] = kind
        ros.probe.publish(topic if topic.startswith("/") else f"{VEHICLE}/{topic}", kind, fields)

    yield publish
    for topic, kind in kinds.items():
        publish(topic, kind, None)


def seconds(stamp: dict[str, Any]) -> float:
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def vector(fields: dict[str, float]) -> list[float]:
    return [fields[axis] for axis in "xyz"]


def quaternion(fields: dict[str, float]) -> list[float]:
    """In the order of a Frame: wxyz."""
    return [fields[axis] for axis in "wxyz"]


# -- published topics ----------------------------------------------------------------------------------------------


def test_all_sensors_and_transforms_are_those_of_the_bridge_without_ros(
    ros: Ros2, sim: Client, publish: Callable[..., None]
) -> None:
    with running(Config(port=ros.port), reference := Recorder()):
        publish("steering_command", "std_msgs/Float32", {"data": 0.4})
        wait_until(lambda: sim.wait().vehicles["V1"].steering > 0.1)
        sim.pause()  # so that the car does not drive away from the boxes, however late the throttle arrives
        publish("throttle_command", "std_msgs/Float32", {"data": 0.5})
        wait_until(lambda: sim.step(ticks=5).vehicles["V1"].speed > 0.1)
        frame = sim.step(ticks=40)
        # odom begins where the bridge has begun
        reference.agree(ros.received, {*STATES, "/clock"} - {f"{VEHICLE}/odom"}, frame.time)
        wait_until(lambda: seconds(transforms(ros, "/tf")[0]["header"]["stamp"]) == pytest.approx(frame.time, abs=1e-8))
        wait_until(lambda: ros.probe.now() == pytest.approx(frame.time, abs=1e-6))  # a node with use_sim_time
    assert ros.received("odom")["child_frame_id"] == "base_link"
    assert np.isfinite(ros.received("scan")["ranges"]).any()
    check_transforms(frame, ros)


def check_transforms(frame: Frame, ros: Ros2) -> None:
    """/tf_static and robot_description are latched: a late subscriber receives them."""
    latched = "RELIABLE", "TRANSIENT_LOCAL"
    ros.probe.subscribe("/tf_static", "tf2_msgs/TFMessage", *latched)
    ros.probe.subscribe(f"{VEHICLE}/robot_description", "std_msgs/String", *latched)
    moving, static = (poses(transforms(ros, topic)) for topic in ("/tf", "/tf_static"))
    car = frame.vehicles["V1"]
    actual = moving["odom"][1] @ moving["base_link"][1]
    np.testing.assert_allclose(actual, matrix(car.pose.position, np.roll(car.pose.orientation, -1)), atol=1e-9)
    assert static["nigel_1"][0] == "base_link"
    assert static["map"][0] == "world"
    mount = load_vehicle("nigel").sensors.lidar
    assert mount is not None
    np.testing.assert_allclose(static["lidar"][1][:3, 3], mount.mount.position, atol=1e-9)
    assert {"rear_left_wheel", "front_left_steering"} <= set(moving)
    assert ElementTree.fromstring(ros.received("robot_description")["data"]).tag == "robot"


def transforms(ros: Ros2, topic: str) -> list[dict[str, Any]]:
    return ros.received(topic)["transforms"]


def test_transforms_are_sent_before_the_readings_of_their_time(ros: Ros2, sim: Client) -> None:
    """To default subscribers, which are reliable; before TF, a subscriber could not transform them on arrival."""
    ros.probe.record("/tf", "tf2_msgs/TFMessage", 100)  # as a TransformListener: a lost transform would look late
    topics = {"scan": "sensor_msgs/LaserScan", "imu/data": "sensor_msgs/Imu", "odom": "nav_msgs/Odometry"}
    for name, kind in topics.items():
        ros.probe.record(f"{VEHICLE}/{name}", kind)
    readings = {name: ros.probe.recorded(f"{VEHICLE}/{name}", 20) for name in topics}
    transforms = dict(reversed(ros.probe.recorded("/tf", 20)))  # the first time of sending of each stamp
    first, last = min(transforms), max(transforms)
    for name, messages in readings.items():
        known = [(stamp, sent) for stamp, sent in messages if first <= stamp <= last]
        assert len(known) >= 10
        assert all(min(at for other, at in transforms.items() if other >= stamp) <= sent for stamp, sent in known), name


def test_a_node_that_starts_in_a_pause_receives_the_time_transforms_and_the_state(ros: Ros2, sim: Client) -> None:
    time = sim.pause().time
    kinds = {"/clock": "rosgraph_msgs/Clock", "/tf": "tf2_msgs/TFMessage", f"{VEHICLE}/odom": "nav_msgs/Odometry"}
    with probe(ros.environment, ros.folder) as late:
        for topic, kind in kinds.items():
            late.subscribe(topic, kind, "RELIABLE")
        clock, tf, odom = (late.latest(topic)["message"] for topic in kinds)
        stamps = clock["clock"], tf["transforms"][0]["header"]["stamp"], odom["header"]["stamp"]
        assert [seconds(stamp) for stamp in stamps] == pytest.approx([time] * 3, abs=1e-6)


def poses(messages: list[dict[str, Any]]) -> dict[str, tuple[str, np.ndarray]]:
    """Frame -> its parent and its pose in the parent."""
    found = {}
    for one in messages:
        position, orientation = one["transform"]["translation"], one["transform"]["rotation"]
        pose = matrix(vector(position), [orientation[axis] for axis in "xyzw"])
        found[one["child_frame_id"]] = one["header"]["frame_id"], pose
    return found


def test_an_image_is_the_same_in_each_form(ros: Ros2, sim: Client, gl: str) -> None:
    for camera in ("front", "rear"):
        topics = [name for name in TYPES if f"/{camera}_camera" in name]
        for name in topics:
            ros.probe.subscribe(name, TYPES[name])
        legacy, raw, compressed, info = ros.probe.synchronised(topics)
        for name in topics:
            ros.probe.unsubscribe(name)
        pixels = np.frombuffer(base64.b64decode(raw["data"]), np.uint8).reshape(raw["height"], raw["width"], 3)
        np.testing.assert_array_equal(pixels, simplejpeg.decode_jpeg(base64.b64decode(compressed["data"])))
        assert legacy["data"] == raw["data"]
        assert (raw["encoding"], raw["step"]) == ("rgb8", 3 * raw["width"])
        assert pixels.std() > 10.0
        assert (info["width"], info["height"]) == (raw["width"], raw["height"])
        assert info["header"]["frame_id"] == f"{camera}_camera_optical_frame"
        lens = load_vehicle("nigel").cameras[camera].intrinsics
        expected = [lens.fx, lens.cx - 0.5]  # in ROS, the centre of the first pixel is (0, 0)
        assert [info["k"][0], info["k"][2]] == pytest.approx(expected)


def test_types_qos_and_type_hashes_are_those_of_the_documented_packages(ros: Ros2) -> None:
    known = ros.probe.topics()
    for name, kind in TYPES.items():
        assert known[name] == [kind.replace("/", "/msg/")]
    qos = {
        f"{VEHICLE}/scan": ("RELIABLE", "VOLATILE"),
        f"{VEHICLE}/imu/data": ("RELIABLE", "VOLATILE"),
        f"{VEHICLE}/front_camera/image_raw": ("RELIABLE", "VOLATILE"),
        f"{VEHICLE}/odom": ("RELIABLE", "VOLATILE"),
        f"{VEHICLE}/robot_description": ("RELIABLE", "TRANSIENT_LOCAL"),
        "/tf": ("RELIABLE", "VOLATILE"),
        "/tf_static": ("RELIABLE", "TRANSIENT_LOCAL"),
        "/clock": ("RELIABLE", "VOLATILE"),
    }
    for topic, expected in qos.items():
        (one,) = ros.probe.publishers(topic)
        assert (one["node"], one["reliability"], one["durability"]) == ("autodrive_bridge", *expected), topic
    # the stand-ins of packages that are not on PyPI have the type hashes of the real packages
    (drive,), (tf,) = ros.probe.subscribers(f"{VEHICLE}/drive"), ros.probe.publishers("/tf")
    assert drive["hash"].endswith("48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf")
    assert tf["hash"].endswith("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087")
    for name, start in {  # release 1.5.1 of simulation_interfaces
        "ResetSimulation": "4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646",
        "StepSimulation": "913fe065",
        "SetSimulationState": "a868b916",
        "GetSimulatorFeatures": "abb9439c",
    }.items():
        described = BUILT / "install" / "share" / "simulation_interfaces" / "srv" / f"{name}.json"
        hashes = {one["type_name"]: one["hash_string"] for one in json.loads(described.read_text())["type_hashes"]}
        assert hashes[f"simulation_interfaces/srv/{name}"].startswith(f"RIHS01_{start}")


def test_another_dds_implementation_reads_the_scan(ros: Ros2, sim: Client) -> None:
    script = Path(ros2_tables.__file__).parent / "ros2_cyclone.py"
    done = subprocess.run(
        [ENVIRONMENT / "bin" / "python", script, f"{VEHICLE}/scan", ros.environment["ROS_DOMAIN_ID"]],
        env=ros.environment | {"CYCLONEDDS_URI": CYCLONE},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    frame_id, _, _, ranges = json.loads(done.stdout)
    assert (frame_id, len(ranges)) == ("lidar", 360)
    assert sum(0.1 < one < 12.0 for one in ranges) > 3, "the boxes ahead"


# -- driving -------------------------------------------------------------------------------------------------------


def test_each_command_topic_drives_and_the_vehicle_stops_without_commands(
    ros: Ros2, sim: Client, publish: Callable[..., None]
) -> None:
    info = sim.scene.vehicles["V1"]
    for topic, kind, fields, speed, angle in (
        ("throttle_command", "std_msgs/Float32", {"data": 0.6}, 0.6 * info.speed_limit, None),
        ("drive", "ackermann_msgs/AckermannDriveStamped", {"drive": {"speed": 0.2, "steering_angle": 0.3}}, 0.2, 0.3),
        (
            "cmd_vel",
            "geometry_msgs/Twist",
            {"linear": {"x": 0.2}, "angular": {"z": 0.4}},
            0.2,
            math.atan(info.wheelbase * 0.4 / 0.2),  # without tyre slip
        ),
        ("cmd_vel_stamped", "geometry_msgs/TwistStamped", {"twist": {"linear": {"x": 0.2}}}, 0.2, 0.0),
    ):
        publish(topic, kind, fields)
        wait_until(lambda speed=speed: 0.85 * speed < sim.wait().vehicles["V1"].speed < 1.1 * speed)
        if angle is not None:
            wait_until(lambda angle=angle: sim.wait().vehicles["V1"].steering == pytest.approx(angle, abs=1e-3))
        publish(topic, kind, None)
        wait_until(lambda: (v := sim.wait().vehicles["V1"]).throttle == 0.0 and abs(v.speed) < 0.01)
        sim.reset()
    for topic, value in (("headlights_command", 2), ("indicators_command", 3)):
        publish(topic, "std_msgs/Int32", {"data": value})
    wait_until(lambda: (lights := sim.wait().vehicles["V1"].lights).headlights == 2 and lights.indicators == 3)


def test_markers_are_drawn(ros: Ros2, sim: Client, publish: Callable[..., None]) -> None:
    check_markers(partial(publish, "/autodrive/markers"), sim, ros.port, {"sec": 2, "nanosec": 500_000_000})


def test_keys_a_gamepad_and_the_program_of_the_document_drive(
    ros: Ros2, sim: Client, publish: Callable[..., None]
) -> None:
    keyboard, terminal = pty.openpty()
    with Program(ros.environment, ros.folder, PROGRAMS / "teleop_keyboard", stdin=terminal) as program:
        program.wait_for("Ctrl-C")
        os.write(keyboard, b"wwa")
        wait_until(lambda: sim.wait().vehicles["V1"].throttle == pytest.approx(0.4))
        wait_until(lambda: sim.wait().vehicles["V1"].steering == pytest.approx(0.2 * 0.5236, abs=2e-3))
        os.write(keyboard, b"x")
        wait_until(lambda: sim.wait().vehicles["V1"].throttle == 0.0)
        program.stop()
        assert program.process.returncode == 0
    with Program(ros.environment, ros.folder, PROGRAMS / "teleop_joy"):
        pushed = {"axes": [0.0, 1.0, 0.0, -0.5], "buttons": [0, 0, 0, 0, 1]}
        publish("/joy", "sensor_msgs/Joy", pushed)
        wait_until(lambda: (v := sim.wait().vehicles["V1"]).throttle > 0.9 and v.steering < -0.2)
        publish("/joy", "sensor_msgs/Joy", pushed | {"buttons": [0] * 5})
        wait_until(lambda: sim.wait().vehicles["V1"].throttle == 0.0)
        publish("/joy", "sensor_msgs/Joy", None)
    (code,) = re.findall(r"```python\n(.*?)```", ros2_tables.DOCUMENT.read_text(), flags=re.DOTALL)
    file = ros.folder / "careful.py"
    file.write_text(code)
    sim.reset()
    with Program(ros.environment, ros.folder, ENVIRONMENT / "bin" / "python", file):
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.1)
        wait_until(lambda: abs(sim.wait().vehicles["V1"].speed) < 0.01)  # boxes are ahead
    car = sim.frame.vehicles["V1"]
    assert car.collision_count == 0
    assert car.lidar is not None
    assert 0.25 < min(*car.lidar.ranges[:20], *car.lidar.ranges[-20:]) < 0.55


def test_topics_set_the_weather_and_the_time_of_day(sim: Client, publish: Callable[..., None]) -> None:
    for name, value in (("weather_id", 6), ("time_of_day", 1140)):  # heavy rain at 19:00
        publish(f"/autodrive/environment/{name}", "std_msgs/Int32", {"data": value})
    wait_until(lambda: (f := sim.wait()).weather is not None and f.weather.rain == 0.8 and f.time_of_day == 68400.0)


# -- services ------------------------------------------------------------------------------------------------------


def test_services_control_the_simulation(ros: Ros2, sim: Client) -> None:
    features = ros.call("get_simulator_features")["features"]
    assert set(features["features"]) == {10, 11, 20, 21, 22, 24, 25, 26, 31, 32, 40, 43, 44}
    assert ros.result("step_simulation", steps=5) == FAILED  # not paused
    assert ros.result("set_simulation_state", state={"state": PAUSED}) == OK
    before = sim.pause().tick
    assert ros.state() == PAUSED
    assert ros.result("step_simulation", steps=217) == OK
    assert sim.pause().tick == before + 217
    assert ros.result("set_simulation_state", state={"state": PAUSED}) == ALREADY
    assert ros.result("reset_simulation") == OK
    assert sim.pause().tick == 0
    assert ros.result("reset_simulation", scope=4) == UNSUPPORTED
    assert ros.result("set_simulation_state", state={"state": PLAYING}) == OK
    wait_until(lambda: sim.wait().tick > 3)
    assert ros.result("set_simulation_state", state={"state": STOPPED}) == OK  # paused and reset
    assert (sim.pause().tick, ros.state()) == (0, STOPPED)
    assert ros.result("set_simulation_state", state={"state": QUITTING}) == UNSUPPORTED
    sim.resume()  # by another client
    wait_until(lambda: ros.state() == PLAYING)
    sim.pause()
    wait_until(lambda: ros.state() == PAUSED)


def test_services_read_and_set_entities(ros: Ros2, sim: Client) -> None:
    frame = sim.pause()
    names = ros.call("get_entities")["entities"]
    assert names == ["nigel_1", *frame.objects]
    assert ros.call("get_entities", filters={"filter": "^nigel"})["entities"] == ["nigel_1"]
    assert ros.result("get_entities", filters={"filter": "("}) == FAILED
    pose = {"position": {"x": 0.4, "y": -0.3}, "orientation": {"w": math.cos(0.5), "z": math.sin(0.5)}}
    assert ros.result("set_entity_state", entity="nigel_1", state={"pose": pose}) == OK
    frame = sim.step(ticks=1)
    car = frame.vehicles["V1"]
    assert car.pose.position[:2] == pytest.approx([0.4, -0.3], abs=1e-3)
    assert 2.0 * math.atan2(car.pose.orientation[3], car.pose.orientation[0]) == pytest.approx(1.0, abs=1e-3)
    for name, expected in (("nigel_1", car.pose), (names[1], frame.objects[names[1]].pose)):

        def state(name: str = name) -> dict[str, Any]:
            return ros.call("get_entity_state", entity=name)["state"]["pose"]

        wait_until(
            lambda state=state, expected=expected: (
                vector(state()["position"]) == pytest.approx(expected.position, abs=1e-9)
            )
        )
        assert quaternion(state()["orientation"]) == pytest.approx(expected.orientation)
    zeros = {"position": {"x": 0.0}, "orientation": {"w": 0.0}}
    assert ros.result("set_entity_state", entity="nigel_1", state={"pose": zeros}) == FAILED
    assert ros.result("get_entity_state", entity="unknown") == NOT_FOUND
    assert ros.result("set_entity_state", entity=names[1], state={"pose": pose}) == UNSUPPORTED


def test_services_load_worlds(ros: Ros2, sim: Client) -> None:
    worlds = ros.call("get_available_worlds")["worlds"]
    assert {one["world_resource"]["uri"]: one["description"] for one in worlds} == sim.scenarios
    assert ros.call("get_current_world")["world"]["name"] == "boxes"
    assert ros.result("load_world") == 102  # no resource
    assert ros.result("load_world", uri="atlantis") == NOT_FOUND
    answer = ros.call("load_world", uri="two_cars")
    assert (answer["result"]["result"], answer["world"]["name"]) == (OK, "two_cars")
    frame = sim.pause()
    assert (sim.scene.scenario, frame.tick, ros.state()) == ("two_cars", 0, STOPPED)
    wait_until(lambda: ros.call("get_entities")["entities"] == ["nigel_1", "nigel_2", *sim.frame.objects])
    ros.probe.subscribe("/autodrive/nigel_2/odom", "nav_msgs/Odometry", "RELIABLE")
    sim.resume()
    assert ros.received("/autodrive/nigel_2/odom")["child_frame_id"] == "nigel_2/base_link"
    assert ros.result("load_world", uri="boxes") == OK


# -- the node ------------------------------------------------------------------------------------------------------


def test_the_devkit_mode_publishes_and_drives(ros: Ros2, sim: Client, publish: Callable[..., None]) -> None:
    """This simulator connects with the devkit protocol, like the original one."""
    port, root = free_port(), f"/devkit{VEHICLE}"
    options = {"mode": "devkit", "port": port, "publish_tf": False}
    with bridge(ros.environment, ros.folder, "-r", "__ns:=/devkit", **options):
        ros.probe.subscribe(f"{root}/scan", "sensor_msgs/LaserScan")
        ros.probe.subscribe(f"{root}/ips", "geometry_msgs/Point", "RELIABLE")
        publish(f"{root}/throttle_command", "std_msgs/Float32", {"data": 0.5})
        sim.connect_bridge("127.0.0.1", port)
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.1)
        position = sim.pause().vehicles["V1"].ips.position
        wait_until(lambda: vector(ros.received(f"{root}/ips")) == pytest.approx(position, abs=6e-5))  # four decimals
        assert len(ros.received(f"{root}/scan")["ranges"]) == 360
        assert not [name for name in ros.probe.services() if name == "/devkit/step_simulation"]
        sim.disconnect_bridge()


def test_the_tables_of_the_document_are_those_of_the_code(ros2_environment: dict[str, str]) -> None:
    text = ros2_tables.DOCUMENT.read_text()
    tables = ros2_tables.tables(ros2_environment)
    assert rewritten(text, tables) == text, "run  python -m tests.support.ros.ros2_tables"


def test_missing_optional_packages_are_reported(ros2_environment: dict[str, str], tmp_path: Path) -> None:
    for package in ("simulation_interfaces", "ackermann_msgs"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise ImportError('hidden')\n")
    environment = ros2_environment | {"PYTHONPATH": f"{tmp_path}:{ros2_environment['PYTHONPATH']}"}
    with bridge(environment, tmp_path, port=free_port()) as node:
        node.wait_for("no simulator")
        assert "no services: the package simulation_interfaces is not installed" in node.output
        assert "no topic autodrive/nigel_1/drive" in node.output


def test_an_invalid_parameter_is_reported_in_one_line(ros2_environment: dict[str, str], tmp_path: Path) -> None:
    with bridge(ros2_environment, tmp_path, profile="2019") as node:
        wait_until(lambda: node.process.poll() is not None)
        assert node.process.returncode == 1
        assert node.output == (
            "autodrive_bridge: profile must be one of 2020, 2022, 2023, 2025, roboracer, neoracer, not '2019'\n"
        )


def test_the_node_waits_for_a_restarted_simulator_and_ends_at_ctrl_c(ros: Ros2) -> None:
    """The last test: the node ends."""
    ros.simulator.stop(signal.SIGTERM)
    wait_until(lambda: "no simulator" in ros.node.output or "was lost" in ros.node.output)
    ros.simulator = simulator(ros.folder, "plane", "--no-cameras", port=ros.port)
    count = ros.probe.counts()[f"{VEHICLE}/odom"]
    ros.probe.latest(f"{VEHICLE}/odom", count + 1)
    ros.node.stop()
    assert ros.node.process.returncode == 0
    assert "Traceback" not in ros.node.output
