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

    control: Literal["speed", "torque", "voltage"]
    """speed: the throttle sets the wheel speed; the motors apply up to torque_limit to reach it. torque: the throttle
    sets the torque; the speed results from the resistances. voltage: the throttle sets the torque at rest, which falls
    linearly to 0 at speed_limit_rpm and brakes beyond, as the back EMF of a brushed motor."""
    speed_limit_rpm: float = Field(ge=0.01, le=1e6)
    """Wheel speed at full throttle [rpm] (report: 130); in torque control, the highest speed that a motor drives; in
    voltage control, the speed at which the back EMF cancels the torque of any throttle."""
    speed_gain: float = Field(default=1.0, ge=0.01, le=100)
    """Factor of the speed that the throttle asks for, in speed control: a controller that is not calibrated."""
    speed_offset_rpm: float = Field(default=0.0, ge=-1e6, le=1e6)
    """Wheel speed that is added to it [rpm]."""
    torque_limit: float = Field(ge=1e-6, le=1e6)
    """Largest torque of each motor at its wheel [N m]; in voltage control at rest."""
    throttle_curve: Annotated[tuple[tuple[Share, Share], ...], Field(max_length=9)] = ()
    """Torque over throttle, in torque and voltage control: pairs of throttle and share of torque_limit, linear between
    them, constant beyond the ends; omitted: proportional. A motor with a threshold of 0.15: [[0.15, 0], [1, 1]]."""
    torque_curve: Annotated[tuple[tuple[Speed, Share], ...], Field(max_length=8)] = ()
    """Torque over speed of the motor: pairs of wheel speed [rpm] and share of torque_limit, linear between them;
    omitted: the same torque at any speed. A motor that brakes has the whole torque."""
    servo_gain: float = Field(ge=1e-6, le=1e6)
    """Torque per difference of the mean wheel speed from its target [N m s/rad]."""
    brake_torque: float = Field(ge=0, le=1e6)
    """Holding torque at each braked wheel while the throttle is zero [N m]."""
    coasts: bool = False
    """Zero throttle does not brake: the torque is that of a drive level of 0, and in speed control the motors are
    off."""
    has_reverse: bool = True
    """A negative throttle drives backwards; otherwise it counts as zero."""
    dead_time: float = Field(ge=0, le=1)
    """Delay from a command to the first response of motors or brakes [s]."""
    time_constant: float = Field(ge=0, le=1)
    """Time constant of the first-order lag of the drive [s]; 0: none."""
    rate_limit: float | None = Field(default=None, ge=1e-3, le=1e9)
    """Largest change of the drive level, which follows the throttle, per second [1/s]: the ramp of a speed controller,
    whose reference accelerates with the product of this and the speed at full throttle; omitted: no limit."""
    differentials: DifferentialsSpec = DifferentialsSpec()
    """Default: all are open, as with a motor of its own at each driven wheel."""

    @model_validator(mode="after")
    def _rises(self) -> DrivetrainSpec:
        speeds = [speed for speed, _ in self.torque_curve]
        if len(speeds) == 1 or any(b <= a for a, b in pairwise(speeds)):
            raise ValueError("torque_curve needs two points or more, with rising speeds")
        throttles = [throttle for throttle, _ in self.throttle_curve]
        if len(throttles) == 1 or any(b <= a for a, b in pairwise(throttles)):
            raise ValueError("throttle_curve needs two points or more, with rising throttle")
        if self.control == "voltage" and self.torque_curve:
            raise ValueError(
                "torque_curve is for speed and torque control: with control: voltage the torque falls "
                "linearly to 0 at speed_limit_rpm"
            )
        if self.control == "speed" and self.throttle_curve:
            raise ValueError(
                "throttle_curve is for torque and voltage control: with control: speed the throttle sets a speed"
            )
        if self.control != "speed" and (self.speed_gain, self.speed_offset_rpm) != (1.0, 0.0):
            raise ValueError("speed_gain and speed_offset_rpm are for control: speed")
        return self

    @property
    def speed_limit(self) -> float:
        """Wheel speed at full throttle [rad/s]."""
        return self.speed_limit_rpm * RPM


def drive_level(level: float, throttle: float, response: float, rate_limit: float, coasts: bool, dt: float) -> float:
    """The drive level [-1, 1] after `dt` [s]: a first-order lag of the throttle, limited to `rate_limit` [1/s].

    `response` is 1 - exp(-dt / time_constant). Zero throttle resets the level to zero, unless the drive `coasts`.
    """
    if throttle == 0.0 and not coasts:
        return 0.0
    step = rate_limit * dt
    return level + max(-step, min(step, (throttle - level) * response))


def drive_target(
    level: float, is_speed_controlled: bool, speed_limit: float, speed_gain: float, speed_offset: float
) -> float:
    """Target wheel speed of the motors [rad/s]."""
    if is_speed_controlled:
        return level * speed_limit * speed_gain + speed_offset
    return speed_limit if level > 0.0 else -speed_limit


def drive_torque_limit(share: float, is_speed_controlled: bool, torque_limit: float) -> float:
    """Largest torque of each motor [N m] at a throttle that gives this share of its torque."""
    return torque_limit if is_speed_controlled else share * torque_limit
