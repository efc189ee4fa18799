"""A node without ROS: keeps what is published, and lets a test speak on the topics that are subscribed."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

from autodrive.ros import Message, Subscription, Topic


class Recorder:
    """Reads every topic but those of `unread`."""

    def __init__(self, unread: str = "?") -> None:
        self.topics: dict[str, Topic] = {}
        self.subscriptions: dict[str, Subscription] = {}
        self.messages: dict[str, list[Message]] = {}
        self._unread = unread

    def open(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        for topic in topics:
            assert topic.name not in self.topics, f"{topic.name} is opened twice"
            self.topics[topic.name] = topic
        self.subscriptions |= {one.name: one for one in subscriptions}

    def has_readers(self, topic: Topic) -> bool:
        return topic.name in self.topics and self._unread not in topic.name

    def publish(self, message: Message, topic: Topic) -> None:
        assert message.type == topic.type
        assert topic.name in self.topics, f"{topic.name} was never opened"
        self.messages.setdefault(topic.name, []).append(message)

    def now(self) -> float:
        return time.time()

    def last(self, name: str) -> dict[str, Any]:
        """Fields of the latest message of a topic, by its name in full or after the first vehicle's root."""
        full = name if name in self.topics else f"autodrive/nigel_1/{name}"
        return self.messages[full][-1].fields

    def say(self, name: str, **fields: Any) -> None:
        self.subscriptions[f"autodrive/{name}"].take(SimpleNamespace(**fields))
