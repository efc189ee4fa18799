"""The steering actuator: a servo with limit, dead time, rate limit and lag."""

from __future__ import annotations

import math

from pydantic import Field

from autodrive.descriptions import Spec


class SteeringSpec(Spec):
    """Limits and response of the steering servo; the front wheels follow by Ackermann geometry."""

    limit_deg: float = Field(gt=0, lt=60)
    """Largest angle to either side [degree] (report, section 3.1.3: 30)."""
    rate_limit: float = Field(gt=0)
    """Largest angular speed of the actuator [rad/s]."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first movement [s]."""
    time_constant: float = Field(ge=0, le=1)
    """First-order lag of the angle behind its target [s]; 0: none."""

    @property
    def limit(self) -> float:
        """Largest angle to either side [rad]."""
        return math.radians(self.limit_deg)


def steered(angle: float, target: float, response: float, rate_limit: float, dt: float) -> float:
    """The angle [rad] after `dt` [s]: a first-order approach to the target, no faster than the rate limit [rad/s].

    `response` is 1 - exp(-dt / time_constant), the share of the way that the lag leaves in one step.
    """
    step = rate_limit * dt
    return angle + max(-step, min(step, (target - angle) * response))
