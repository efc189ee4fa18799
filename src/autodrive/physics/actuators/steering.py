"""The steering actuator: a servo with dead time, rate limit and first-order lag, and the linkage to the wheels."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan, tan
from autodrive.base.specs import Spec

Share: TypeAlias = Annotated[float, Field(ge=-1.0, le=1.0)]
WheelAngle: TypeAlias = Annotated[float, Field(gt=-60.0, lt=60.0)]


class SteeringSpec(Spec):
    """Limits and response of the steering servo; the steered wheels follow Ackermann geometry."""

    limit_deg: float = Field(ge=0.01, lt=60)
    """Angle that the command 1 asks for [degree], without a `curve` the largest one to each side (report, section
    3.1.3: 30)."""
    command_limits: tuple[Share, Share] = (-1.0, 1.0)
    """Commands to the right and to the left beyond which the servo does not follow."""
    rate_limit: float | None = Field(default=None, ge=1e-3, le=1e9)
    """Largest angular speed of the servo, whose angle is its position in commands times `limit_deg` [rad/s]; omitted:
    no limit."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first movement [s]."""
    time_constant: float = Field(ge=0, le=1)
    """Time constant of the first-order lag of the servo [s]; 0: none."""
    curve: Annotated[tuple[tuple[Share, WheelAngle], ...], Field(max_length=9)] = ()
    """The linkage behind the servo: pairs of its position in commands and angle of the wheels [degree], linear between
    them, constant beyond the ends; omitted: the angle is that of the servo."""
    offset_deg: float = Field(default=0.0, ge=-20, le=20)
    """Angle that is added behind the curve: that of the command 0 of a car that is not trimmed [degree]."""
    unwinds_at_once: bool = False
    """The rate limit holds only for a target that is farther from straight ahead than the angle, and on the way from
    full left to full right, as in the published program (VehicleController.cs, 2026). Any other target is reached at
    once."""

    @model_validator(mode="after")
    def _rises(self) -> SteeringSpec:
        right, left = self.command_limits
        if right >= left:
            raise ValueError(f"command_limits [{right:g}, {left:g}]: the first one, to the right, must be smaller")
        if len(self.curve) == 1 or any(b[0] <= a[0] or b[1] < a[1] for a, b in pairwise(self.curve)):
            raise ValueError("curve needs two points or more, with rising commands and angles that do not fall")
        return self

    @property
    def limit(self) -> float:
        """Angle that the command 1 asks for [rad]."""
        return math.radians(self.limit_deg)

    @property
    def is_straight(self) -> bool:
        """Whether the angle of the wheels is that of the servo."""
        return not self.curve and self.offset_deg == 0.0

    @property
    def knots(self) -> tuple[tuple[float, float], ...]:
        """Pairs of the angle of the servo and the angle of the wheels [rad], rising, linear between them."""
        points = self.curve or ((-1.0, -self.limit_deg), (1.0, self.limit_deg))
        offset = math.radians(self.offset_deg)
        return tuple((command * self.limit, math.radians(angle) + offset) for command, angle in points)

    @property
    def largest_angle(self) -> float:
        """Largest angle of the wheels to any side [rad]."""
        return float(np.abs(self.angles(self.command_limits)).max())

    def at_once(self, limit_deg: float) -> SteeringSpec:
        """Steering whose wheels have the angle of the command at once: `limit_deg` [degree] for the command 1."""
        return SteeringSpec(limit_deg=limit_deg, dead_time=0.0, time_constant=0.0)

    def angles(self, commands: ArrayLike) -> Floats:
        """Angles of the wheels at which commands in [-1, 1] end [rad], in the shape of the commands."""
        servo = np.clip(np.asarray(commands, np.float64), *self.command_limits) * self.limit
        return servo if self.is_straight else np.interp(servo, *np.transpose(self.knots))

    def commands(self, angles: ArrayLike) -> Floats:
        """Commands for angles of the wheels [rad], the nearest ones for angles that the car does not reach.

        Without a curve and an offset they are not limited.
        """
        wheels = np.asarray(angles, np.float64)
        if self.is_straight:
            return wheels / self.limit
        servo, steered_wheels = np.transpose(self.knots)
        return np.clip(np.interp(wheels, steered_wheels, servo) / self.limit, *self.command_limits)


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
