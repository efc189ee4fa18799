"""The ROS bridge in the profile of the RoboRacer league: topics, frames and resets, in both modes, without ROS."""

from __future__ import annotations

import itertools
import math
import queue
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import autodrive
from autodrive import Command, Frame, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.ros import Bridge, Config, Message, Time, Topic
from autodrive.connect.ros.source import VehicleInfo
from autodrive.connect.ros.vehicle_publisher import VehiclePublisher
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import Pause, RaceState, RaceStatus, Reset, Resume, SetDrivingMode, Step
from autodrive.run import race as races
from autodrive.run.race import RaceOptions
from autodrive.run.runner import Run, RunObserver
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import find
from autodrive.world.observer import Request
from tests.connect.bridge.conftest import Resets
from tests.connect.client.conftest import started
from tests.connect.ros.test_bridge import ROOT, seconds, served, vector
from tests.protocol.devkit_frames import vehicle as still_vehicle
from tests.support.ros.recorder import Recorder, running
from tests.support.ros.transform_tree import Tree, matrix
from tests.support.waiting import LIMIT, free_port, wait_until

CAR = "autodrive/roboracer_1"
ALLOWED = {
    "lidar": "sensor_msgs/LaserScan",
    "front_camera": "sensor_msgs/Image",
    "imu": "sensor_msgs/Imu",
    "left_encoder": "sensor_msgs/JointState",
    "right_encoder": "sensor_msgs/JointState",
    "steering": "std_msgs/Float32",
    "throttle": "std_msgs/Float32",
}
RESTRICTED = {
    "ips": "geometry_msgs/Point",
    "odom": "nav_msgs/Odometry",
    "lap_count": "std_msgs/Int32",
    "lap_time": "std_msgs/Float32",
    "last_lap_time": "std_msgs/Float32",
    "best_lap_time": "std_msgs/Float32",
    "collision_count": "std_msgs/Int32",
}
COMMANDS = {f"{CAR}/throttle_command": "std_msgs/Float32", f"{CAR}/steering_command": "std_msgs/Float32"}
RESET = "autodrive/reset_command"
URDF = (ROOT / "ros/autodrive_description/urdf/roboracer.urdf").read_text()


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    places = {name: VehiclePlacement(type="roboracer", y=y) for name, y in (("V1", 0.0), ("V2", 2.0))}
    spec = ScenarioSpec(vehicles=places, boxes={"box": BoxSpec(x=3.0, y=0.5, size=(0.3, 0.3, 0.3))}, tick=0.025)
    with Simulation(started(autodrive.make(spec))) as one:
        yield one


@pytest.fixture(scope="module")
def server(simulation: Simulation) -> Iterator[SimulationServer]:
    with served(simulation) as one:
        yield one


@pytest.fixture(autouse=True)
def fresh(simulation: Simulation) -> None:
    simulation.request(Reset()).result(LIMIT)
    simulation.request(Resume()).result(LIMIT)
    for name in simulation.frame.vehicles:
        simulation.request(SetDrivingMode(name, True)).result(LIMIT)


def topics(mode: str, **settings: object) -> Recorder:
    node = Recorder()
    Bridge(Config(mode=mode, profile="roboracer", **settings), node)  # type: ignore[arg-type]
    return node


@pytest.mark.parametrize("mode", ["direct", "devkit"])
def test_the_topics_are_those_of_the_league_and_at_race_time_those_that_a_team_may_use(mode: str) -> None:
    for race, shown in ((False, ALLOWED | RESTRICTED), (True, ALLOWED)):
        node = topics(mode, race=race)
        types = {name: topic.type for name, topic in node.topics.items()}
        common = {} if race else {"/tf": "tf2_msgs/TFMessage"}
        assert types == {f"{CAR}/{name}": type_ for name, type_ in shown.items()} | common | {
            "/clock": "rosgraph_msgs/Clock"
        }
        resets = {} if race else {RESET: "std_msgs/Bool"}
        assert {name: one.type for name, one in node.subscriptions.items()} == COMMANDS | resets
        assert {topic.qos for name, topic in node.topics.items() if name.startswith("autodrive")} == {"league"}
        assert {one.qos for one in node.subscriptions.values()} == {"league"}


def test_a_parameter_sets_the_names_of_older_releases() -> None:
    assert "autodrive/f1tenth_1/lidar" in topics("direct", vehicle_type="f1tenth").topics


