"""A node without ROS: records published messages, and passes messages of a test to the subscriptions."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

from autodrive.connect.ros import Message, Subscription, Topic


class Recorder:
    """Implements `ros.Node`. Every topic has subscribers, except those with `unsubscribed` in the name."""

    def __init__(self, unsubscribed: str = "?") -> None:
        self.topics: dict[str, Topic] = {}
        self.subscriptions: dict[str, Subscription] = {}
        self.messages: dict[str, list[Message]] = {}
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

    def now(self) -> float:
        return time.time()

    def last(self, name: str) -> dict[str, Any]:
        """Fields of the latest message of a topic; the name is complete or relative to the first vehicle."""
        full = name if name in self.topics else f"autodrive/nigel_1/{name}"
        return self.messages[full][-1].fields

    def send(self, name: str, **fields: Any) -> None:
        """Pass a message to a subscription."""
        self.subscriptions[f"autodrive/{name}"].callback(SimpleNamespace(**fields))
