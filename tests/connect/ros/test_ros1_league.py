"""The ROS 1 node in the profile of the RoboRacer league with roslaunch: topics, driving, race time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pytest

from tests.connect.ros.test_league import ALLOWED, CAR, COMMANDS, RESET, RESTRICTED
from tests.support.ros.processes import client
from tests.support.ros.ros1 import Ros1
from tests.support.waiting import wait_until


@pytest.mark.parametrize("race", [False, True])
def test_the_launch_file_has_the_interface_of_the_league(ros1_session: Ros1, race: bool) -> None:
    """The simulator has Nigel: the names of the league are set by the profile."""
    arguments = (f"port:={ros1_session.port}", "profile:=roboracer", f"race:={str(race).lower()}")
    expected = {f"/{CAR}/{name}": kind for name, kind in (ALLOWED if race else ALLOWED | RESTRICTED).items()}
    with (
        ros1_session.launch("simulator_bringup_headless.launch", *arguments),
        ros1_session.probe() as probe,
        client(ros1_session.port) as sim,
    ):
        wait_until(lambda: expected.items() <= probe.topics().items())
        probe.subscribe(f"/{CAR}/lidar", "sensor_msgs/LaserScan")
        probe.latest(f"/{CAR}/lidar")
        assert of_the_bridge(probe.publications()) - {"/clock", "/tf", "/rosout"} == {*expected}
        assert ("/tf" in of_the_bridge(probe.publications())) is not race
        commands = [*COMMANDS] if race else [*COMMANDS, RESET]
        assert of_the_bridge(probe.subscriptions()) == {f"/{name}" for name in commands}
        sim.reset()  # earlier tests may have driven the car against a wall
        probe.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", 0.6)
        wait_until(lambda: sim.wait().vehicles["V1"].speed > 0.1)
        probe.publish(f"/{CAR}/throttle_command", "std_msgs/Float32", None)


def of_the_bridge(nodes: Mapping[str, Sequence[str]]) -> set[str]:
    """The topics of the bridge node."""
    return {topic for topic, names in nodes.items() if "/autodrive_ros_bridge" in names}
