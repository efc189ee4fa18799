"""A ROS 2 node for the tests: JSON lines [method, arguments] in, JSON lines with results out.

It is independent of this project: it subscribes, publishes and calls services with rclpy. Everything that changes a
node runs in the thread of the executor: rclpy may lose messages for good if another thread does it.
"""

# pyright: reportMissingImports=false

import array
import base64
import importlib
import json
import os
import sys
import threading
import traceback

import numpy as np
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def plain(value):
    """A message as a JSON value."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, array.array) and value.typecode == "B":
        return base64.b64encode(value.tobytes()).decode()
    if isinstance(value, bytes | np.bytes_):
        return value[0]
    if isinstance(value, np.ndarray | array.array):
        return value.tolist()
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def fill(message, values):
    """Set fields, also nested ones and lists of messages."""
    for name, value in values.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            kind = message.get_fields_and_field_types()[name].removeprefix("sequence<").removesuffix(">")
            setattr(message, name, [fill(class_of(kind)(), one) for one in value])
        else:
            setattr(message, name, value)
    return message


def class_of(kind, of="msg"):
    package, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.{of}"), name)


def plain_endpoint(one):
    return {
        "node": one.node_name,
        "type": one.topic_type,
        "hash": str(one.topic_type_hash),
        "reliability": one.qos_profile.reliability.name,
        "durability": one.qos_profile.durability.name,
    }


class Probe:
    """Methods without a leading underscore can be called by name."""

    def __init__(self):
        self._node = rclpy.create_node("probe")
        self._simulated = rclpy.create_node(
            "simulated", parameter_overrides=[Parameter("use_sim_time", Parameter.Type.BOOL, True)]
        )
        self._messages = {}
        self._counts = {}
        self._by_stamp = {}
        self._sent = {}
        self._subscriptions = {}
        self._publishers = {}
        self._published_messages = {}
        self._condition = threading.Condition()
        self._node.create_timer(0.05, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._executor.add_node(self._simulated)
        threading.Thread(target=self._spin, daemon=True).start()

    def subscribe(self, topic, kind, reliability="BEST_EFFORT", durability="VOLATILE"):
        qos = QoSProfile(depth=20, reliability=ReliabilityPolicy[reliability], durability=DurabilityPolicy[durability])
        callback = lambda message: self._on_message(message, topic)  # noqa: E731
        create = self._node.create_subscription
        self._subscriptions[topic] = self._in_executor(create, class_of(kind), topic, callback, qos)

    def record(self, topic, kind, depth=10):
        """Subscribe, reliably as by default; from now on, keep the stamp of each message and when it was sent [ns]."""
        sent = self._sent[topic] = []

        def note(message, info):
            stamped = message.transforms[0] if hasattr(message, "transforms") else message
            stamp = stamped.header.stamp
            with self._condition:
                sent.append([stamp.sec * 10**9 + stamp.nanosec, info["source_timestamp"]])
                self._condition.notify_all()

        create = self._node.create_subscription
        self._in_executor(create, class_of(kind), topic, note, depth)

    def recorded(self, topic, count, limit=120.0):
        """Stamp and time of sending of the messages that were recorded, once there are so many."""
        with self._condition:
            assert self._condition.wait_for(lambda: len(self._sent[topic]) >= count, limit), f"too few of {topic}"
            return list(self._sent[topic])

    def unsubscribe(self, topic):
        self._in_executor(self._node.destroy_subscription, self._subscriptions.pop(topic))

    def latest(self, topic, after=0, limit=120.0):
        """The last message and the number of messages of a topic, once there are more than `after`."""
        with self._condition:
            assert self._condition.wait_for(lambda: self._counts.get(topic, 0) > after, limit), f"no message on {topic}"
            return {"message": plain(self._messages[topic]), "count": self._counts[topic]}

    def synchronised(self, topics, limit=120.0):
        """Messages of these topics with equal stamps: sensor data may be lost, so the last ones may differ."""

        def found():
            stamps = set.intersection(*(set(self._by_stamp.get(topic, ())) for topic in topics))
            return stamps and [self._by_stamp[topic][max(stamps)] for topic in topics]

        with self._condition:
            messages = self._condition.wait_for(found, limit)
            assert messages, "no messages with equal stamps"
            return plain(messages)

    def counts(self):
        return self._counts

    def publish(self, topic, kind, values):
        """Publish a message at 20 Hz from now on; None stops."""
        if topic not in self._publishers:
            self._publishers[topic] = self._in_executor(self._node.create_publisher, class_of(kind), topic, 10)
        self._published_messages[topic] = None if values is None else fill(class_of(kind)(), values)

    def call(self, service, kind, values=None, limit=120.0):
        """The response."""
        type_ = class_of(kind, "srv")
        return plain(self._ask(type_, service, fill(type_.Request(), values or {}), limit))

    def topics(self):
        return {name: kinds for name, kinds in self._node.get_topic_names_and_types()}  # noqa: C416

    def services(self):
        return {name: kinds for name, kinds in self._node.get_service_names_and_types()}  # noqa: C416

    def publishers(self, topic):
        return [plain_endpoint(one) for one in self._node.get_publishers_info_by_topic(topic)]

    def subscribers(self, topic):
        return [plain_endpoint(one) for one in self._node.get_subscriptions_info_by_topic(topic)]

    def now(self):
        """Time of a node with use_sim_time [s]."""
        return self._simulated.get_clock().now().nanoseconds * 1e-9

    def parameters(self, node):
        """Name -> description."""
        from rcl_interfaces.srv import DescribeParameters, ListParameters

        listing = self._ask(ListParameters, f"{node}/list_parameters", ListParameters.Request())
        names = listing.result.names
        described = self._ask(
            DescribeParameters, f"{node}/describe_parameters", DescribeParameters.Request(names=names)
        )
        return {name: one.description for name, one in zip(names, described.descriptors, strict=True)}

    def _ask(self, kind, name, request, limit=120.0):
        client = self._in_executor(self._node.create_client, kind, name)
        try:
            assert client.wait_for_service(limit), f"no service {name}"
            answer = client.call(request, timeout_sec=limit)
        finally:
            self._in_executor(self._node.destroy_client, client)
        assert answer is not None, f"no answer from {name}"
        return answer

    def _in_executor(self, function, *arguments):
        """The result of the function in the thread of the executor."""
        done = threading.Event()
        task = self._executor.create_task(function, *arguments)
        task.add_done_callback(lambda _: done.set())
        assert done.wait(120.0), "the executor of the probe does not answer"
        return task.result()

    def _spin(self):
        """Spin until the end; an error ends the process, so that no test waits for messages in vain."""
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
        except BaseException:
            traceback.print_exc()
            os._exit(1)

    def _on_message(self, message, topic):
        with self._condition:
            self._messages[topic] = message
            self._counts[topic] = self._counts.get(topic, 0) + 1
            if hasattr(message, "header"):
                stamp = message.header.stamp.sec, message.header.stamp.nanosec
                kept = self._by_stamp.setdefault(topic, {})
                kept[stamp] = message
                if len(kept) > 10:
                    del kept[next(iter(kept))]
            self._condition.notify_all()

    def _repeat(self):
        for topic, message in list(self._published_messages.items()):
            if message is not None:
                self._publishers[topic].publish(message)


rclpy.init()
probe = Probe()
print(json.dumps("ready"), flush=True)
for line in sys.stdin:
    name, arguments = json.loads(line)
    try:
        print(json.dumps([True, getattr(probe, name)(*arguments)]), flush=True)
    except Exception as error:
        print(json.dumps([False, f"{type(error).__name__}: {error}"]), flush=True)
rclpy.shutdown()
