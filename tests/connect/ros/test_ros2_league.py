"""The ROS 2 node in the profile of the RoboRacer league under rclpy: topics with types and QoS, driving, race time."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from autodrive import Frame
from autodrive.run.race import RaceOptions, race
from autodrive.run.runner import Run, RunObserver
from tests.connect.ros.test_league import ALLOWED, CAR, COMMANDS, RESET, RESTRICTED
from tests.support.ros.processes import Probe, Program, client, simulator
from tests.support.ros.ros2 import bridge, probe
from tests.support.waiting import LIMIT, free_port, wait_until

SCENARIO = "vehicles: {V1: {type: roboracer}, V2: {type: roboracer, y: 2.0}}\ntick: 0.025\n"
QOS = """
import json
from autodrive_ros2.qos import QOS
from rclpy.qos import QoSProfile
one = QOS["league"]
print(json.dumps([one.reliability.name, one.history.name, one.depth, one.durability.name]))
"""


class Watcher(RunObserver):
    """Keeps Frames of a run."""

    def __init__(self, frames: list[Frame]) -> None:
        self._frames = frames

    def running(self, run: Run) -> None:
        self._frames.append(run.simulation.frame)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("league")


@pytest.fixture(scope="module")
def port(folder: Path) -> Iterator[int]:
    """Of a simulator with two cars."""
    file, port = folder / "race.yaml", free_port()
    file.write_text(SCENARIO)
    one = simulator(folder, str(file), "--no-cameras", port=port)
    try:
        yield port
    finally:
        one.stop(signal.SIGTERM)


@pytest.fixture(scope="module")
def ros(ros2_environment: dict[str, str], folder: Path) -> Iterator[Probe]:
    with probe(ros2_environment, folder) as one:
        yield one


def started(environment: dict[str, str], folder: Path, port: int, ros: Probe, **settings: object) -> Program:
    """The node, once its topics are known."""
    node = bridge(environment, folder, port=port, profile="roboracer", **settings)
    wait_until(lambda: ros.publishers(f"/{CAR}/lidar"))
    return node


def kinds(endpoints: list[dict[str, str]]) -> list[tuple[str, ...]]:
    """Node, reliability and durability: the name of a node may be found after its topics."""
    return [(one["node"], one["reliability"], one["durability"]) for one in endpoints]


def test_the_node_has_the_interface_of_the_league(
    ros2_environment: dict[str, str], folder: Path, port: int, ros: Probe
) -> None:
    command = ["python", "-c", QOS]
    printed = subprocess.run(command, env=ros2_environment, capture_output=True, text=True, check=True).stdout
    assert json.loads(printed) == ["RELIABLE", "KEEP_LAST", 1, "VOLATILE"]
    with started(ros2_environment, folder, port, ros), client(port) as sim:
        commands = COMMANDS | {RESET: "std_msgs/Bool"}
        expected = [("autodrive_bridge", "RELIABLE", "VOLATILE")]
        names = {f"/{CAR}/{name}" for name in ALLOWED | RESTRICTED} | {f"/{name}" for name in commands}
        wait_until(lambda: names <= {*ros.topics()})  # each is found on its own
        known = ros.topics()
        for name, kind in (ALLOWED | RESTRICTED).items():
            assert known[f"/{CAR}/{name}"] == [kind.replace("/", "/msg/")]
            wait_until(lambda name=name: kinds(ros.publishers(f"/{CAR}/{name}")) == expected)
        for name, kind in commands.items():
            assert known[f"/{name}"] == [kind.replace("/", "/msg/")]
            wait_until(lambda name=name: kinds(ros.subscribers(f"/{name}")) == expected)
        for name in ("lidar", "odom", "lap_count"):
            ros.subscribe(f"/{CAR}/{name}", (ALLOWED | RESTRICTED)[name], "RELIABLE")
        ros.subscribe("/autodrive/roboracer_2/ips", "geometry_msgs/Point", "RELIABLE")
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", {"data": 0.05})
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.5)
        wait_until(lambda: ros.latest(f"/{CAR}/odom")["message"]["twist"]["twist"]["linear"]["x"] > 0.5)
        odom = ros.latest(f"/{CAR}/odom")["message"]
        assert (odom["header"]["frame_id"], odom["child_frame_id"]) == ("world", "roboracer_1")
        assert len(ros.latest(f"/{CAR}/lidar")["message"]["ranges"]) == 1081
        assert ros.latest(f"/{CAR}/lap_count")["message"] == {"data": 0}
        assert ros.latest("/autodrive/roboracer_2/ips")["message"]["y"] == pytest.approx(2.0, abs=1e-3)
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", None)
        wait_until(lambda: sim.wait().time > 1.0)
        ros.publish(f"/{RESET}", "std_msgs/Bool", {"data": True})  # at 20 Hz
        wait_until(lambda: sim.wait().time < 0.5)
        wait_until(lambda: sim.wait().time > 1.0)  # it was reset once
        ros.publish(f"/{RESET}", "std_msgs/Bool", None)


def test_at_race_time_a_team_sees_what_it_may_use(
    ros2_environment: dict[str, str], folder: Path, port: int, ros: Probe
) -> None:
    wait_until(lambda: not ros.publishers(f"/{CAR}/lidar"))  # the node of the other test has left
    with started(ros2_environment, folder, port, ros, race=True), client(port) as sim:
        ros.subscribe(f"/{CAR}/imu", "sensor_msgs/Imu", "RELIABLE")
        ros.latest(f"/{CAR}/imu")
        expected = {f"/autodrive/roboracer_{number}/{name}" for number in (1, 2) for name in ALLOWED}

        def shown() -> set[str]:
            names = (name for name in ros.topics() if name.startswith("/autodrive/"))
            return {name for name in names if any(one[0] != "probe" for one in kinds(ros.publishers(name)))}

        wait_until(lambda: expected <= shown())
        assert shown() == expected
        assert not ros.publishers("/tf")
        assert not ros.subscribers(f"/{RESET}")
        assert not [name for name in ros.services() if "simulation" in name or "entit" in name]
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", {"data": 0.05})
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.5)
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", None)


def test_a_team_races_with_its_ros_2_nodes(ros2_environment: dict[str, str], folder: Path, ros: Probe) -> None:
    """The node stands for the bridge of the league's devkit: a server that the simulator of the race connects to."""
    wait_until(lambda: not ros.publishers(f"/{CAR}/lidar"))  # the node of the other test has left
    port, rules = free_port(), folder / "rules.yaml"
    rules.write_text("{race_laps: 1, time_limit: 8.0, withheld: [position, velocity, laps, collisions]}")
    options = RaceOptions("practice", (("127.0.0.1", port),), rules=str(rules), has_page=False)
    with (
        bridge(ros2_environment, folder, port=port, mode="devkit", profile="roboracer", race=True),
        ThreadPoolExecutor() as pool,
    ):
        wait_until(lambda: ros.subscribers(f"/{CAR}/throttle_command"))
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", {"data": 0.04})
        seen: list[Frame] = []
        running = pool.submit(race, options, observer=Watcher(seen))
        ros.subscribe(f"/{CAR}/lidar", "sensor_msgs/LaserScan", "RELIABLE")
        assert len(ros.latest(f"/{CAR}/lidar")["message"]["ranges"]) == 1081
        names = {name for name in ros.topics() if ros.publishers(name) and name.startswith(f"/{CAR}/")}
        (standing,) = running.result(LIMIT).standings
        ros.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", None)
    assert names - {f"/{name}" for name in COMMANDS} == {f"/{CAR}/{name}" for name in ALLOWED}
    assert standing.reason == "not finished after 8 s"
    assert max(frame.vehicles["V1"].speed for frame in seen) > 0.5
