"""The buffer of tf2 with the transforms of the ROS 1 bridge."""

from __future__ import annotations

from xml.etree import ElementTree
from xmlrpc.client import ServerProxy

from tests.support.ros.processes import client
from tests.support.ros.ros1 import Ros1
from tests.support.waiting import wait_until

VEHICLE = "/autodrive/nigel_1"


def test_each_scan_can_be_transformed_before_the_next_one_comes(ros1_session: Ros1) -> None:
    """The states come once a second, the scans seven times."""
    with (
        ros1_session.launch("autodrive.launch", f"port:={ros1_session.port}", "rate:=1"),
        ros1_session.probe() as probe,
    ):
        probe.transform("map", "lidar")
        # one less: the machine may be so busy that a message is late
        assert probe.join(f"{VEHICLE}/scan", "sensor_msgs/LaserScan", "map", 15) >= 14


def test_a_node_that_starts_in_a_pause_receives_transforms_and_the_description(ros1_session: Ros1) -> None:
    with ros1_session.launch("autodrive.launch", f"port:={ros1_session.port}"), client(ros1_session.port) as sim:
        messages = ros1_session.folder / "probe.txt"
        with ros1_session.probe() as early:
            others = len(messages.read_text())  # of tests before, in which a simulator was restarted
            early.transform("map", "base_link")
            early.subscribe("/clock", "rosgraph_msgs/Clock")
            time = sim.pause().time
            with ros1_session.probe() as late:
                position, _, stamp = late.transform("map", "base_link")
                assert abs(stamp - time) < 1e-6
                assert abs(position[0] - sim.frame.vehicles["V1"].pose.position[0]) < 1e-6
            early.latest("/clock", early.counts()["/clock"] + 2)  # it comes once a second
        assert "TF_REPEATED_DATA" not in messages.read_text()[others:]
        sim.resume()
        with ServerProxy(ros1_session.environment["ROS_MASTER_URI"]) as master:

            def described(name: str) -> str:
                code, _, text = master.getParam("/test", name)  # type: ignore[misc]
                return ElementTree.fromstring(str(text)).attrib["name"] if code == 1 else ""

            for name in ("/robot_description", f"{VEHICLE}/robot_description"):
                wait_until(lambda name=name: described(name) == "nigel")
