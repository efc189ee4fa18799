"""Throttle and steering sensors: virtual, they report the exact state of the actuators (report, tables 2 and 3)."""

from __future__ import annotations

from autodrive.state import State


def throttle(state: State, vehicle: int) -> float:
    """Current command of the drive actuators [-1, 1] after the dead time; positive drives forward, 0 brakes."""
    return float(state.throttle[vehicle])


def steering(state: State, vehicle: int) -> float:
    """Angle of the steering actuator [rad], left positive (the report uses the opposite sign)."""
    return float(state.steering_angle[vehicle])