def test_readings_and_frames_are_those_of_the_league(simulation: Simulation, server: SimulationServer) -> None:
    node = Recorder()
    with running(Config(port=server.port, profile="roboracer", robot_description=URDF), node):
        wait_until(lambda: f"{CAR}/odom" in node.messages)
        simulation.request(Pause()).result(LIMIT)
        frame = simulation.request(Step(20, {"V1": Command(0.1, 0.5)})).result(LIMIT)
        wait_until(lambda: seconds(node.last(f"{CAR}/odom")["header"]["stamp"]) == pytest.approx(frame.time))
        wait_until(lambda: tree(node).pose("world", "roboracer_1")[0, 3] == frame.vehicles["V1"].ips.position[0])
        check(frame, node, 1e-9)
        assert node.last(f"{CAR}/imu")["angular_velocity_covariance"][0] == 0.0025
        lidar = frame.vehicles["V1"].lidar
        assert lidar is not None
        wait_until(lambda: node.last(f"{CAR}/lidar")["ranges"] == pytest.approx(lidar.ranges.astype(np.float32)))
    assert "autodrive/roboracer_2/lidar" in node.messages
    assert tree(node).pose("world", "roboracer_2/lidar")[1, 3] == pytest.approx(2.0, abs=1e-3)


def check(frame: Frame, node: Recorder, tolerance: float) -> None:
    """Compare the messages with a Frame."""
    car = frame.vehicles["V1"]
    odom, scan = node.last(f"{CAR}/odom"), node.last(f"{CAR}/lidar")
    assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("world", "roboracer_1")
    assert vector(odom["pose"]["pose"]["position"]) == pytest.approx(car.ips.position, abs=tolerance)
    centre_of_mass = 0.15532, 0.00008, 0.01434  # the league's program sends its velocity
    velocity = car.velocity + np.cross(car.angular_velocity, centre_of_mass)
    assert vector(odom["twist"]["twist"]["linear"]) == pytest.approx(velocity, abs=tolerance)
    assert odom["twist"]["twist"]["linear"]["x"] > 0.1
    assert vector(node.last(f"{CAR}/ips")) == pytest.approx(car.ips.position, abs=tolerance)
    names = ("lidar", "imu", "left_encoder", "right_encoder")
    assert [node.last(f"{CAR}/{name}")["header"]["frame_id"] for name in names] == [*names]
    assert node.last(f"{CAR}/right_encoder")["name"] == ["right_encoder"]
    assert (scan["angle_min"], scan["angle_increment"]) == pytest.approx((-2.35619449, 0.00436332), abs=1e-8)
    assert (scan["range_min"], scan["range_max"], len(scan["ranges"])) == (0.06, 10.0, 1081)
    assert np.isfinite(scan["ranges"]).sum() > 10, "the box"
    assert node.last(f"{CAR}/collision_count")["data"] == node.last(f"{CAR}/lap_count")["data"] == 0
    truth = matrix(car.ips.position, np.roll(car.imu.orientation, -1))
    frames = tree(node)
    assert frames.pose("world", "roboracer_1") == pytest.approx(truth, abs=max(2.0 * tolerance, 1e-6))
    for name, place in (("lidar", (0.2733, 0.0, 0.096)), ("imu", (0.08, 0.0, 0.055))):
        assert frames.pose("roboracer_1", name)[:3, 3] == pytest.approx(place)
    assert frames.pose("roboracer_1", "front_left_wheel")[:3, 3] == pytest.approx((0.330, 0.118, 0.010))
    assert {"left_encoder", "front_camera", "rear_right_wheel"} <= {one.child for one in links(node)}


def tree(node: Recorder) -> Tree:
    return Tree(Message("", node.last("/tf")))


def links(node: Recorder) -> list[SimpleNamespace]:
    return [SimpleNamespace(child=one.fields["child_frame_id"]) for one in node.last("/tf")["transforms"]]


def test_the_league_s_simulator_may_connect_instead(simulation: Simulation) -> None:
    """In devkit mode: all keys of the league become messages, and the answers have its three keys for each car."""
    node, port = Recorder(), free_port()
    config = Config(mode="devkit", port=port, profile="roboracer", robot_description=URDF)
    with running(config, node), DevkitBridge(simulation, port=port, vehicle_profile=lambda: "roboracer") as devkit:

        def driven() -> bool:
            node.send("roboracer_1/throttle_command", data=0.1)
            return simulation.frame.vehicles["V1"].speed > 0.2 and f"{CAR}/lidar" in node.messages

        wait_until(driven)
        frame = simulation.request(Pause()).result(LIMIT)
        x = frame.vehicles["V1"].ips.position[0]
        wait_until(lambda: tree(node).pose("world", "roboracer_1")[0, 3] == pytest.approx(x, abs=1e-4))
        check(frame, node, 6e-5)  # four decimals
        assert node.last(f"{CAR}/front_camera")["header"]["frame_id"] == "front_camera"
        assert node.last("autodrive/roboracer_2/ips")["y"] == pytest.approx(2.0, abs=1e-3)
        assert (devkit.counters.profile, devkit.counters.refused_values) == ("roboracer", 0)


