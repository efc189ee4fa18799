"""A plain ROS 2 node that tells what it hears: one JSON line for each line that it is given; run by the wheels' Python.

It knows nothing of this project: rclpy reads what the bridge publishes, and rclpy asks for its services.
"""

import array
import base64
import importlib
import json
import sys
import threading

import numpy as np
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def plain(value):
    """A message as JSON can have it."""
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
    """Set fields, also those inside."""
    for name, value in values.items():
        if isinstance(value, dict):
            fill(getattr(message, name), value)
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


class Witness:
    """Each method that has no underscore can be asked for by its name."""

    def __init__(self):
        self._node = rclpy.create_node("witness")
        self._simulated = rclpy.create_node(
            "simulated", parameter_overrides=[Parameter("use_sim_time", Parameter.Type.BOOL, True)]
        )
        self._heard = {}
        self._counts = {}
        self._by_stamp = {}
        self._subscriptions = {}
        self._publishers = {}
        self._wanted = {}
        self._news = threading.Condition()
        self._node.create_timer(0.05, self._repeat, clock=Clock(clock_type=ClockType.STEADY_TIME))
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        executor.add_node(self._simulated)
        threading.Thread(target=executor.spin, daemon=True).start()

    def listen(self, topic, kind, reliability="BEST_EFFORT", durability="VOLATILE"):
        qos = QoSProfile(depth=20, reliability=ReliabilityPolicy[reliability], durability=DurabilityPolicy[durability])
        hear = lambda message: self._hear(message, topic)  # noqa: E731
        self._subscriptions[topic] = self._node.create_subscription(class_of(kind), topic, hear, qos)

    def deafen(self, topic):
        self._node.destroy_subscription(self._subscriptions.pop(topic))

    def latest(self, topic, after=0, patience=20.0):
        """The last message of that topic, when more than `after` have come, and how many have."""
        with self._news:
            assert self._news.wait_for(lambda: self._counts.get(topic, 0) > after, patience), f"nothing on {topic}"
            return {"message": plain(self._heard[topic]), "count": self._counts[topic]}

    def together(self, topics, patience=30.0):
        """Messages of those topics with one and the same stamp: what is carried as sensor data may be lost."""

        def found():
            stamps = set.intersection(*(set(self._by_stamp.get(topic, ())) for topic in topics))
            return stamps and [self._by_stamp[topic][max(stamps)] for topic in topics]

        with self._news:
            messages = self._news.wait_for(found, patience)
            assert messages, "they never came together"
            return plain(messages)

    def counts(self):
        return self._counts

    def say(self, topic, kind, values):
        """Publish it from now on 20 times a second; None: no more."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(class_of(kind), topic, 10)
        self._wanted[topic] = None if values is None else fill(class_of(kind)(), values)

    def call(self, service, kind, values=None, patience=60.0):
        """The response."""
        type_ = class_of(kind, "srv")
        client = self._node.create_client(type_, service)
        assert client.wait_for_service(patience), f"no service {service}"
        answer = client.call(fill(type_.Request(), values or {}), timeout_sec=patience)
        assert answer is not None, f"no answer of {service}"
        self._node.destroy_client(client)
        return plain(answer)

    def topics(self):
        return {name: kinds for name, kinds in self._node.get_topic_names_and_types()}  # noqa: C416

    def services(self):
        return {name: kinds for name, kinds in self._node.get_service_names_and_types()}  # noqa: C416

    def publishers(self, topic):
        return [plain_endpoint(one) for one in self._node.get_publishers_info_by_topic(topic)]

    def readers(self, topic):
        return [plain_endpoint(one) for one in self._node.get_subscriptions_info_by_topic(topic)]

    def now(self):
        """Of a node with use_sim_time [s]."""
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

    def _ask(self, kind, name, request):
        client = self._node.create_client(kind, name)
        assert client.wait_for_service(20.0)
        return client.call(request, timeout_sec=20.0)

    def _hear(self, message, topic):
        with self._news:
            self._heard[topic] = message
            self._counts[topic] = self._counts.get(topic, 0) + 1
            if hasattr(message, "header"):
                stamp = message.header.stamp.sec, message.header.stamp.nanosec
                kept = self._by_stamp.setdefault(topic, {})
                kept[stamp] = message
                if len(kept) > 10:
                    del kept[next(iter(kept))]
            self._news.notify_all()

    def _repeat(self):
        for topic, message in list(self._wanted.items()):
            if message is not None:
                self._publishers[topic].publish(message)


rclpy.init()
witness = Witness()
print(json.dumps("ready"), flush=True)
for line in sys.stdin:
    name, arguments = json.loads(line)
    try:
        print(json.dumps([True, getattr(witness, name)(*arguments)]), flush=True)
    except Exception as error:
        print(json.dumps([False, f"{type(error).__name__}: {error}"]), flush=True)
