"""The node autodrive_bridge: `autodrive.ros.Bridge` with publishers and subscribers of ROS 2."""

from __future__ import annotations

import logging
import os
import sys
import time
from contextlib import suppress
from dataclasses import replace

import rclpy
from ament_index_python.packages import get_package_share_directory
from rclpy._rclpy_pybind11 import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos_overriding_options import QoSOverridingOptions

from autodrive import AutodriveError
from autodrive.ros import Bridge, Message, Subscription, Topic
from autodrive_ros2.messages import build, message_type
from autodrive_ros2.parameters import declare
from autodrive_ros2.qos import QOS
from autodrive_ros2.services import create_services


class BridgeNode(Node):
    """Implements `autodrive.ros.Node` with rclpy.

    It does not use the ROS clock, because it publishes /clock itself.
    """

    def __init__(self) -> None:
        super().__init__("autodrive_bridge")
        self._publishers_by_name: dict[str, Publisher] = {}
        self._missing: set[str] = set()
        config, own = declare(self)
        self._cmd_vel_is_stamped: bool = own["cmd_vel_is_stamped"]
        logging.getLogger("autodrive").addHandler(_LogHandler(self))
        self.bridge = Bridge(config, self)
        if own["services"] and config.mode == "direct" and not config.race:
            create_services(self, self.bridge, MutuallyExclusiveCallbackGroup())
        self.bridge.start()

    # -- autodrive.ros.Node ---------------------------------------------------------------------------------------

    def add_topics(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        """Create publishers and subscribers."""
        for topic in topics:
            if kind := self._type(topic.type, topic.name):
                options = QoSOverridingOptions.with_default_policies()
                self._publishers_by_name[topic.name] = self.create_publisher(
                    kind, topic.name, QOS[topic.qos], qos_overriding_options=options
                )
        for one in map(self._renamed, subscriptions):
            if one and (kind := self._type(one.type, one.name)):
                options = QoSOverridingOptions.with_default_policies()
                self.create_subscription(kind, one.name, one.callback, QOS[one.qos], qos_overriding_options=options)

    def has_subscribers(self, topic: Topic) -> bool:
        """Whether the topic has subscribers now; latched topics are published for late subscribers too."""
        publisher = self._publishers_by_name.get(topic.name)
        try:
            return publisher is not None and (topic.qos == "latched" or publisher.get_subscription_count() > 0)
        except RCLError:  # after Ctrl-C, rclpy shuts down before the bridge
            return False

    def publish(self, message: Message, topic: Topic) -> None:
        """Publish a message."""
        if publisher := self._publishers_by_name.get(topic.name):
            with suppress(RCLError):  # as above
                publisher.publish(build(message))

    def now(self) -> float:
        """Wall time [s]."""
        return time.time()

    # -- parts ----------------------------------------------------------------------------------------------------

    def _renamed(self, one: Subscription) -> Subscription | None:
        """With `cmd_vel_is_stamped`, cmd_vel_stamped replaces cmd_vel."""
        if not self._cmd_vel_is_stamped or not one.name.endswith(("/cmd_vel", "/cmd_vel_stamped")):
            return one
        return replace(one, name=one.name.removesuffix("_stamped")) if one.name.endswith("_stamped") else None

    def _type(self, name: str, topic: str) -> type | None:
        """The message type; None if it is not installed, with one warning for each package."""
        try:
            return message_type(name)
        except ImportError as error:
            package = name.partition("/")[0]
            if package not in self._missing:
                self._missing.add(package)
                self.get_logger().warning(
                    f"no topic {topic} and no other topics of {package}: the package is not installed ({error})"
                )
            return None


class _LogHandler(logging.Handler):
    """Forwards log records of the bridge to the ROS log."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Log the record."""
        write = self._log.info if record.levelno <= logging.INFO else self._log.warning
        write(record.getMessage())


def configure_fastdds() -> None:
    """Enlarge the shared memory of Fast DDS: the default is smaller than a raw image, so parts of images are lost.

    An existing configuration of Fast DDS is kept; other middlewares ignore these variables.
    """
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # before Fast DDS 3, and since
    if not any(name in os.environ for name in (*names, "FASTDDS_BUILTIN_TRANSPORTS")):
        file = f"{get_package_share_directory('autodrive_ros2')}/config/fastdds.xml"
        os.environ.update(dict.fromkeys(names, file))


def main() -> None:
    """Run until Ctrl-C."""
    configure_fastdds()
    rclpy.init()
    try:
        node = BridgeNode()
    except AutodriveError as error:
        rclpy.shutdown()
        sys.exit(f"autodrive_bridge: {error}")
    executor = MultiThreadedExecutor(num_threads=2)  # a long service call does not delay commands
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.bridge.close()
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
