"""A plain ROS 1 node that tells what it hears: one JSON line for each line that it is given; run by Debian's Python.

It knows nothing of this project: rospy and tf2_ros read what the bridge publishes.
"""

import base64
import importlib
import json
import sys
import threading
import time

import genpy
import rosgraph
import rospy
import tf2_ros


def plain(value):
    """A message as JSON can have it."""
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, genpy.Time):
        return value.secs + 1e-9 * value.nsecs
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


class Witness:
    """Each method that has no underscore can be asked for by its name."""

    def __init__(self):
        self._heard = {}
        self._counts = {}
        self._subscribers = {}
        self._publishers = {}
        self._wanted = {}
        self._buffer = tf2_ros.Buffer(rospy.Duration(60))
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._news = threading.Condition()
        threading.Thread(target=self._repeat, daemon=True).start()

    def listen(self, topic, kind):
        self._subscribers[topic] = rospy.Subscriber(topic, class_of(kind), self._hear, topic, queue_size=20)

    def deafen(self, topic):
        self._subscribers.pop(topic).unregister()

    def latest(self, topic, after=0, patience=20.0):
        """The last message of that topic, when more than `after` have come, and how many have."""
        with self._news:
            assert self._news.wait_for(lambda: self._counts.get(topic, 0) > after, patience), f"nothing on {topic}"
            return {"message": plain(self._heard[topic]), "count": self._counts[topic]}

    def counts(self):
        return self._counts

    def say(self, topic, kind, value):
        """Publish it from now on 20 times a second; None: no more."""
        if topic not in self._publishers:
            self._publishers[topic] = rospy.Publisher(topic, class_of(kind), queue_size=1)
        self._wanted[topic] = value

    def topics(self):
        return dict(rosgraph.Master("/witness").getTopicTypes())

    def publications(self):
        """Topic -> names of the nodes that publish it."""
        return dict(rosgraph.Master("/witness").getSystemState()[0])

    def transform(self, target, source, patience=10.0):
        """Position and quaternion xyzw of `source` in `target`, and the time [s]."""
        found = self._buffer.lookup_transform(target, source, rospy.Time(0), timeout=rospy.Duration(patience))
        t, q = found.transform.translation, found.transform.rotation
        return [[t.x, t.y, t.z], [q.x, q.y, q.z, q.w], found.header.stamp.to_sec()]

    def forget_frames(self):
        """Simulated time may have gone back."""
        self._buffer.clear()

    def frames(self):
        return self._buffer.all_frames_as_yaml()

    def _hear(self, message, topic):
        with self._news:
            self._heard[topic] = message
            self._counts[topic] = self._counts.get(topic, 0) + 1
            self._news.notify_all()

    def _repeat(self):
        while True:
            for topic, value in list(self._wanted.items()):
                if value is not None:
                    self._publishers[topic].publish(value)
            time.sleep(0.05)


def class_of(kind):
    package, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


rospy.init_node("witness", anonymous=True, disable_rostime=True, disable_signals=True)
rospy.rostime.switch_to_wallclock()
witness = Witness()
print(json.dumps("ready"), flush=True)
for line in sys.stdin:
    name, arguments = json.loads(line)
    try:
        print(json.dumps([True, getattr(witness, name)(*arguments)]), flush=True)
    except Exception as error:
        print(json.dumps([False, f"{type(error).__name__}: {error}"]), flush=True)
