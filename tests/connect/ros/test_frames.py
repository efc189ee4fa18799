"""Frames of TF: at the mounts of the vehicle files, known when the readings arrive, and read in what is received."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from msgspec.structs import replace

import autodrive
from autodrive import Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.ros import Bridge, Config
from autodrive.connect.ros.devkit_source import DevkitSource
from autodrive.connect.ros.source import Update, VehicleInfo
from autodrive.protocol.devkit_profile import DevkitSettings
from autodrive.protocol.messages import CameraIntrinsics, LoadScenario, Pause, Pose, Reset, Resume, Step
from autodrive.protocol.native import Picture
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import find, names
from tests.connect.client.conftest import started
from tests.connect.ros.test_bridge import ROOT, Listening, seconds, send_pose, served, tree
from tests.protocol.devkit_frames import frame as frame_of
from tests.protocol.devkit_frames import scan, vehicle
from tests.support.ros.recorder import Recorder, running
from tests.support.ros.transform_tree import Matrix
from tests.support.waiting import LIMIT, free_port, wait_until

SHIPPED = sorted(
    names("vehicle"),
    key=lambda name: (name == "neoracer", not name.startswith(("nigel", "roboracer"))),  # nigel is V1, roboracer is V4
)
URDFS = {car: (ROOT / f"ros/autodrive_description/urdf/{car}.urdf").read_text() for car in ("nigel", "roboracer")}
STAMPED = ("/scan", "/lidar", "/imu", "/imu/data", "/odom", "/joint_states", "/image_raw/compressed", "/camera_info")
"""Endings of topics whose messages are transformed with TF."""


def mounts(file: Path) -> dict[str, Matrix]:
    """Poses in base_link of the sensors that a vehicle file mounts: R = Rz(yaw) Ry(pitch) Rx(roll), as it documents."""
    car = yaml.safe_load(file.read_text())
    sensors = {name: one for name, one in car["sensors"].items() if isinstance(one, dict) and "mount" in one}
    sensors |= {f"{name}_camera": one for name, one in car["cameras"].items()}
    found = {}
    for name, one in sensors.items():
        roll, pitch, yaw = np.radians(one["mount"].get("rotation_deg", (0.0, 0.0, 0.0)))
        about_z = [[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
        about_y = [[math.cos(pitch), 0.0, math.sin(pitch)], [0.0, 1.0, 0.0], [-math.sin(pitch), 0.0, math.cos(pitch)]]
        about_x = [[1.0, 0.0, 0.0], [0.0, math.cos(roll), -math.sin(roll)], [0.0, math.sin(roll), math.cos(roll)]]
        found[name] = np.eye(4)
        found[name][:3, :3] = np.array(about_z) @ about_y @ about_x
        found[name][:3, 3] = one["mount"]["position"]
    return found


@pytest.fixture(scope="module")
def moved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a RoboRacer whose LIDAR was moved and turned, and whose IMU measures gravity too."""
    car = yaml.safe_load(find("vehicle", "roboracer").read_text())
    car["sensors"]["lidar"]["mount"] = {"position": [0.1, 0.02, 0.2], "rotation_deg": [5.0, -10.0, 90.0]}
    car["sensors"]["imu"]["measures_specific_force"] = True
    file = tmp_path_factory.mktemp("vehicles") / "moved.yaml"
    file.write_text(yaml.safe_dump(car))
    return file


@pytest.fixture(scope="module")
def simulation(moved: Path) -> Iterator[Simulation]:
    """One car of each shipped type; the scenario 'moved' has only the one with the moved LIDAR."""
    cars = {f"V{i}": VehiclePlacement(type=car, y=float(i), x=2.0) for i, car in enumerate(SHIPPED, 1)}
    start = ScenarioSpec(map="plane", vehicles=cars, tick=0.025)
    other = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type=str(moved))}, tick=0.025)

    def load(name: object) -> autodrive.World:
        return started(autodrive.make(other if name == "two_cars" else start))

    with Simulation(load(""), load=load) as one:
        yield one


@pytest.fixture
def node(simulation: Simulation) -> Iterator[Recorder]:
    """Has received the states of the first vehicle."""
    simulation.request(Reset()).result(LIMIT)
    simulation.request(Resume()).result(LIMIT)
    one = Recorder()
    with served(simulation) as server, running(Config(port=server.port), one):
        wait_until(lambda: "autodrive/nigel_1/wheels" in one.messages)
        yield one


