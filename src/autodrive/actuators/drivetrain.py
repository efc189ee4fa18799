"""The drivetrain: one motor for each driven wheel, and brakes that apply automatically at zero throttle."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from autodrive.specs import Spec
from autodrive.units import RPM


class DrivetrainSpec(Spec):
    """Response of motors and brakes to the throttle; zero throttle brakes (report, section 3.1.3)."""

    control: Literal["speed", "torque"]
    """speed: the throttle sets the wheel speed; the motors apply up to torque_limit to reach it. torque: the throttle
    sets the torque; the speed results from the resistances."""
    speed_limit_rpm: float = Field(ge=0.01, le=1e6)
    """Wheel speed at full throttle [rpm] (report: 130); in torque control, the highest speed that a motor drives."""
    torque_limit: float = Field(ge=1e-6, le=1e6)
    """Largest torque of each motor at its wheel [N m]."""
    servo_gain: float = Field(ge=1e-6, le=1e6)
    """Torque per difference of the mean wheel speed from its target [N m s/rad]."""
    brake_torque: float = Field(ge=0, le=1e6)
    """Holding torque at each braked wheel while the throttle is zero [N m]."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first response of motors or brakes [s]."""
    time_constant: float = Field(ge=0, le=1)
    """Time constant of the first-order lag of the drive [s]; 0: none."""

    @property
    def speed_limit(self) -> float:
        """Wheel speed at full throttle [rad/s]."""
        return self.speed_limit_rpm * RPM


def drive_level(level: float, throttle: float, response: float) -> float:
    """The drive level [-1, 1] after a step: a first-order lag of the throttle; zero throttle resets it to zero.

    `response` is 1 - exp(-dt / time_constant).
    """
    if throttle == 0.0:
        return 0.0
    return level + (throttle - level) * response


def drive_target(level: float, is_speed_controlled: bool, speed_limit: float) -> float:
    """Target wheel speed of the motors [rad/s]."""
    if is_speed_controlled:
        return level * speed_limit
    return speed_limit if level > 0.0 else -speed_limit


def drive_torque_limit(level: float, is_speed_controlled: bool, torque_limit: float) -> float:
    """Largest torque of each motor at this level [N m]."""
    return torque_limit if is_speed_controlled else abs(level) * torque_limit
