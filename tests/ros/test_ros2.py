"""The bridge's node under the real rclpy, against the simulator's own Frames."""

from __future__ import annotations

import base64
import contextlib
import json
import math
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import simplejpeg

from autodrive import Client
from autodrive.protocol.messages import Frame, VehicleFrame
from autodrive.vehicles.spec import load_vehicle
from tests.ros.frames import matrix
from tests.ros.ros2 import BUILT, VEHICLE, bridge, witness
from tests.ros.running import Running, Witness, await_that, client, free_port, simulator
from tests.test_cli import Started

PORT = free_port()

TOPICS = {
    "throttle": "std_msgs/Float32",
    "steering": "std_msgs/Float32",
    "speed": "std_msgs/Float32",
    "left_encoder": "sensor_msgs/JointState",
    "right_encoder": "sensor_msgs/JointState",
    "ips": "geometry_msgs/Point",
    "imu": "sensor_msgs/Imu",
    "imu/data": "sensor_msgs/Imu",
    "imu/data_raw": "sensor_msgs/Imu",
    "lidar": "sensor_msgs/LaserScan",
    "scan": "sensor_msgs/LaserScan",
    "odom": "nav_msgs/Odometry",
    "ground_truth/odom": "nav_msgs/Odometry",
    "joint_states": "sensor_msgs/JointState",
    "lights": "autodrive_msgs/Lights",
    "wheels": "autodrive_msgs/WheelStates",
    "collision": "autodrive_msgs/Collision",
    "front_camera": "sensor_msgs/Image",
    "front_camera/image_raw": "sensor_msgs/Image",
    "front_camera/image_raw/compressed": "sensor_msgs/CompressedImage",
    "front_camera/camera_info": "sensor_msgs/CameraInfo",
    "rear_camera": "sensor_msgs/Image",
    "rear_camera/image_raw": "sensor_msgs/Image",
    "rear_camera/image_raw/compressed": "sensor_msgs/CompressedImage",
    "rear_camera/camera_info": "sensor_msgs/CameraInfo",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("ros2")


@pytest.fixture(scope="module")
def simulation(ros2: dict[str, str], folder: Path) -> Iterator[Started]:
    run = simulator(folder, "boxes", "--lockstep", port=PORT)
    yield run
    run.end(signal.SIGTERM)


@pytest.fixture(scope="module")
def node(ros2: dict[str, str], folder: Path, simulation: Started) -> Iterator[Running]:
    with bridge(ros2, folder, port=PORT) as running:
        yield running


@pytest.fixture
def say(heard: Witness) -> Iterator[Callable[..., None]]:
    """Say to the vehicle what is to be said again and again, until the test ends."""
    said: dict[str, str] = {}

    def say(topic: str, kind: str, fields: dict[str, Any] | None) -> None:
        said[topic] = kind
        heard.say(f"{VEHICLE}/{topic}", kind, fields)

    yield say
    for topic, kind in said.items():
        heard.say(f"{VEHICLE}/{topic}", kind, None)


@pytest.fixture(scope="module")
def heard(ros2: dict[str, str], folder: Path, node: Running) -> Iterator[Witness]:
    """Hears every topic."""
    with witness(ros2, folder) as one:
        for name, kind in TOPICS.items():
            one.listen(f"{VEHICLE}/{name}", kind)
        one.listen(f"{VEHICLE}/robot_description", "std_msgs/String", "RELIABLE", "TRANSIENT_LOCAL")
        one.listen("/tf", "tf2_msgs/TFMessage", "RELIABLE")
        one.listen("/tf_static", "tf2_msgs/TFMessage", "RELIABLE", "TRANSIENT_LOCAL")
        one.listen("/clock", "rosgraph_msgs/Clock")
        one.latest("/clock")
        yield one


@pytest.fixture(scope="module")
def sim(simulation: Started) -> Iterator[Client]:
    with client(PORT) as one:
        yield one


@pytest.fixture
def stepped(sim: Client, heard: Witness, say: Callable[..., None]) -> Iterator[tuple[Frame, dict[str, Any]]]:
    """The car on its way, time standing still: the Frame, and the last message of each topic."""
    heard.latest(f"{VEHICLE}/rear_camera/image_raw/compressed")  # they are asked for, and come
    say("throttle_command", "std_msgs/Float32", {"data": 0.5})
    say("steering_command", "std_msgs/Float32", {"data": 0.4})
    await_that(lambda: sim.frame.vehicles["V1"].speed > 0.1)
    with standing(sim):
        frame = sim.step(ticks=40)

        def message(topic: str) -> dict[str, Any]:
            return heard.latest(f"{VEHICLE}/{topic}")["message"]

        await_that(lambda: seconds(message("wheels")) == pytest.approx(frame.time, abs=1e-8))
        await_that(lambda: seconds(message("scan")) == pytest.approx(frame.vehicles["V1"].lidar.time, abs=1e-8))
        names = [name for name in TOPICS if "camera" not in name and name != "collision"]
        yield frame, {name: message(name) for name in names}


@contextlib.contextmanager
def standing(sim: Client) -> Iterator[None]:
    """Time stands still but for steps."""
    sim.pause()
    yield
    sim.resume()


def seconds(message: dict[str, Any]) -> float:
    stamp = message["header"]["stamp"]
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def vector(fields: dict[str, float]) -> list[float]:
    return [fields[axis] for axis in "xyz"]


def quaternion(fields: dict[str, float]) -> list[float]:
    """As the Frame has it: wxyz."""
    return [fields[axis] for axis in "wxyz"]


# -- what is published -------------------------------------------------------------------------------------------


def test_every_field_is_what_the_frame_says(stepped: tuple[Frame, dict[str, Any]]) -> None:
    frame, told = stepped
    car = frame.vehicles["V1"]
    assert told["throttle"]["data"] == pytest.approx(car.throttle)
    assert told["steering"]["data"] == pytest.approx(car.steering)
    assert car.steering > 0.1
    assert told["speed"]["data"] == pytest.approx(car.speed)
    for number, side in enumerate(("left", "right")):
        assert told[f"{side}_encoder"]["position"] == pytest.approx([car.encoders.angles[number]])
        assert told[f"{side}_encoder"]["name"] == [f"{side}_encoder"]
    assert vector(told["ips"]) == pytest.approx(car.ips.position)
    for name in ("imu", "imu/data"):
        assert quaternion(told[name]["orientation"]) == pytest.approx(car.imu.orientation)
    for name in ("imu", "imu/data", "imu/data_raw"):
        assert told[name]["header"]["frame_id"] == "imu"
        assert vector(told[name]["angular_velocity"]) == pytest.approx(car.imu.angular_velocity)
        assert vector(told[name]["linear_acceleration"]) == pytest.approx(car.imu.linear_acceleration)
    assert told["imu/data_raw"]["orientation_covariance"][0] == -1.0
    truth = told["ground_truth/odom"]
    assert vector(truth["pose"]["pose"]["position"]) == pytest.approx(car.pose.position)
    assert quaternion(truth["pose"]["pose"]["orientation"]) == pytest.approx(car.pose.orientation)
    assert vector(truth["twist"]["twist"]["linear"]) == pytest.approx(car.velocity)
    assert (truth["header"]["frame_id"], truth["child_frame_id"]) == ("map", "base_link")
    assert (told["odom"]["header"]["frame_id"], told["odom"]["child_frame_id"]) == ("odom", "base_link")
    for name in ("headlights", "indicators", "tail_lights", "left_indicator", "right_indicator", "reverse_lights"):
        assert told["lights"][name] == getattr(car.lights, name)
    for name in car.wheels.__struct_fields__:
        assert told["wheels"][name] == pytest.approx(getattr(car.wheels, name))
    wheel = dict(zip(told["joint_states"]["name"], told["joint_states"]["position"], strict=True))
    assert wheel["rear_left_wheel_joint"] == pytest.approx(car.wheels.rotation_angle[2])
    assert wheel["front_right_steering_joint"] == pytest.approx(car.wheels.steering_angle[1])


def test_each_ray_of_the_scan_is_that_of_the_frame(stepped: tuple[Frame, dict[str, Any]]) -> None:
    frame, told = stepped
    scan = frame.vehicles["V1"].lidar
    assert scan is not None
    known = {
        round(math.degrees(scan.angle_min + i * scan.angle_increment)) % 360: value
        for i, value in enumerate(scan.ranges)
    }
    assert len(known) == 360
    for name in ("lidar", "scan"):
        message = told[name]
        assert message["header"]["frame_id"] == "lidar"
        assert message["angle_min"] == pytest.approx(0.0, abs=1e-6)
        for index, value in enumerate(message["ranges"]):
            angle = round(math.degrees(message["angle_min"] + index * message["angle_increment"])) % 360
            assert value == pytest.approx(known[angle], rel=1e-6)
        assert (message["range_min"], message["range_max"]) == pytest.approx((scan.range_min, scan.range_max))
    assert np.isfinite(scan.ranges).any()


@pytest.mark.parametrize("camera", ["front", "rear"])
def test_a_picture_is_the_same_in_each_form_and_its_pinhole_is_that_of_the_lens(heard: Witness, camera: str) -> None:
    names = [name for name in TOPICS if name.startswith(f"{camera}_camera")]
    told = dict(zip(names, heard.together([f"{VEHICLE}/{name}" for name in names]), strict=True))
    raw, info = told[f"{camera}_camera/image_raw"], told[f"{camera}_camera/camera_info"]
    compressed = base64.b64decode(told[f"{camera}_camera/image_raw/compressed"]["data"])
    pixels = np.frombuffer(base64.b64decode(raw["data"]), np.uint8).reshape(raw["height"], raw["width"], 3)
    np.testing.assert_array_equal(pixels, simplejpeg.decode_jpeg(compressed))
    assert told[f"{camera}_camera"]["data"] == raw["data"]
    assert (raw["encoding"], raw["step"]) == ("rgb8", 3 * raw["width"])
    assert pixels.std() > 10.0
    assert (info["width"], info["height"]) == (raw["width"], raw["height"])
    assert info["header"]["frame_id"] == f"{camera}_camera_optical_frame"
    lens = load_vehicle("nigel").cameras[camera].intrinsics
    centre = [info["k"][2] + 0.5, info["k"][5] + 0.5]  # ROS counts from the middle of the first pixel
    assert [info["k"][0], info["k"][4], *centre] == pytest.approx([lens.fx, lens.fy, lens.cx, lens.cy])


def test_frames_stand_where_the_vehicle_and_its_sensors_are(
    stepped: tuple[Frame, dict[str, Any]], heard: Witness
) -> None:
    frame, _ = stepped
    moving = await_that(lambda: transforms(heard, "/tf", frame.time))
    still = transforms(heard, "/tf_static", None)
    assert set(moving) >= {"odom", "base_link", "rear_left_wheel"}
    car: VehicleFrame = frame.vehicles["V1"]
    w, x, y, z = car.pose.orientation
    at = moving["odom"][1] @ moving["base_link"][1]
    np.testing.assert_allclose(at, matrix(car.pose.position, (x, y, z, w)), atol=1e-9)
    assert still["nigel_1"][0] == "base_link"
    assert still["map"][0] == "world"
    np.testing.assert_allclose(still["lidar"][1][:3, 3], [0.1445, 0.0, 0.17525], atol=1e-9)  # behaviour of 2025


def transforms(heard: Witness, topic: str, at: float | None) -> dict[str, tuple[str, np.ndarray]]:
    """Frame -> its parent and its pose in it; none if they are not of that time [s]."""
    every = heard.latest(topic)["message"]["transforms"]
    if at is not None and seconds(every[0]) != pytest.approx(at, abs=1e-8):
        return {}
    placed = {}
    for one in every:
        moved, turned = one["transform"]["translation"], one["transform"]["rotation"]
        pose = matrix(vector(moved), [turned[axis] for axis in "xyzw"])
        placed[one["child_frame_id"]] = one["header"]["frame_id"], pose
    return placed


def test_types_and_qualities_are_as_announced(heard: Witness) -> None:
    known = heard.topics()
    for name, kind in TOPICS.items():
        assert known[f"{VEHICLE}/{name}"] == [kind.replace("/", "/msg/")]
    qualities = {
        f"{VEHICLE}/scan": ("BEST_EFFORT", "VOLATILE"),
        f"{VEHICLE}/imu/data": ("BEST_EFFORT", "VOLATILE"),
        f"{VEHICLE}/front_camera/image_raw": ("BEST_EFFORT", "VOLATILE"),
        f"{VEHICLE}/odom": ("RELIABLE", "VOLATILE"),
        f"{VEHICLE}/robot_description": ("RELIABLE", "TRANSIENT_LOCAL"),
        "/tf": ("RELIABLE", "VOLATILE"),
        "/tf_static": ("RELIABLE", "TRANSIENT_LOCAL"),
        "/clock": ("BEST_EFFORT", "VOLATILE"),
    }
    for topic, wanted in qualities.items():
        (one,) = heard.publishers(topic)
        assert (one["node"], one["reliability"], one["durability"]) == ("autodrive_bridge", *wanted), topic


@pytest.mark.parametrize(
    ("kind", "number"),
    [
        ("ackermann_msgs/AckermannDriveStamped", "48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf"),
        ("tf2_msgs/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
    ],
)
def test_a_stand_in_is_the_same_on_the_wire_as_the_real_package(heard: Witness, kind: str, number: str) -> None:
    (one,) = heard.publishers("/tf") if kind.startswith("tf2_msgs") else heard.readers(f"{VEHICLE}/drive")
    assert one["type"] == kind.replace("/", "/msg/")
    assert one["hash"].endswith(number)


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("ResetSimulation", "4ce285d7ff9b8ac70dcc95161f32bf54c05a6f4b13427990e41ab40c36c39646"),
        ("StepSimulation", "913fe065"),
        ("SetSimulationState", "a868b916"),
        ("GetSimulatorFeatures", "abb9439c"),
    ],
)
def test_the_services_types_are_those_of_simulation_interfaces(ros2: dict[str, str], name: str, number: str) -> None:
    """Hashes of its release 1.5.1."""
    described = BUILT / "install" / "share" / "simulation_interfaces" / "srv" / f"{name}.json"
    hashes = {one["type_name"]: one["hash_string"] for one in json.loads(described.read_text())["type_hashes"]}
    assert hashes[f"simulation_interfaces/srv/{name}"].startswith(f"RIHS01_{number}")