class SlowDriver(Recorder):
    """A node with a driver in a thread of its own, which needs longer for a scan than a tick of a race in lock-step.

    Its commands are numbered.
    """

    def __init__(self) -> None:
        super().__init__()
        self.scans: queue.SimpleQueue[bool] = queue.SimpleQueue()

    def publish(self, message: Message, topic: Topic) -> None:
        super().publish(message, topic)
        if topic.name == f"{CAR}/lidar":
            self.scans.put(True)

    def drive(self) -> None:
        for number in itertools.count(1):
            if not self.scans.get():
                return
            time.sleep(0.03)
            self.send("roboracer_1/throttle_command", data=0.05)
            self.send("roboracer_1/steering_command", data=1e-3 * number)


class Given(RunObserver):
    """The steering that the world of a race is given, in each tick."""

    def __init__(self) -> None:
        self.steering: list[float] = []

    def started(self, run: Run) -> None:
        run.simulation.add_observer(self)

    def given(self, commands: Mapping[str, Command]) -> None:
        self.steering += [command.steering for command in commands.values()]

    def executed(self, request: Request) -> None:
        pass

    def publish(self, frame: Frame) -> None:
        pass


def test_in_lock_step_each_tick_waits_for_the_command_that_follows_its_scan(tmp_path: Path) -> None:
    rules = yaml.safe_load(find("ruleset", "league_2026").read_text()) | {"time_limit": 1.0}
    (tmp_path / "rules.yaml").write_text(yaml.safe_dump(rules))
    node, port, given = SlowDriver(), free_port(), Given()
    driver = threading.Thread(target=node.drive)
    driver.start()
    with running(Config(mode="devkit", port=port, profile="roboracer", race=True, lockstep=True), node):
        options = RaceOptions(
            "practice", (("127.0.0.1", port),), rules=str(tmp_path / "rules.yaml"), is_lockstep=True, has_page=False
        )
        result = races.race(options, observer=given)
    node.scans.put(False)
    driver.join()
    assert not result.notes
    assert len(given.steering) == 40
    assert given.steering == pytest.approx([1e-3 * number for number in range(1, 41)])


@pytest.mark.parametrize("mode", ["direct", "devkit"])
def test_a_reset_that_is_held_resets_once(simulation: Simulation, server: SimulationServer, mode: str) -> None:
    node, port = Recorder(), server.port if mode == "direct" else free_port()
    devkit = DevkitBridge(simulation, port=port, vehicle_profile=lambda: "roboracer")
    resets = Resets()
    simulation.add_sink(resets)
    with running(Config(mode=mode, port=port, profile="roboracer"), node):  # type: ignore[arg-type]
        if mode == "devkit":
            devkit.start()
        wait_until(lambda: f"{CAR}/ips" in node.messages)
        wait_until(lambda: simulation.frame.time > 1.0)
        for count in (1, 2):
            hold(node, True)
            wait_until(lambda count=count: resets.count == count)
            hold(node, False)
            wait_until(lambda: simulation.frame.time > 1.0)  # the devkit bridge resets every 0.5 s at most
    devkit.close()
    simulation.remove_sink(resets)
    assert resets.count == 2


def hold(node: Recorder, is_held: bool) -> None:
    """Send the reset for 20 messages of the bridge, as a publisher with a rate does."""
    until = len(node.messages[f"{CAR}/ips"]) + 20

    def is_over() -> bool:
        node.send("reset_command", data=is_held)
        return len(node.messages[f"{CAR}/ips"]) >= until

    wait_until(is_over)


def test_laps_are_those_of_the_race() -> None:
    node, config = Recorder(), Config(profile="roboracer")
    Bridge(config, node)  # creates the topics
    publisher = VehiclePublisher(config, VehicleInfo.of(config.car), node)
    counts = itertools.count(2)
    race = RaceState(
        RaceStatus.RACING, next(counts), 12, 3.5, 9.25, 9.0, 20.0, 10.0, next(counts), 4, 5.0, 1, 0.0, False
    )
    publisher.publish(Time(1, 0), still_vehicle(race=race, collision_count=9))
    names = ("lap_count", "lap_time", "last_lap_time", "best_lap_time", "collision_count")
    assert [node.last(f"{CAR}/{name}")["data"] for name in names] == [2, 3.5, 9.25, 9.0, 3]
    race = RaceState(RaceStatus.RACING, 0, 12, 3.5, math.inf, math.inf, 3.5, 0.0, 0, 4, 5.0, 1, 0.0, False)
    publisher.publish(Time(2, 0), still_vehicle(race=race))
    assert [node.last(f"{CAR}/{name}")["data"] for name in names[:4]] == [0, 3.5, math.inf, math.inf]
