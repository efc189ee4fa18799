"""Merges the command topics of one vehicle into its current Command."""

from __future__ import annotations

import math
import threading
from typing import Any

from msgspec.structs import replace

from autodrive.connect.ros.config import Config
from autodrive.connect.ros.source import VehicleInfo
from autodrive.protocol.messages import Command, Headlights, Indicators

STANDSTILL = 0.01
"""Below this speed, a twist with a yaw rate steers fully: a car cannot turn on the spot [m/s]."""


class CommandInput:
    """Holds the latest command of one vehicle; the callbacks may be called from any thread."""

    def __init__(self, config: Config, vehicle: VehicleInfo) -> None:
        self.vehicle = vehicle
        self._devkit = config.devkit_profile
        self._timeout = config.command_timeout
        self._lock = threading.Condition()
        self._command = Command()
        self._received: float | None = None
        self._now = 0.0
        self._expected = {"throttle", "steering"}
        """What the driver has commanded after the previous scan."""
        self._answered: set[str] = set()

    def begin(self) -> None:
        """A new scan is published now."""
        with self._lock:
            if self._answered:
                self._expected, self._answered = self._answered, set()

    def wait_for_answer(self, timeout: float) -> bool:
        """Wait until the driver has answered the scan with what it commanded after the last one; whether it has begun.

        `timeout` [s].
        """
        with self._lock:
            self._lock.wait_for(lambda: self._expected <= self._answered, timeout)
            return bool(self._answered)

    def command(self, now: float) -> Command | None:
        """The command at simulated time `now` [s]; None if there is none. After the timeout, the throttle is 0."""
        with self._lock:
            if now < self._now:
                self._received = None  # the simulation was reset
            self._now = now
            if self._received is None:
                return None
            if self._is_too_old(self._received):
                self._command = replace(self._command, throttle=0.0)
            return self._command

    @property
    def has_command(self) -> bool:
        """Whether a command was received since the start of the simulation."""
        return self._received is not None

    @property
    def is_active(self) -> bool:
        """Whether a command was received within the timeout."""
        return self._received is not None and not self._is_too_old(self._received)

    def _is_too_old(self, received: float) -> bool:
        return bool(self._timeout) and self._now - received >= self._timeout - 1e-9  # rounding of the times

    # -- callbacks, one for each topic -----------------------------------------------------------------------------

    def on_throttle(self, message: Any) -> None:
        """std_msgs/Float32, -1 to 1."""
        self._change(throttle=_fraction(message.data))

    def on_steering(self, message: Any) -> None:
        """std_msgs/Float32, -1 to 1; the sign is that of the devkit profile."""
        self._change(steering=self._devkit.command_sign * _fraction(message.data))

    def on_headlights(self, message: Any) -> None:
        """std_msgs/Int32: 0 off, 1 low, 2 high."""
        self._change(headlights=Headlights(min(max(int(message.data), 0), 2)))

    def on_indicators(self, message: Any) -> None:
        """std_msgs/Int32: 0 off, 1 left, 2 right, 3 hazard."""
        self._change(indicators=Indicators(min(max(int(message.data), 0), 3)))

    def on_ackermann(self, message: Any) -> None:
        """ackermann_msgs/AckermannDriveStamped: speed [m/s] and steering angle of a virtual centre wheel [rad]."""
        self._drive(message.drive.speed, message.drive.steering_angle)

    def on_twist(self, message: Any) -> None:
        """geometry_msgs/Twist: forward speed [m/s] and yaw rate [rad/s]."""
        speed, yaw_rate = message.linear.x, message.angular.z
        if abs(speed) < STANDSTILL:
            angle = math.copysign(self.vehicle.steering_limit, yaw_rate) if yaw_rate else 0.0
        else:
            angle = math.atan(self.vehicle.wheelbase * yaw_rate / speed)
        self._drive(speed, angle)

    def on_twist_stamped(self, message: Any) -> None:
        """geometry_msgs/TwistStamped."""
        self.on_twist(message.twist)

    def _drive(self, speed: float, angle: float) -> None:
        throttle = _fraction(speed / self.vehicle.speed_limit)
        self._change(throttle=throttle, steering=_fraction(angle / self.vehicle.steering_limit))

    def _change(self, **values: Any) -> None:
        with self._lock:
            self._command = replace(self._command, **values)
            self._received = self._now
            self._answered |= values.keys() & {"throttle", "steering"}
            self._lock.notify_all()


def _fraction(value: float) -> float:
    """Clamped to -1 to 1; 0 if not finite."""
    return min(max(float(value), -1.0), 1.0) if math.isfinite(value) else 0.0