def at_their_mounts(node: Recorder, number: int, file: Path) -> bool:
    """Whether the sensors of a vehicle, by its number, are where its file says."""
    prefix = "" if number == 1 else f"{file.stem.split('_')[0]}_{number}/"
    frames = tree(node)
    wanted = mounts(file)
    assert {"imu", "lidar", "front_camera"} <= wanted.keys()
    found = [frames.pose(f"{prefix}base_link", prefix + sensor) for sensor in wanted]
    return all(np.allclose(pose, at, atol=1e-9) for pose, at in zip(found, wanted.values(), strict=True))


def test_each_vehicle_of_a_mixed_scenario_has_the_frames_and_the_description_of_its_file(node: Recorder) -> None:
    for number, car in enumerate(SHIPPED, 1):
        assert at_their_mounts(node, number, find("vehicle", car)), car
        robot = ElementTree.fromstring(node.last(f"autodrive/{car.split('_')[0]}_{number}/robot_description")["data"])
        assert robot.attrib["name"] == car
        tree_of_file = yaml.safe_load(find("vehicle", car).read_text())
        axle = tree_of_file.get("axles", {}).get("front", {}).get("x", tree_of_file["wheelbase"])
        origin = robot.find("joint[@name='front_left_steering_joint']/origin")
        assert origin is not None
        assert float(origin.attrib["xyz"].split()[0]) == axle
        for mesh in robot.iterfind("link/visual/geometry/mesh"):
            path = mesh.attrib["filename"].removeprefix("package://autodrive_description/")
            assert (ROOT / "ros" / "autodrive_description" / path).is_file()


def test_a_sensor_that_was_moved_while_the_bridge_runs_has_a_new_frame(
    node: Recorder, simulation: Simulation, moved: Path
) -> None:
    simulation.request(LoadScenario("two_cars")).result(LIMIT)
    try:
        wait_until(lambda: at_their_mounts(node, 1, moved))
        assert (
            ElementTree.fromstring(node.last("autodrive/moved_1/robot_description")["data"]).attrib["name"] == "moved"
        )
        for name in ("imu", "imu/data", "imu/data_raw"):  # gravity once, after the car has come to rest

            def upward(name: str = name) -> float:
                return node.last(f"autodrive/moved_1/{name}")["linear_acceleration"]["z"]

            wait_until(lambda upward=upward: upward() == pytest.approx(9.81, abs=0.01))
    finally:
        simulation.request(LoadScenario("mini_map")).result(LIMIT)


