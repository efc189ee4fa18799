"""A node without ROS: records published messages, and passes messages of a test to the subscriptions.

What a node of ROS publishes is compared with what it has recorded at the same simulator.
"""

from __future__ import annotations

import base64
import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np

from autodrive.connect.ros import Bridge, Config, Message, Subscription, Time, Topic
from tests.support.waiting import wait_until


class Recorder:
    """Implements `ros.Node`. Every topic has subscribers, except those with `unsubscribed` in the name."""

    def __init__(self, unsubscribed: str = "?") -> None:
        self.topics: dict[str, Topic] = {}
        self.subscriptions: dict[str, Subscription] = {}
        self.messages: dict[str, list[Message]] = {}
        self.order: list[tuple[str, Message]] = []
        """Topic and message, as they were published."""
        self._unsubscribed = unsubscribed

    def add_topics(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        for topic in topics:
            assert topic.name not in self.topics, f"{topic.name} is created twice"
            self.topics[topic.name] = topic
        self.subscriptions |= {one.name: one for one in subscriptions}

    def has_subscribers(self, topic: Topic) -> bool:
        return topic.name in self.topics and self._unsubscribed not in topic.name

    def publish(self, message: Message, topic: Topic) -> None:
        assert message.type == topic.type
        assert topic.name in self.topics, f"{topic.name} was not created"
        self.messages.setdefault(topic.name, []).append(message)
        self.order.append((topic.name, message))

    def now(self) -> float:
        return time.time()

    def last(self, name: str) -> dict[str, Any]:
        """Fields of the latest message of a topic; the name is complete or relative to the first vehicle."""
        full = name if name in self.topics else f"autodrive/nigel_1/{name}"
        return self.messages[full][-1].fields

    def send(self, name: str, **fields: Any) -> None:
        """Pass a message to a subscription."""
        self.subscriptions[f"autodrive/{name}"].callback(SimpleNamespace(**fields))

    def agree(self, received: Callable[[str], Any], names: Iterable[str], time: float) -> None:
        """Wait until a node of ROS has published what this one has recorded, in a pause at that simulated time [s]."""
        wheels = "autodrive/nigel_1/wheels"
        wait_until(lambda: wheels in self.messages and self.last(wheels)["header"]["stamp"] == Time.of(time))
        for name in names:
            recorded = name if name in self.topics else name.removeprefix("/")
            wait_until(lambda of=recorded, name=name: not differences(self.last(of), received(name)))


@contextlib.contextmanager
def running(config: Config, node: Recorder) -> Iterator[Bridge]:
    """A bridge that is started, and closed at the end."""
    bridge = Bridge(config, node)
    bridge.start()
    try:
        yield bridge
    finally:
        bridge.close()


def differences(fields: Any, message: Any, place: str = "") -> list[str]:
    """Where a message of ROS 1 or 2, as a JSON value, differs from the fields of one of the bridge."""
    match fields:
        case Message():
            return differences(fields.fields, message, place)
        case dict():
            parts = [(value, message.get(name, message.get(name.upper())), name) for name, value in fields.items()]
        case list() if len(fields) == len(message):
            parts = [(one, other, str(number)) for number, (one, other) in enumerate(zip(fields, message, strict=True))]
        case Time(sec, nanosec):
            seconds = message["sec"] + 1e-9 * message["nanosec"] if isinstance(message, dict) else message
            parts = [(sec + 1e-9 * nanosec, seconds, "seconds")]
        case bytes():
            parts = [(base64.b64encode(fields).decode(), message, "base64")]
        case str() | list():
            return [place] if fields != message else []
        case _:
            one, other = np.asarray(fields, float), np.asarray(message, float)
            is_equal = one.shape == other.shape and np.allclose(one, other, rtol=1e-6, atol=1e-6, equal_nan=True)
            return [] if is_equal else [place]
    return [where for one, other, name in parts for where in differences(one, other, f"{place}.{name}")]
