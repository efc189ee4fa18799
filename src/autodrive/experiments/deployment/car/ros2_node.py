"""Drives a car with the policy of this folder, as a node for ROS 2.

Usage: python3 ros2_node.py [--dry-run] [--set NAME=VALUE] ...
The settings are in settings.json; README.md describes the folder. It only passes values between ROS and driver.py.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import importlib
import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from driver import CarCommand, CarDriver, CarError, CarLog, CarSettings, CarTopic, topics
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

FOLDER = Path(__file__).parent
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Quality of service of what is subscribed: the newest message counts, and a publisher may be reliable or not."""


def message_type(package: str, name: str) -> Any:
    """Class of a message. Raises `CarError` if its package is not installed."""
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError:
        raise CarError(f"the ROS package {package} is not installed: it has the messages {name}") from None


class Ros2Node(Node):
    """Gives the messages of the car to the driver, and publishes its commands.

    It waits for scans only, and takes the newest messages of the other topics then: an executor of rclpy wakes up for
    each message, which costs three times as much.
    """

    def __init__(self, driver: CarDriver, is_dry: bool) -> None:
        super().__init__("autodrive_car", start_parameter_services=False)
        self.driver, self._is_dry = driver, is_dry
        settings = driver.settings
        self._publishers: list[Any] = []
        if settings.drive_topic:
            self._kind = message_type("ackermann_msgs", "AckermannDriveStamped")
            names = [settings.drive_topic]
        else:
            self._kind = message_type("std_msgs", "Float32")
            names = [settings.throttle_topic, settings.steering_command_topic]
        if not is_dry:
            self._publishers = [self.create_publisher(self._kind, name, QoSProfile(depth=1)) for name in names]
        wanted = [
            self.create_subscription(
                message_type(topic.package, topic.type), topic.name, partial(self._take, topic), NEWEST
            )
            for topic in topics(driver)
        ]
        self._scan = wanted[0]
        self._others = [*(set(self.subscriptions) - {self._scan}), self._scan]  # with the clock of a simulator
        self._interval = 0.2 * settings.scan_timeout
        self._waits = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, self.context.handle)
        self._tick_time = time.monotonic()
        self._said: Any = None

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _take(self, topic: CarTopic, message: Any) -> None:
        self._command(topic.take(self._now(), message))

    def wait(self) -> None:
        """Wait for a scan, not longer than a fifth of the time after which a lost scan stops the car."""
        self._waits.clear_entities()
        self._waits.add_subscription(self._scan.handle)
        self._waits.wait(int(1e9 * max(self._tick_time + self._interval - time.monotonic(), 0.0)))
        for subscription in self._others:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is not None:
                subscription.callback(taken[0])
        if time.monotonic() - self._tick_time >= self._interval:
            self._tick_time = time.monotonic()
            self._command(self.driver.tick(self._now()))
            self._say()

    def stop(self) -> None:
        """Stop the car at the end of the program."""
        self._command(self.driver.stopped(self._now(), "end of the program"))

    def _command(self, command: CarCommand | None) -> None:
        if command is None:
            return
        if self._publishers and self.driver.settings.drive_topic:
            message = self._kind()
            message.header.stamp = self.get_clock().now().to_msg()
            message.drive.speed, message.drive.steering_angle = command.speed, command.angle
            self._publishers[0].publish(message)
        elif self._publishers:
            self._publishers[0].publish(self._kind(data=command.throttle))
            self._publishers[1].publish(self._kind(data=command.steering))

    def _say(self) -> None:
        """Log why the car stands, or that it drives, when that changes."""
        driver = self.driver
        said = (driver.waits_for, driver.problem, driver.cap)
        if said != self._said:
            self._said = said
            text = "; ".join(part for part in said[:2] if part)
            self.get_logger().info(f"the car stands: {text}" if text else f"the car drives, at most {driver.cap:g} m/s")
        while driver.notes:
            self.get_logger().warning(driver.notes.pop(0))


def main() -> None:
    """Drive until Ctrl-C; the car is stopped at the end."""
    parser = argparse.ArgumentParser(description="Drives a car with the policy of this folder.")
    parser.add_argument("--dry-run", action="store_true", help="compute and log, and publish nothing")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="instead of settings.json")
    options, rest = parser.parse_known_args()
    rclpy.init(args=rest, signal_handler_options=SignalHandlerOptions.NO)  # the car is stopped before ROS ends
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell may have started it with Ctrl-C ignored
        signal.signal(number, signal.default_int_handler)
    try:
        settings = CarSettings.read(FOLDER / "settings.json", options.set)
        driver = CarDriver(settings, FOLDER, CarLog.of(settings, Path.cwd()))
        node = Ros2Node(driver, options.dry_run)
    except CarError as error:
        sys.exit(f"ros2_node.py: {error}")
    try:
        while rclpy.ok():
            node.wait()
    except KeyboardInterrupt:
        pass
    finally:
        if rclpy.ok():
            node.stop()
        if driver.log is not None:
            driver.log.close(driver.summary())
        print(driver.summary())
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
