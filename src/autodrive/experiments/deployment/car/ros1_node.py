"""Drives a car with the policy of this folder, as a node for ROS 1.

Usage: python3 ros1_node.py [--dry-run] [--set NAME=VALUE] ...
The settings are in settings.json; README.md describes the folder. It only passes values between ROS and driver.py.
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import importlib
import sys
import threading
from functools import partial
from pathlib import Path
from typing import Any

import rospy
from driver import CarCommand, CarDriver, CarError, CarLog, CarSettings, CarTopic, topics

FOLDER = Path(__file__).parent


def message_type(package: str, name: str) -> Any:
    """Class of a message. Raises `CarError` if its package is not installed."""
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError:
        raise CarError(f"the ROS package {package} is not installed: it has the messages {name}") from None


class Ros1Node:
    """Gives the messages of the car to the driver, and publishes its commands."""

    def __init__(self, driver: CarDriver, is_dry: bool) -> None:
        self.driver = driver
        settings = driver.settings
        self._lock = threading.Lock()  # rospy calls from several threads
        self._said: Any = None
        self._publishers: list[Any] = []
        if settings.drive_topic:
            self._kind = message_type("ackermann_msgs", "AckermannDriveStamped")
            names = [settings.drive_topic]
        else:
            self._kind = message_type("std_msgs", "Float32")
            names = [settings.throttle_topic, settings.steering_command_topic]
        if not is_dry:
            self._publishers = [rospy.Publisher(name, self._kind, queue_size=1) for name in names]
        for topic in topics(driver):
            kind = message_type(topic.package, topic.type)
            rospy.Subscriber(topic.name, kind, partial(self._take, topic), queue_size=1, tcp_nodelay=True)
        rospy.Timer(rospy.Duration.from_sec(0.25 * settings.scan_timeout), self._tick)
        rospy.on_shutdown(self.stop)

    def _take(self, topic: CarTopic, message: Any) -> None:
        with self._lock:
            self._command(topic.take(rospy.get_time(), message))

    def _tick(self, _: Any) -> None:
        with self._lock:
            self._command(self.driver.tick(rospy.get_time()))
            self._say()

    def stop(self) -> None:
        """Stop the car at the end of the program, before ROS ends."""
        with self._lock:
            self._command(self.driver.stopped(rospy.get_time(), "end of the program"))
            if self.driver.log is not None:
                self.driver.log.close(self.driver.summary())
                self.driver.log = None
            print(self.driver.summary())

    def _command(self, command: CarCommand | None) -> None:
        if command is None:
            return
        if self._publishers and self.driver.settings.drive_topic:
            message = self._kind()
            message.header.stamp = rospy.Time.now()
            message.drive.speed, message.drive.steering_angle = command.speed, command.angle
            self._publishers[0].publish(message)
        elif self._publishers:
            self._publishers[0].publish(command.throttle)
            self._publishers[1].publish(command.steering)

    def _say(self) -> None:
        """Log why the car stands, or that it drives, when that changes."""
        driver = self.driver
        said = (driver.waits_for, driver.problem, driver.cap)
        if said != self._said:
            self._said = said
            text = "; ".join(part for part in said[:2] if part)
            rospy.loginfo(f"the car stands: {text}" if text else f"the car drives, at most {driver.cap:g} m/s")
        while driver.notes:
            rospy.logwarn(driver.notes.pop(0))


def main() -> None:
    """Drive until Ctrl-C; the car is stopped at the end."""
    parser = argparse.ArgumentParser(description="Drives a car with the policy of this folder.")
    parser.add_argument("--dry-run", action="store_true", help="compute and log, and publish nothing")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="instead of settings.json")
    options = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node("autodrive_car")
    try:
        settings = CarSettings.read(FOLDER / "settings.json", options.set)
        Ros1Node(CarDriver(settings, FOLDER, CarLog.of(settings, Path.cwd())), options.dry_run)
    except CarError as error:
        sys.exit(f"ros1_node.py: {error}")
    rospy.spin()


if __name__ == "__main__":
    main()
