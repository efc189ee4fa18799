"""Drives a car with the policy of this folder, as a node for ROS 2.

Usage: python3 ros2_node.py [--dry-run] [--set NAME=VALUE] ...
The settings are in settings.json; README.md describes the folder. It only passes values between ROS and driver.py.
"""

from __future__ import annotations

import argparse
import importlib
import signal
import sys
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from driver import CarCommand, CarSettings, CarTopic, DriveLog, Driver, DriverError, topics
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

FOLDER = Path(__file__).parent
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Only the newest message counts; a publisher may be reliable or not."""


def message_type(package: str, name: str) -> Any:
    """Class of a message. Raises `DriverError` if its package is not installed."""
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError:
        raise DriverError(f"the ROS package {package} is not installed: it has the messages {name}") from None


class CarNode(Node):
    """Gives the messages of the car to the driver, and publishes its commands."""

    def __init__(self, driver: Driver, is_dry: bool) -> None:
        super().__init__("autodrive_car")
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
        for topic in topics(driver):
            kind = message_type(topic.package, topic.type)
            self.create_subscription(kind, topic.name, partial(self._take, topic), NEWEST)
        self.create_timer(0.25 * settings.scan_timeout, self._tick)
        self._said = ("", "")

    def _now(self) -> float:
        return 1e-9 * self.get_clock().now().nanoseconds

    def _take(self, topic: CarTopic, message: Any) -> None:
        self._command(topic.take(self._now(), message))

    def _tick(self) -> None:
        self._command(self.driver.tick(self._now()))
        while self.driver.notes:
            self.get_logger().warning(self.driver.notes.pop(0))

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
        if (said := (command.stop, self.driver.problem)) != self._said:
            self._said = said
            text = "; ".join(part for part in said if part)
            self.get_logger().info(f"stop: {text}" if command.stop else f"drives, at most {self.driver.cap:g} m/s")


def main() -> None:
    """Drive until Ctrl-C; the car is stopped at the end."""
    parser = argparse.ArgumentParser(description="Drives a car with the policy of this folder.")
    parser.add_argument("--dry-run", action="store_true", help="compute and log, and publish nothing")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="instead of settings.json")
    options, rest = parser.parse_known_args()
    rclpy.init(args=rest, signal_handler_options=SignalHandlerOptions.NO)  # the car is stopped before ROS ends
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        settings = CarSettings.read(FOLDER / "settings.json", options.set)
        driver = Driver(settings, FOLDER, DriveLog.of(settings, Path.cwd()))
        node = CarNode(driver, options.dry_run)
    except DriverError as error:
        sys.exit(f"ros2_node.py: {error}")
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
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
