"""What ROS says of one vehicle's driving, by whatever topic, as the Command that it is to obey now."""

from __future__ import annotations

import math
import threading
from typing import Any

from msgspec.structs import replace

from autodrive.protocol.messages import Command, Headlights, Indicators
from autodrive.ros.config import Config
from autodrive.ros.update import Car

STANDSTILL = 0.01
"""A twist that is slower turns the wheels fully, as a car cannot turn on the spot [m/s]."""


class Wheel:
    """Holds the latest command; `say` of `subscriptions` may come from any thread."""

    def __init__(self, config: Config, car: Car) -> None:
        self.car = car
        self._era = config.era
        self._timeout = config.command_timeout
        self._lock = threading.Lock()
        self._command = Command()
        self._said: float | None = None
        self._now = 0.0

    def command(self, now: float) -> Command | None:
        """The one to obey at `now` [s]; None if nobody drives. What is too old is a stop, once more told each time."""
        with self._lock:
            if now < self._now:
                self._said = None  # the world was reset
            self._now = now
            if self._said is None:
                return None
            if self._timeout and now - self._said > self._timeout:
                self._command = replace(self._command, throttle=0.0)
            return self._command

    @property
    def is_fresh(self) -> bool:
        """Whether somebody drives, and has not fallen silent."""
        return self._said is not None and not (self._timeout and self._now - self._said > self._timeout)

    # -- topics: the message of each -------------------------------------------------------------------------------

    def throttle(self, message: Any) -> None:
        """std_msgs/Float32, -1 to 1."""
        self._change(throttle=_fraction(message.data))

    def steering(self, message: Any) -> None:
        """std_msgs/Float32, -1 to 1; the era says where positive turns."""
        self._change(steering=self._era.command_sign * _fraction(message.data))

    def headlights(self, message: Any) -> None:
        """std_msgs/Int32: 0 off, 1 low, 2 high."""
        self._change(headlights=Headlights(min(max(int(message.data), 0), 2)))

    def indicators(self, message: Any) -> None:
        """std_msgs/Int32: 0 off, 1 left, 2 right, 3 hazard."""
        self._change(indicators=Indicators(min(max(int(message.data), 0), 3)))

    def ackermann(self, message: Any) -> None:
        """ackermann_msgs/AckermannDriveStamped: speed [m/s] and steering angle [rad] of a wheel in the middle."""
        self._steer(message.drive.speed, message.drive.steering_angle)

    def twist(self, message: Any) -> None:
        """geometry_msgs/Twist: forward speed [m/s] and yaw rate [rad/s]."""
        speed, turn = message.linear.x, message.angular.z
        if abs(speed) < STANDSTILL:
            angle = math.copysign(self.car.steering_limit, turn) if turn else 0.0
        else:
            angle = math.atan(self.car.wheelbase * turn / speed)
        self._steer(speed, angle)

    def twist_stamped(self, message: Any) -> None:
        """geometry_msgs/TwistStamped."""
        self.twist(message.twist)

    def _steer(self, speed: float, angle: float) -> None:
        self._change(
            throttle=_fraction(speed / self.car.speed_limit), steering=_fraction(angle / self.car.steering_limit)
        )

    def _change(self, **values: Any) -> None:
        with self._lock:
            self._command = replace(self._command, **values)
            self._said = self._now


def _fraction(value: float) -> float:
    return min(max(float(value), -1.0), 1.0) if math.isfinite(value) else 0.0
