"""A drive: what a car was commanded, and how it moved."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np

from autodrive.base.arrays import Floats, Integers

LISTED = 3
"""Problems of each kind that a text lists."""


class LogProblem(NamedTuple):
    """A part of a log that is wrong or left out, and does not prevent that the rest is used."""

    kind: str
    """'gap', 'clock', 'order', 'duplicate', 'repeated', 'frozen', 'jump', 'no command', 'switch', 'standing', 'limit',
    'heading', 'speed', 'yaw rate' or 'column'."""
    line: int
    """Line of the file, or number of the message in a bag, from 1; 0: the whole log."""
    time: float
    """Place in the drive [s]: on the axis of `Drive.time`."""
    text: str
    """Description in words, with the lines."""


def _no_lines() -> Integers:
    return np.empty(0, np.int64)


@dataclass(frozen=True)
class Drive:
    """What a car was commanded, and how it moved. Arrays have one row for each of n instants or m commands."""

    time: Floats
    """Rising [s], shape (n,)."""
    x: Floats
    """Centre of the rear axle [m], shape (n,)."""
    y: Floats
    """Position of the centre of the rear axle along y of the map [m], shape (n,)."""
    heading: Floats
    """[rad], shape (n,)."""
    speed: Floats
    """Speed of the centre of the rear axle [m/s], negative in reverse, shape (n,)."""
    yaw_rate: Floats
    """[rad/s], shape (n,)."""
    command_time: Floats
    """When each command began to hold [s], shape (m,)."""
    throttle: Floats
    """Throttle or speed that was commanded, see `throttle_unit`, shape (m,)."""
    steering: Floats
    """Steering that was commanded, see `steering_unit`, or the angle that it had [rad]; left positive, shape (m,)."""
    is_angle: bool
    """Whether `steering` is the angle that was measured: then a drive does not show how the steering obeys."""
    breaks: Floats
    """Times of collisions, resets, jumps and gaps [s]; the simulation explains no motion across them, shape (k,)."""
    tick: float = 0.01
    """Tick of the simulation [s]."""
    substep: float = 0.001
    """Substep of the simulation [s]."""
    grip: float = 1.0
    """Factor of the friction of the ground."""
    source: str = "the drive"
    """File that it comes from, with the run."""
    note: str = ""
    """What a user should know about it."""
    throttle_unit: Literal["share", "m/s"] = "share"
    """Unit of `throttle`: the share of `Command.throttle` in [-1, 1], or a commanded speed."""
    steering_unit: Literal["share", "rad"] = "share"
    """Unit of `steering`: the share of `Command.steering` in [-1, 1], or a commanded angle."""
    command_period: float = 0.0
    """Median time between commands [s]: a command may be so much older than its row; 0: not known."""
    tracked_point: tuple[float, float] = (0.0, 0.0)
    """Measured point, forward and left of the centre of the rear axle [m]; the positions are already converted."""
    heading_offset: float = 0.0
    """Angle that was added to the yaw of the log [rad]."""
    clock_offset: float = 0.0
    """Time that was added to the times of the commands [s]."""
    has_pose: bool = True
    """Whether the log has poses; otherwise x, y and heading are integrated from speed and yaw rate."""
    is_differentiated: bool = False
    """Whether speed and yaw rate come from the poses."""
    lines: Integers = field(default_factory=_no_lines)
    """Line of the file of each row, or number of its message, shape (n,); empty: not known."""
    command_lines: Integers = field(default_factory=_no_lines)
    """Line of the file of each command, or number of its message, shape (m,); empty: not known."""
    problems: tuple[LogProblem, ...] = ()
    """What is wrong in the log or left out, in the order of the log."""

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1] - self.time[0])

    def in_shares(self, full_speed: float, full_angle: float) -> Drive:
        """The drive with the commands that a vehicle of the simulator takes, each in [-1, 1].

        `full_speed` [m/s] and `full_angle` [rad] are what the vehicle does at 1. A measured angle stays one.
        """
        changes: dict[str, object] = {}
        if self.throttle_unit == "m/s":
            changes |= {"throttle": np.clip(self.throttle / full_speed, -1.0, 1.0), "throttle_unit": "share"}
        if self.steering_unit == "rad" and not self.is_angle:
            changes |= {"steering": np.clip(self.steering / full_angle, -1.0, 1.0), "steering_unit": "share"}
        return replace(self, **changes)  # pyright: ignore[reportArgumentType]

    def problem_texts(self) -> list[str]:
        """The problems in words: of each kind the first, and how many more there are."""
        texts: list[str] = []
        for kind in dict.fromkeys(problem.kind for problem in self.problems):
            same = [problem.text for problem in self.problems if problem.kind == kind]
            texts += same[:LISTED]
            if more := len(same) - LISTED:
                texts += [f"{more} more of this kind: {kind}"] * (more > 0)
        return texts
