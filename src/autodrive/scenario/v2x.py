"""The radio channel of a scenario over which vehicles hear each other and traffic lights."""

from __future__ import annotations

from pydantic import Field

from autodrive.base.specs import Spec


class V2xSpec(Spec):
    """Every vehicle and traffic light sends messages to all vehicles in range; all receptions are independent."""

    range: float = Field(default=10.0, gt=0.0, le=1e4)
    """Greatest distance between sender and receiver at the time of sending [m]."""
    rate: float = Field(default=10.0, ge=0.1, le=1e3)
    """Messages of each sender per second [Hz]; at most one in a tick."""
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    """Least time from sending to reception [s]."""
    jitter: float = Field(default=0.0, ge=0.0, le=1.0)
    """Mean of the exponentially distributed time that is added to the delay [s]."""
    loss: float = Field(default=0.0, ge=0.0, le=1.0)
    """Probability that a receiver does not get a message."""
    position_noise: float = Field(default=0.0, ge=0.0, le=1e3)
    """Standard deviation of x and y in each message of a vehicle [m]."""
