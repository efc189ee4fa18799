"""Throttle and steering sensors: virtual, they read the actuators back without error (report, tables 2 and 3)."""

from __future__ import annotations

from autodrive.state import State


def throttle(state: State, vehicle: int) -> float:
    """Latest command that has reached the drive actuators [-1, 1]; positive drives forward, 0 brakes."""
    return float(state.throttle[vehicle])


def steering(state: State, vehicle: int) -> float:
    """Angle of the steering actuator [rad], left positive (the report's own sign is the opposite)."""
    return float(state.steering_angle[vehicle])
