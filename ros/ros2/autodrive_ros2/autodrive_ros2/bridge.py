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

from autodrive.errors import AutodriveError
from autodrive.ros import Bridge, Message, Subscription, Topic
from autodrive_ros2.messages import build, message_type
from autodrive_ros2.parameters import declare
from autodrive_ros2.qualities import COMMAND, QUALITIES
from autodrive_ros2.services import offer


class BridgeNode(Node):
    """Publishes what a simulator tells and drives it; `autodrive.ros.Node` is what the bridge knows of it.

    Nothing here goes by the clock of ROS, which this node itself makes.
    """

    def __init__(self) -> None:
        super().__init__("autodrive_bridge")
        self._publishers_of: dict[str, Publisher] = {}
        self._missing: set[str] = set()
        config, own = declare(self)
        self._cmd_vel_is_stamped: bool = own["cmd_vel_is_stamped"]
        logging.getLogger("autodrive").addHandler(_Log(self))
        self.bridge = Bridge(config, self)
        if own["services"] and config.mode == "direct":
            offer(self, self.bridge, MutuallyExclusiveCallbackGroup())
        self.bridge.start()

    # -- what the bridge asks for ---------------------------------------------------------------------------------

    def open(self, topics: list[Topic], subscriptions: list[Subscription]) -> None:
        """Make publishers and subscribers."""
        for topic in topics:
            if kind := self._type(topic.type, topic.name):
                options = QoSOverridingOptions.with_default_policies()
                self._publishers_of[topic.name] = self.create_publisher(
                    kind, topic.name, QUALITIES[topic.quality], qos_overriding_options=options
                )
        for one in map(self._renamed, subscriptions):
            if one and (kind := self._type(one.type, one.name)):
                options = QoSOverridingOptions.with_default_policies()
                self.create_subscription(kind, one.name, one.take, COMMAND, qos_overriding_options=options)

    def has_readers(self, topic: Topic) -> bool:
        """Whether somebody reads it now; what is latched is for those who come later."""
        publisher = self._publishers_of.get(topic.name)
        try:
            return publisher is not None and (topic.quality == "latched" or publisher.get_subscription_count() > 0)
        except RCLError:  # Ctrl-C, which ROS hears before us
            return False

    def publish(self, message: Message, topic: Topic) -> None:
        """Send it."""
        if publisher := self._publishers_of.get(topic.name):
            with suppress(RCLError):  # as above
                publisher.publish(build(message))

    def now(self) -> float:
        """Wall time [s]."""
        return time.time()

    # -- parts ----------------------------------------------------------------------------------------------------

    def _renamed(self, one: Subscription) -> Subscription | None:
        """The stamped twist in place of the plain one, where that is wanted."""
        if not self._cmd_vel_is_stamped or not one.name.endswith(("/cmd_vel", "/cmd_vel_stamped")):
            return one
        return replace(one, name=one.name.removesuffix("_stamped")) if one.name.endswith("_stamped") else None

    def _type(self, name: str, topic: str) -> type | None:
        """That type, if it is installed; else that is told, once a package."""
        try:
            return message_type(name)
        except ImportError as error:
            package = name.partition("/")[0]
            if package not in self._missing:
                self._missing.add(package)
                self.get_logger().warning(f"without topic {topic} and others of {package}, which is missing: {error}")
            return None


class _Log(logging.Handler):
    """What the bridge tells, in the log of ROS."""

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._log = node.get_logger()

    def emit(self, record: logging.LogRecord) -> None:
        """Tell it."""
        tell = self._log.info if record.levelno <= logging.INFO else self._log.warning
        tell(record.getMessage())


def make_room_for_pictures() -> None:
    """Fast DDS shares less memory with readers on this machine than a raw picture has, and loses pieces of it.

    Whoever has configured Fast DDS is left alone; another middleware does not look at this.
    """
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")  # before Fast DDS 3, and since
    if not any(name in os.environ for name in (*names, "FASTDDS_BUILTIN_TRANSPORTS")):
        file = f"{get_package_share_directory('autodrive_ros2')}/config/fastdds.xml"
        os.environ.update(dict.fromkeys(names, file))


def main() -> None:
    """Run until Ctrl-C."""
    make_room_for_pictures()
    rclpy.init()
    try:
        node = BridgeNode()
    except AutodriveError as error:
        rclpy.shutdown()
        sys.exit(f"autodrive_bridge: {error}")
    executor = MultiThreadedExecutor(num_threads=2)  # a service may take long, and commands do not wait for it
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
