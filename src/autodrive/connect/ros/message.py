"""Interface between the bridge and a ROS node: topics, subscriptions, and messages as plain fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

from autodrive.protocol.channels import RosQos, RosTopic

Topic: TypeAlias = RosTopic

Fields: TypeAlias = dict[str, Any]
"""Field -> number, text, bytes (uint8[]), numpy array (float32[], float64[], ...), `Time`, `Fields` of a nested
message, or a list of texts or `Message`s. Names are those of ROS 2; in ROS 1, CameraInfo has D, K, R, P."""


class Time(NamedTuple):
    """A time stamp."""

    sec: int
    nanosec: int

    @staticmethod
    def of(seconds: float) -> Time:
        """The message of a time [s], at least 0, rounded to nanoseconds."""
        sec, nanosec = divmod(round(seconds * 1e9), 1_000_000_000)
        return Time(sec, nanosec)


class Message(NamedTuple):
    """A message; `type` is for example 'sensor_msgs/LaserScan' for both generations of ROS."""

    type: str
    fields: Fields


@dataclass(frozen=True)
class Subscription:
    """A subscribed topic: `callback` is called with each message, from any thread."""

    name: str
    type: str
    text: str
    callback: Callable[[Any], None]
    qos: RosQos = "command"


class Node(Protocol):
    """What the bridge needs from a ROS node."""

    def add_topics(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        """Create publishers and subscribers; topics whose message type is not installed are left out."""
        ...

    def has_subscribers(self, topic: Topic) -> bool:
        """Whether the topic has subscribers; messages are built only for these topics."""
        ...

    def publish(self, message: Message, topic: Topic) -> None:
        """Publish a message."""
        ...

    def now(self) -> float:
        """Wall time of the node [s]: the stamp of data that has no time of its own."""
        ...
