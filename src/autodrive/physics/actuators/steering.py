"""The steering actuator: a servo with angle limit, dead time, rate limit and first-order lag."""

from __future__ import annotations

import math

from pydantic import Field

from autodrive.base.elementary import atan, tan
from autodrive.base.specs import Spec


class SteeringSpec(Spec):
    """Limits and response of the steering servo; the steered wheels follow Ackermann geometry."""

    limit_deg: float = Field(ge=0.01, lt=60)
    """Largest angle to each side [degree] (report, section 3.1.3: 30)."""
    rate_limit: float | None = Field(default=None, ge=1e-3, le=1e9)
    """Largest angular speed of the actuator [rad/s]; omitted: no limit."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first movement [s]."""
    time_constant: float = Field(ge=0, le=1)
    """Time constant of the first-order lag of the angle [s]; 0: none."""
    unwinds_at_once: bool = False
    """The rate limit holds only for a target that is farther from straight ahead than the angle, and on the way from
    full left to full right, as in the published program (VehicleController.cs, 2026). Any other target is reached at
    once."""

    @property
    def limit(self) -> float:
        """Largest angle to each side [rad]."""
        return math.radians(self.limit_deg)


def steered(angle: float, target: float, response: float, rate_limit: float, unwinds_at_once: bool, dt: float) -> float:
    """The angle [rad] after `dt` [s]: a first-order lag of the target, limited to `rate_limit` [rad/s].

    `response` is 1 - exp(-dt / time_constant), the fraction of the difference that the lag covers in one step. With
    `unwinds_at_once` the limit holds in the direction of the sign of angle + target only, to the right if that is 0.
    """
    step = rate_limit * dt
    if unwinds_at_once and (target < angle) == (angle + target > 0.0):
        step = math.inf
    return angle + max(-step, min(step, (target - angle) * response))


def ackermann_angle(steering_angle: float, wheelbase: float, left_of_centre: float) -> float:
    """Angle [rad] of a wheel `left_of_centre` [m] of the steered axle's centre (Rajamani (2.5), (2.6), any angle)."""
    t = tan(steering_angle)
    return atan(wheelbase * t / (wheelbase - left_of_centre * t))
