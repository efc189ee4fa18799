"""Keyboard teleoperation: w and s throttle, a and d steering, q steering 0, e throttle 0, x both 0."""

from __future__ import annotations

import os
import select
import sys
import termios
import tty

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float32

KEYS = {
    "w": ("throttle", 0.2),
    "s": ("throttle", -0.2),
    "a": ("steering", 0.2),
    "d": ("steering", -0.2),
    "q": ("steering", None),
    "e": ("throttle", None),
    "x": (None, None),
}
"""Key -> the value that it changes (None: both), and by how much (None: to 0)."""

HELP = "w/s throttle, a/d steering, q straight, e no throttle, x both, Ctrl-C ends\n"


class TeleopKeyboard(Node):
    """Publishes both commands at 10 Hz, also unchanged ones: the bridge stops a vehicle without commands."""

    def __init__(self) -> None:
        super().__init__("teleop_keyboard")
        vehicle = self.declare_parameter("vehicle", "nigel_1").value
        is_left = self.declare_parameter("left_is_positive", True).value
        self._sign = 1.0 if is_left else -1.0
        self.values = {"throttle": 0.0, "steering": 0.0}
        self._out = {
            name: self.create_publisher(Float32, f"autodrive/{vehicle}/{name}_command", 10) for name in self.values
        }
        self.create_timer(0.1, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def press(self, key: str) -> None:
        """Apply a key."""
        if key not in KEYS:
            return
        name, change = KEYS[key]
        for one in [name] if name else self.values:
            value = 0.0 if change is None else self.values[one] + change
            self.values[one] = round(min(max(value, -1.0), 1.0), 3)
        sys.stdout.write(f"\rthrottle {self.values['throttle']:+.1f}  steering {self.values['steering']:+.1f} ")
        sys.stdout.flush()

    def publish(self) -> None:
        """Publish both commands."""
        self._out["throttle"].publish(Float32(data=self.values["throttle"]))
        self._out["steering"].publish(Float32(data=self._sign * self.values["steering"]))


def main() -> None:
    """Run until Ctrl-C."""
    if not sys.stdin.isatty():
        sys.exit("teleop_keyboard: needs a terminal for its keys; do not start it from a launch file")
    rclpy.init()
    node = TeleopKeyboard()
    before = termios.tcgetattr(sys.stdin)
    sys.stdout.write(HELP)
    try:
        tty.setcbreak(sys.stdin)
        while rclpy.ok():
            rclpy.spin_once(node, timeout_sec=0.02)
            if select.select([sys.stdin], [], [], 0.0)[0]:
                for key in os.read(sys.stdin.fileno(), 64).decode(errors="ignore").lower():
                    node.press(key)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
