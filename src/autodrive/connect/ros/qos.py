"""QoS of the topics in ROS 2: one table for the live node and for exported bags."""

from __future__ import annotations

from typing import NamedTuple

from autodrive.protocol.channels import RosQos


class Qos(NamedTuple):
    """Quality of service of a topic.

    All topics are reliable, because subscribers with the default QoS get nothing from a publisher that is not.
    """

    depth: int
    """Number of the last messages that are kept."""
    is_latched: bool = False
    """Whether late subscribers get them: transient local in ROS 2, latching in ROS 1."""


QOS: dict[RosQos, Qos] = {
    "sensor": Qos(5),
    "state": Qos(10),
    "latched": Qos(1, is_latched=True),
    "clock": Qos(1),
    "tf": Qos(100),
    "command": Qos(10),
    "league": Qos(1),
}
"""Quality of service by the class of a topic."""