def test_a_given_description_that_differs_from_the_vehicle_is_named(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    node = Recorder()
    with served(simulation) as server, running(Config(port=server.port, robot_description=URDFS["nigel"]), node):
        wait_until(lambda: "autodrive/roboracer_4/robot_description" in node.messages)
    (text,) = {one for one in caplog.messages if "roboracer_4" in one}
    apart = math.dist((0.1445, 0.0, 0.17525), (0.2733, 0.0, 0.096))  # the LIDAR of Nigel and that of the RoboRacer
    assert "the given robot_description is not that of roboracer_4 in the simulator: " in text
    assert f"lidar differs by {apart:.3f} m and 0.0 degrees" in text
    assert "front_camera differs by 0.205 m and 2.7 degrees" in text  # 7.294 and 10 degrees down
    assert not [one for one in caplog.messages if "nigel_1" in one]


# -- order ---------------------------------------------------------------------------------------------------------


def late(node: Recorder) -> list[str]:
    """Topics of the messages that came before the transforms of their time, as a TF buffer finds it on arrival."""
    newest, found = -1.0, []
    for topic, message in node.order:
        if topic == "/tf":
            newest = max(seconds(one.fields["header"]["stamp"]) for one in message.fields["transforms"])
        elif topic.endswith(STAMPED) and seconds(message.fields["header"]["stamp"]) > newest:
            found.append(topic)
    return found


def test_the_transforms_of_each_scan_are_published_before_it(simulation: Simulation) -> None:
    """The scans of the RoboRacers come 40 times a second, the states at most five times."""
    node = Recorder()
    simulation.request(Resume()).result(LIMIT)
    with served(simulation) as server, running(Config(port=server.port, rate=5.0), node):
        wait_until(lambda: len(node.messages.get("autodrive/roboracer_4/scan", ())) > 40)
    topics = [topic for topic, _ in node.order]
    assert {"autodrive/nigel_1/scan", "autodrive/roboracer_4/imu/data"} <= {*topics}
    assert late(node) == []
    begin = topics.index("/tf")
    scans = [topic.endswith("roboracer_4/scan") for topic in topics[begin:]]
    assert topics[begin:].count("/tf") >= sum(scans)


def an_update(time: float) -> Update:
    """A Frame with a scan and an image of its time."""
    moment = replace(frame_of(vehicle()), time=time, tick=round(100.0 * time))
    moment = replace(moment, vehicles={"V1": moment.vehicles["red"]})
    lens = CameraIntrinsics(4, 4, 4.0, 4.0, 2.0, 2.0)
    picture = Picture("V1", "front", time, Pose(np.zeros(3), np.zeros(4)), lens, b"")
    return Update(moment, {"V1": replace(scan([1.0] * 8), time=time)}, {("V1", "front"): picture})


class Idle:
    """A bridge to no simulator, with a clock."""

    def __init__(self, **settings: Any) -> None:
        self.now = 100.0
        self.node = Recorder(unsubscribed="front_camera/image_raw_")
        self.bridge = Bridge(Config(**settings), self.node, clock=lambda: self.now)
        self.bridge.on_vehicles({"V1": VehicleInfo.of(self.bridge.config.car)})

    def topics(self) -> list[str]:
        """Of what was published since the last call."""
        topics = [topic.removeprefix("autodrive/nigel_1/") for topic, _ in self.node.order]
        self.node.order.clear()
        return topics


def test_messages_of_an_instant_come_after_its_time_and_transforms_also_if_states_are_not_due(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("autodrive.connect.ros.readings.decoded", lambda jpeg: np.zeros((4, 4, 3), np.uint8))
    idle = Idle(rate=10.0)
    idle.topics()
    states = 0
    for number in range(16):
        idle.now += 0.025
        idle.bridge.on_update(an_update(1.0 + 0.025 * number))
        assert late(idle.node) == []
        topics = idle.topics()
        assert topics[:2] == ["/clock", "/tf"]
        assert topics.count("/tf") == 1
        assert {"scan", "front_camera/image_raw/compressed", "front_camera"} <= {*topics}
        states += "odom" in topics
    assert 3 <= states <= 6, "ten in a second"


def test_in_a_pause_the_last_time_transforms_and_state_come_again_once_a_second() -> None:
    idle = Idle()
    idle.bridge.on_update(Update(an_update(1.0).frame))
    first = idle.topics()
    counts = []
    for _ in range(50):
        idle.now += 0.1
        idle.bridge.on_idle()
        again = [topic for topic in idle.topics() if topic in first]
        counts.append(len(again))
        if again:
            assert again[:2] == ["/clock", "/tf"]
            assert {"odom", "ground_truth/odom", "imu/data", "wheels", "steering"} <= {*again}
    assert sum(map(bool, counts)) in (4, 5)
    idle.bridge.on_vehicles({})
    idle.topics()
    idle.now += 2.0
    idle.bridge.on_idle()
    assert idle.topics() == [], "the state of another world is not published"


def test_a_bridge_that_starts_in_a_pause_publishes_the_state(simulation: Simulation) -> None:
    simulation.request(Pause()).result(LIMIT)
    time = simulation.request(Step(3)).result(LIMIT).time
    node = Recorder()
    with served(simulation) as server, running(Config(port=server.port), node):
        wait_until(lambda: len(node.messages.get("autodrive/nigel_1/odom", ())) > 1)  # again after a second
        assert seconds(node.last("/clock")["clock"]) == pytest.approx(time)
        assert late(node) == []


# -- poses that are received ---------------------------------------------------------------------------------------


def test_an_initial_pose_is_read_in_its_frame(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    node = Recorder()
    simulation.request(Reset()).result(LIMIT)
    simulation.request(Pause()).result(LIMIT)
    with served(simulation) as server, running(Config(port=server.port), node) as bridge:
        wait_until(lambda: bridge.frame is not None)

        def placed(frame: str, x: float, y: float, yaw: float, length: float = 1.0) -> tuple[float, float, float]:
            """Where V1 is after an initial pose."""
            send_pose(node, frame, x, y, yaw, length=length)
            place = simulation.frame.vehicles["V1"].pose
            wait_until(
                lambda: (
                    bridge.frame is not None and np.allclose(bridge.frame.vehicles["V1"].pose.position, place.position)
                )
            )
            return (*place.position[:2].tolist(), 2.0 * math.atan2(place.orientation[3], place.orientation[0]))

        assert placed("map", 1.0, -2.0, math.pi / 2) == pytest.approx((1.0, -2.0, math.pi / 2), abs=1e-6)
        assert placed("base_link", 0.5, 0.25, 0.1) == pytest.approx((0.75, -1.5, math.pi / 2 + 0.1), abs=1e-6)
        assert placed("", 3.0, 1.0, 0.0) == pytest.approx((3.0, 1.0, 0.0), abs=1e-6)
        # odom began at x = 2, y = 1, along x
        assert placed("odom", -1.0, 0.0, 0.5, length=2.0) == pytest.approx((2.0, 1.0, 0.5), abs=1e-3)
        other = mounts(find("vehicle", SHIPPED[1]))["lidar"][:2, 3] + (2.0, 2.0)
        assert placed(f"{SHIPPED[1].split('_')[0]}_2/lidar", 1.0, 0.5, 0.0)[:2] == pytest.approx(
            (other[0] + 1.0, other[1] + 0.5), abs=1e-3
        )
        before = placed("map", 0.0, 0.0, 0.0)
        for frame, length, complaint in (
            ("laser", 1.0, "the frame 'laser' is not known. Known: map, nigel_1"),
            ("map", 0.0, "the orientation x 0, y 0, z 0, w 0 is not a rotation: set w to 1 for no rotation"),
            ("map", math.nan, "is not a rotation"),
        ):
            assert placed(frame, 5.0, 5.0, 1.0, length) == before
            assert complaint in caplog.text


# -- devkit mode ---------------------------------------------------------------------------------------------------


def telemetry(rays: int) -> dict[str, str]:
    return {"V1 Position": "0 0 0", "V1 LIDAR Range Array": " ".join(["1.0"] * rays)}


def answered(config: Config, rays: int) -> Listening:
    listener = Listening()
    source = DevkitSource(config, lambda: 1.0, dict, sleep=lambda _: None)
    for _ in range(3):
        source.respond(telemetry(rays), listener)
    return listener


@pytest.mark.parametrize(
    ("settings", "rays", "car"),
    [
        ({"profile": "2023"}, 360, "nigel"),
        ({"profile": "2023", "vehicle_type": "roboracer"}, 1080, "roboracer"),
        ({"profile": "roboracer"}, 1081, "roboracer"),
        ({"profile": "roboracer", "vehicle_type": "f1tenth"}, 1080, "roboracer"),
    ],
)
def test_in_devkit_mode_profile_and_vehicle_type_select_the_car(settings: dict[str, Any], rays: int, car: str) -> None:
    config = Config(mode="devkit", **settings)
    assert config.car.name == car
    assert answered(config, rays).warnings == []


def test_in_devkit_mode_a_pause_is_no_end(simulation: Simulation) -> None:
    simulation.request(Reset()).result(LIMIT)
    simulation.request(Pause()).result(LIMIT)
    node, port = Recorder(), free_port()
    with (
        running(Config(mode="devkit", port=port, robot_description=URDFS["nigel"]), node),
        DevkitBridge(simulation, port=port, settings=DevkitSettings(profile="2025")),
    ):
        wait_until(lambda: len(node.messages.get("autodrive/nigel_1/odom", ())) > 1)
    assert late(node) == []


def test_in_devkit_mode_another_car_is_reported_once() -> None:
    listener = answered(Config(mode="devkit", profile="2023"), 1080)
    (warning,) = listener.warnings
    assert warning.startswith(
        "V1 has a LIDAR with 1080 rays, but a nigel has a LIDAR with 360 rays: V1 is not a nigel."
    )
    assert warning.endswith("Set vehicle_type to 'neoracer' or 'nigel' or 'roboracer', or use the mode 'direct'")
