"""A ROS 1 node for the tests, run by Debian's Python: JSON lines [method, arguments] in, JSON lines with results out.

It is independent of this project: it subscribes and publishes with rospy and looks up transforms with tf2_ros.
"""

# pyright: reportMissingImports=false

import base64
import importlib
import json
import queue
import sys
import threading
import time

import genpy
import rosgraph
import rospy
import tf2_ros


def plain(value):
    """A message as a JSON value."""
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, genpy.Time):
        return value.secs + 1e-9 * value.nsecs
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


class Probe:
    """Methods without a leading underscore can be called by name."""

    def __init__(self):
        self._messages = {}
        self._counts = {}
        self._subscribers = {}
        self._publishers = {}
        self._published_values = {}
        self._buffer = tf2_ros.Buffer(rospy.Duration(60))
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._condition = threading.Condition()
        threading.Thread(target=self._repeat, daemon=True).start()

    def subscribe(self, topic, kind):
        self._subscribers[topic] = rospy.Subscriber(topic, class_of(kind), self._on_message, topic, queue_size=20)

    def unsubscribe(self, topic):
        self._subscribers.pop(topic).unregister()

    def latest(self, topic, after=0, limit=120.0):
        """The last message and the number of messages of a topic, once there are more than `after`."""
        with self._condition:
            assert self._condition.wait_for(lambda: self._counts.get(topic, 0) > after, limit), f"no message on {topic}"
            return {"message": plain(self._messages[topic]), "count": self._counts[topic]}

    def join(self, topic, kind, target, count, limit=60.0):
        """How many of `count` messages the buffer of tf2 can transform before the next one arrives: a queue of one."""
        arrived = queue.Queue()
        subscriber = rospy.Subscriber(topic, class_of(kind), arrived.put, queue_size=count)
        joined, message = 0, arrived.get(timeout=limit)
        for _ in range(count):
            is_joined = False
            while arrived.empty():
                is_joined = is_joined or self._buffer.can_transform(
                    target, message.header.frame_id, message.header.stamp
                )
                time.sleep(0.001)
            joined += is_joined
            message = arrived.get()
        subscriber.unregister()
        return joined

    def counts(self):
        return self._counts

    def publish(self, topic, kind, value):
        """Publish a value at 20 Hz from now on; None stops."""
        if topic not in self._publishers:
            self._publishers[topic] = rospy.Publisher(topic, class_of(kind), queue_size=1)
        message = None
        if value is not None:
            genpy.message.fill_message_args(message := class_of(kind)(), [value])
        self._published_values[topic] = message

    def topics(self):
        return dict(rosgraph.Master("/probe").getTopicTypes())

    def publications(self):
        """Topic -> names of the nodes that publish it."""
        return dict(rosgraph.Master("/probe").getSystemState()[0])

    def subscriptions(self):
        """Topic -> names of the nodes that subscribe to it."""
        return dict(rosgraph.Master("/probe").getSystemState()[1])

    def transform(self, target, source, limit=60.0):
        """Position and quaternion xyzw of `source` in `target`, and the time [s]."""
        found = self._buffer.lookup_transform(target, source, rospy.Time(0), timeout=rospy.Duration(limit))
        t, q = found.transform.translation, found.transform.rotation
        return [[t.x, t.y, t.z], [q.x, q.y, q.z, q.w], found.header.stamp.to_sec()]

    def clear_frames(self):
        """Clear the TF buffer, after a reset of simulated time."""
        self._buffer.clear()

    def frames(self):
        return self._buffer.all_frames_as_yaml()

    def _on_message(self, message, topic):
        with self._condition:
            self._messages[topic] = message
            self._counts[topic] = self._counts.get(topic, 0) + 1
            self._condition.notify_all()

    def _repeat(self):
        while True:
            for topic, value in list(self._published_values.items()):
                if value is not None:
                    self._publishers[topic].publish(value)
            time.sleep(0.05)


def class_of(kind):
    package, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


rospy.init_node("probe", anonymous=True, disable_rostime=True, disable_signals=True)
rospy.rostime.switch_to_wallclock()
probe = Probe()
print(json.dumps("ready"), flush=True)
for line in sys.stdin:
    name, arguments = json.loads(line)
    try:
        print(json.dumps([True, getattr(probe, name)(*arguments)]), flush=True)
    except Exception as error:
        print(json.dumps([False, f"{type(error).__name__}: {error}"]), flush=True)
