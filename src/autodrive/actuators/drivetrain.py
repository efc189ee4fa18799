"""The drivetrain: two rear motors behind an H-bridge, and the brakes that apply themselves at zero throttle."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from autodrive.descriptions import Spec
from autodrive.units import RPM


class DrivetrainSpec(Spec):
    """How throttle becomes torque at the rear wheels. Zero throttle brakes all four wheels (report, section 3.1.3)."""

    control: Literal["speed", "torque"]
    """speed: throttle sets a wheel speed, and the motors give up to torque_limit to reach it. torque: throttle sets
    the torque, and the speed follows from the resistances."""
    speed_limit_rpm: float = Field(gt=0)
    """Wheel speed at full throttle [rpm] (report: 130); in torque control no motor drives a wheel beyond it."""
    torque_limit: float = Field(gt=0)
    """Largest torque of one motor at its wheel [N m]."""
    servo_gain: float = Field(gt=0)
    """Torque for each rad/s that the wheels' mean speed is off its target [N m s/rad]."""
    brake_torque: float = Field(ge=0)
    """Holding torque at each of the four wheels while the throttle is zero [N m]."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first change at motors or brakes [s]."""
    time_constant: float = Field(ge=0, le=1)
    """First-order lag of the drive behind the throttle [s]; 0: none."""

    @property
    def speed_limit(self) -> float:
        """Wheel speed at full throttle [rad/s]."""
        return self.speed_limit_rpm * RPM


def drive_level(level: float, throttle: float, response: float) -> float:
    """The drive's level [-1, 1] after a step: it lags behind the throttle, and zero throttle cuts it at once.

    `response` is 1 - exp(-dt / time_constant).
    """
    if throttle == 0.0:
        return 0.0
    return level + (throttle - level) * response


def drive_target(level: float, is_speed_controlled: bool, speed_limit: float) -> float:
    """Wheel speed that the motors are after [rad/s]."""
    if is_speed_controlled:
        return level * speed_limit
    return speed_limit if level > 0.0 else -speed_limit


def drive_torque_limit(level: float, is_speed_controlled: bool, torque_limit: float) -> float:
    """Torque that each motor may give [N m]."""
    return torque_limit if is_speed_controlled else abs(level) * torque_limit
