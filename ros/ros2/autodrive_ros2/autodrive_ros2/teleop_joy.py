"""Gamepad teleoperation: converts sensor_msgs/Joy to ackermann_msgs/AckermannDriveStamped while a button is held."""

from __future__ import annotations

from typing import Any

import rclpy
from ackermann_msgs.msg import AckermannDriveStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import Joy

from autodrive.connect.ros.cars import NIGEL


class TeleopJoy(Node):
    """The defaults fit an Xbox pad with joy_node: the left stick drives, the right one steers, LB is held."""

    def __init__(self) -> None:
        super().__init__("teleop_joy")

        def parameter(name: str, default: Any) -> Any:
            return self.declare_parameter(name, default).value

        self._axes = parameter("axis_speed", 1), parameter("axis_steering", 3)
        self._button = parameter("button_hold", 4)
        self._limits = parameter("speed_limit", NIGEL.speed_limit), parameter("steering_limit", NIGEL.steering_limit)
        self._is_held = False
        self._out = self.create_publisher(
            AckermannDriveStamped, f"autodrive/{parameter('vehicle', 'nigel_1')}/drive", 10
        )
        self.create_subscription(Joy, "joy", self.on_joy, 10)

    def on_joy(self, joy: Joy) -> None:
        """Drive; when the button is released, stop once and leave the vehicle to other drivers."""
        was_held, self._is_held = self._is_held, self._button < len(joy.buttons) and bool(joy.buttons[self._button])
        if not (self._is_held or was_held):
            return
        command = AckermannDriveStamped(header=joy.header)
        if self._is_held:
            speed, angle = (joy.axes[axis] if axis < len(joy.axes) else 0.0 for axis in self._axes)
            command.drive.speed = speed * self._limits[0]
            command.drive.steering_angle = angle * self._limits[1]
        self._out.publish(command)


def main() -> None:
    """Run until Ctrl-C."""
    rclpy.init()
    node = TeleopJoy()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
