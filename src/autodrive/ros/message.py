"""What is said to a ROS node and by one: topics, messages as plain fields, and what a subscription does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

Quality: TypeAlias = Literal["sensor", "state", "latched", "clock", "tf"]
"""How a topic is carried: 'sensor' and 'clock' may lose messages, 'latched' keeps the last for who comes later."""

Fields: TypeAlias = dict[str, Any]
"""Field -> number, text, bytes (of uint8[]), numpy array (of float32[], float64[], ...), `Time`, `Fields` of the
message inside, or a list of texts or of `Message`. Names are those of ROS 2; in ROS 1 CameraInfo has D, K, R, P."""


class Time(NamedTuple):
    """A stamp."""

    sec: int
    nanosec: int

    @staticmethod
    def of(seconds: float) -> Time:
        """Of a time [s] at or after 0, to the nanosecond."""
        sec, nanosec = divmod(round(seconds * 1e9), 1_000_000_000)
        return Time(sec, nanosec)


class Message(NamedTuple):
    """A message of that type, for example 'sensor_msgs/LaserScan', whatever the generation of ROS."""

    type: str
    fields: Fields


@dataclass(frozen=True)
class Topic:
    """A topic that is published. `name` is relative unless it begins with a slash; `text` says what is in it."""

    name: str
    type: str
    text: str
    quality: Quality = "state"


@dataclass(frozen=True)
class Subscription:
    """A topic that is read: `take` is called with each message, from any thread."""

    name: str
    type: str
    text: str
    take: Callable[[Any], None]


class Node(Protocol):
    """What the bridge needs of ROS."""

    def open(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        """Make the publishers and subscribers; those whose type is not installed are left out."""
        ...

    def has_readers(self, topic: Topic) -> bool:
        """Whether somebody reads that topic: what nobody reads is not made."""
        ...

    def publish(self, message: Message, topic: Topic) -> None:
        """Send it."""
        ...

    def now(self) -> float:
        """The node's wall time [s]: the stamp of what comes without a time."""
        ...