def test_a_node_with_use_sim_time_lives_in_simulated_time(heard: Witness, sim: Client) -> None:
    with standing(sim):
        frame = sim.step(ticks=3)
        await_that(lambda: heard.now() == pytest.approx(frame.time, abs=1e-6))


def test_who_comes_late_still_gets_the_frames_that_stand_still_and_the_description(
    ros2: dict[str, str], folder: Path, heard: Witness
) -> None:
    with witness(ros2, folder) as late:
        late.listen("/tf_static", "tf2_msgs/TFMessage", "RELIABLE", "TRANSIENT_LOCAL")
        late.listen(f"{VEHICLE}/robot_description", "std_msgs/String", "RELIABLE", "TRANSIENT_LOCAL")
        assert {"map", "nigel_1", "lidar", "imu"} <= set(transforms(late, "/tf_static", None))
        urdf = ElementTree.fromstring(late.latest(f"{VEHICLE}/robot_description")["message"]["data"])
        assert urdf.tag == "robot"


# -- commands ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("topic", "kind", "fields", "speed"),
    [
        ("throttle_command", "std_msgs/Float32", {"data": 0.6}, 0.6 * 0.44244),
        ("drive", "ackermann_msgs/AckermannDriveStamped", {"drive": {"speed": 0.2, "steering_angle": 0.3}}, 0.2),
        ("cmd_vel", "geometry_msgs/Twist", {"linear": {"x": 0.2}, "angular": {"z": 0.4}}, 0.2),
        ("cmd_vel_stamped", "geometry_msgs/TwistStamped", {"twist": {"linear": {"x": 0.2}}}, 0.2),
    ],
)
def test_a_command_drives_and_silence_stops(
    say: Callable[..., None], sim: Client, topic: str, kind: str, fields: dict[str, Any], speed: float
) -> None:
    sim.reset()
    say("steering_command", "std_msgs/Float32", {"data": 0.0})
    await_that(lambda: abs(sim.frame.vehicles["V1"].steering) < 1e-3)
    say("steering_command", "std_msgs/Float32", None)
    say(topic, kind, fields)
    await_that(lambda: sim.frame.vehicles["V1"].speed > 0.9 * speed)
    car = sim.frame.vehicles["V1"]
    assert car.speed < 1.1 * speed
    if topic == "drive":
        assert car.steering == pytest.approx(0.3, abs=0.01)
    if topic == "cmd_vel":
        angle = math.atan(0.14154 * 0.4 / 0.2)  # wheels that do not slip
        await_that(lambda: sim.frame.vehicles["V1"].steering == pytest.approx(angle, abs=1e-3))
    say(topic, kind, None)
    await_that(lambda: sim.frame.vehicles["V1"].throttle == 0.0)
    await_that(lambda: abs(sim.frame.vehicles["V1"].speed) < 0.01)


def test_lamps_obey(say: Callable[..., None], sim: Client) -> None:
    say("headlights_command", "std_msgs/Int32", {"data": 2})
    say("indicators_command", "std_msgs/Int32", {"data": 3})
    await_that(lambda: (lights := sim.frame.vehicles["V1"].lights).headlights == 2 and lights.indicators == 3)


# -- last, since the node ends --------------------------------------------------------------------------------------


def test_it_waits_for_a_simulator_that_is_started_anew_and_ends_with_ctrl_c(
    heard: Witness, node: Running, simulation: Started, sim: Client, folder: Path
) -> None:
    sim.close()
    simulation.end(signal.SIGTERM)
    await_that(lambda: "no simulator" in node.words.read_text() or "was lost" in node.words.read_text())
    again = simulator(folder, "two_cars", "--no-cameras", port=PORT)
    heard.listen("/autodrive/nigel_2/odom", "nav_msgs/Odometry", "RELIABLE")
    heard.latest("/autodrive/nigel_2/odom")
    node.process.send_signal(signal.SIGINT)
    assert node.process.wait(10.0) == 0
    assert "Traceback" not in node.words.read_text()
    again.end(signal.SIGTERM)
