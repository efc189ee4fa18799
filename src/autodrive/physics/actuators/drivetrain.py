"""The drivetrain: motor, differentials, and brakes that apply automatically at zero throttle."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, model_validator

from autodrive.base.specs import Spec
from autodrive.base.units import RPM

Speed: TypeAlias = Annotated[float, Field(ge=0.0, le=1e6)]
Share: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0)]


class DifferentialSpec(Spec):
    """A differential between two wheels, or between the axles.

    An open one gives both outputs the same torque. A locked one keeps their speeds equal. A limited-slip one keeps them
    equal as long as that takes less than the torque `preload` + `bias` x drive torque.
    """

    kind: Literal["open", "locked", "limited_slip"] = "open"
    preload: float = Field(default=0.0, ge=0, le=1e6)
    """Torque that a limited-slip differential transfers without drive torque [N m]."""
    bias: float = Field(default=0.0, ge=0, le=1e3)
    """Torque that a limited-slip differential transfers in addition, per drive torque of an output."""

    @model_validator(mode="after")
    def _slips(self) -> DifferentialSpec:
        if (self.kind == "limited_slip") != (self.preload + self.bias > 0.0):
            raise ValueError("preload and bias are only for kind: limited_slip, which needs preload or bias above 0")
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Largest torque between the outputs: constant part [N m], and part per drive torque."""
        return (math.inf, 0.0) if self.kind == "locked" else (self.preload, self.bias)


class DifferentialsSpec(Spec):
    """The differentials; that of an axle without drive has no effect, nor that between the axles if one has none."""

    front: DifferentialSpec = DifferentialSpec()
    centre: DifferentialSpec = DifferentialSpec()
    """Differential between the axles; locked: a rigid shaft."""
    rear: DifferentialSpec = DifferentialSpec()


class DrivetrainSpec(Spec):
    """Response of motors and brakes to the throttle; zero throttle brakes (report, section 3.1.3)."""

    control: Literal["speed", "torque"]
    """speed: the throttle sets the wheel speed; the motors apply up to torque_limit to reach it. torque: the throttle
    sets the torque; the speed results from the resistances."""
    speed_limit_rpm: float = Field(ge=0.01, le=1e6)
    """Wheel speed at full throttle [rpm] (report: 130); in torque control, the highest speed that a motor drives."""
    torque_limit: float = Field(ge=1e-6, le=1e6)
    """Largest torque of each motor at its wheel [N m]."""
    torque_curve: Annotated[tuple[tuple[Speed, Share], ...], Field(max_length=8)] = ()
    """Torque over speed of the motor: pairs of wheel speed [rpm] and share of torque_limit, linear between them;
    omitted: the same torque at any speed. A motor that brakes has the whole torque."""
    servo_gain: float = Field(ge=1e-6, le=1e6)
    """Torque per difference of the mean wheel speed from its target [N m s/rad]."""
    brake_torque: float = Field(ge=0, le=1e6)
    """Holding torque at each braked wheel while the throttle is zero [N m]."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first response of motors or brakes [s]."""
    time_constant: float = Field(ge=0, le=1)
    """Time constant of the first-order lag of the drive [s]; 0: none."""
    differentials: DifferentialsSpec = DifferentialsSpec()
    """Default: all are open, as with a motor of its own at each driven wheel."""

    @model_validator(mode="after")
    def _rises(self) -> DrivetrainSpec:
        speeds = [speed for speed, _ in self.torque_curve]
        if len(speeds) == 1 or any(b <= a for a, b in pairwise(speeds)):
            raise ValueError("torque_curve needs two points or more, with rising speeds")
        return self

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
