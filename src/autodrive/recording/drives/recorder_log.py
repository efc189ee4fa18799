"""Reads a log of AutoDRIVE's data recorder: 'V1 Log.csv' without a header.

A row of Nigel has 21 columns: time stamp (yyyy_MM_dd_HH_mm_ss_fff), throttle, steering [rad], ticks of the left and the
right encoder, position x, y, z [m], roll, pitch, yaw [rad], speed [m/s], angular velocity x, y, z [rad/s], linear
acceleration x, y, z [m/s^2], paths of the front and the rear image, ranges of the LIDAR [m] between blanks. A row of
the RoboRacer car has 22 columns: linear velocity x, y, z [m/s] in place of the speed, and one image.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.recording.drives.checks import LEAST_STEERING, raise_if_opposite
from autodrive.recording.drives.drive import LogProblem
from autodrive.recording.drives.text_lines import naming, text_lines
from autodrive.recording.errors import RecordingError

TIME_FORMAT = "%Y_%m_%d_%H_%M_%S_%f"
NIGEL_COLUMNS, ROBORACER_COLUMNS = 21, 22
LEAST_GAP, GAP_STEPS = 0.5, 5.0
"""A gap between two rows is longer than this [s], and than so many times the usual step."""
MOST_BACKWARD = 0.05
"""Share of the rows of a log that may be earlier than those before them, each because the clock was set back."""
LEAST_ROWS = 20
"""Rows of a log whose steering is compared with its turns."""


@dataclass(frozen=True)
class DriveLog:
    """A drive that AutoDRIVE's data recorder has recorded; arrays have one row for each row of the file."""

    time: Floats
    """Since the first row [s], without gaps and jumps of the clock, shape (n,)."""
    throttle: Floats
    """-1 to 1, shape (n,)."""
    steering: Floats
    """[rad], left positive, shape (n,)."""
    ticks: Floats
    """Ticks of the left and the right encoder, shape (n, 2)."""
    position: Floats
    """[m], shape (n, 3)."""
    euler: Floats
    """Roll, pitch, yaw [rad], shape (n, 3)."""
    speed: Floats
    """[m/s], shape (n,)."""
    angular_velocity: Floats
    """[rad/s], shape (n, 3)."""
    acceleration: Floats
    """[m/s^2], shape (n, 3)."""
    images: tuple[tuple[str, ...], ...]
    """Paths of the images of each row."""
    ranges: tuple[Floats, ...]
    """Ranges of the LIDAR of each row [m]."""
    breaks: tuple[int, ...] = ()
    """Rows, from 0, that follow a gap or a jump of the clock; `time` has the usual step there."""

    @property
    def signed_speed(self) -> Floats:
        """Speed, negative where the car drives backward [m/s], shape (n,): most logs have no sign."""
        heading = self.euler[:, 2]
        x, y = (np.gradient(self.position[:, i]) for i in range(2))
        forward = np.cos(heading) * x + np.sin(heading) * y
        return np.copysign(self.speed, np.where(self.speed < 0.0, -1.0, forward))

    @property
    def note(self) -> str:
        """Says where the log has gaps; empty if it has none."""
        if not self.breaks:
            return ""
        lines = ", ".join(str(row + 1) for row in self.breaks[:5]) + (", ..." if self.breaks[5:] else "")
        text = f"the log has gaps or jumps of its clock before lines {lines}"
        return f"{text}: each part of the drive starts with the recorded state"

    @property
    def problems(self) -> tuple[LogProblem, ...]:
        """The gaps and jumps of the clock."""
        return tuple(
            LogProblem("gap", row + 1, float(self.time[row]), f"a gap, or a jump of the clock, before line {row + 1}")
            for row in self.breaks
        )

    @property
    def vehicle_type(self) -> str:
        """Name of the type of the vehicle: 'nigel', or 'roboracer', whose log has one image in a row."""
        return "roboracer" if len(self.images[0]) == 1 else "nigel"


def read(path: Path, *, is_left_positive: bool = True) -> DriveLog:
    """Read a log of the data recorder. Raises `RecordingError` with the line that is wrong.

    `is_left_positive`: direction of the steering angle in the file, which differs between releases. A log in which the
    car turns to the other side is an error, too.
    """
    with naming(path):
        return _read(path, is_left_positive)


def _read(path: Path, is_left_positive: bool) -> DriveLog:
    rows: list[list[str]] = []
    try:
        for number, row in enumerate(csv.reader(text_lines(path)), 1):
            if len(row) not in (NIGEL_COLUMNS, ROBORACER_COLUMNS) or (rows and len(row) != len(rows[0])):
                raise RecordingError(
                    f"line {number} has {len(row)} columns; a log of Nigel has 21 and one of the RoboRacer car 22, and "
                    f"a table of other columns begins with their names"
                )
            rows.append(row)
    except csv.Error as error:
        raise RecordingError(f"cannot read the log: {error}") from None
    if len(rows) < 2:
        raise RecordingError(f"the log has {len(rows)} lines; a drive has at least 2")
    speeds = 3 if len(rows[0]) == ROBORACER_COLUMNS else 1
    times = [_time(row[0], number) for number, row in enumerate(rows, 1)]
    numbers = np.array([_numbers(row[1 : 17 + speeds], i) for i, row in enumerate(rows, 1)])
    time, breaks = _without_gaps(np.array(times))
    velocity = numbers[:, 10 : 10 + speeds]
    at = 10 + speeds
    log = DriveLog(
        time=time,
        throttle=numbers[:, 0],
        steering=numbers[:, 1] * (1.0 if is_left_positive else -1.0),
        ticks=numbers[:, 2:4],
        position=numbers[:, 4:7],
        euler=numbers[:, 7:10],
        speed=velocity[:, 0],
        angular_velocity=numbers[:, at : at + 3],
        acceleration=numbers[:, at + 3 : at + 6],
        images=tuple(tuple(row[at + 7 : -1]) for row in rows),
        ranges=tuple(np.array(_numbers(row[-1].split(), number)) for number, row in enumerate(rows, 1)),
        breaks=breaks,
    )
    _check_steering(log, "right" if is_left_positive else "left")
    return log


def _without_gaps(times: Floats) -> tuple[Floats, tuple[int, ...]]:
    """Times since the first [s] with the usual step in place of each gap, and the rows after them."""
    steps = np.diff(times)
    is_backward = steps < 0.0
    if is_backward.sum() > MOST_BACKWARD * len(steps):
        line = int(np.argmax(is_backward)) + 2
        raise RecordingError(f"line {line}: the time stamp is earlier than the one before; sort the lines by time")
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    is_break = is_backward | (steps > max(LEAST_GAP, GAP_STEPS * usual))
    return np.concatenate(([0.0], np.cumsum(np.where(is_break, usual, steps)))), tuple(
        (np.flatnonzero(is_break) + 1).tolist()
    )


def _check_steering(log: DriveLog, other_side: str) -> None:
    """Raises `RecordingError` if the car turns to the other side than its steering."""
    if len(log.time) < LEAST_ROWS:
        return
    step = np.maximum(np.gradient(log.time), 1e-6)
    heading = log.euler[:, 2]
    forward = (
        np.cos(heading) * np.gradient(log.position[:, 0]) + np.sin(heading) * np.gradient(log.position[:, 1])
    ) / step
    turn = np.gradient(np.unwrap(heading)) / step
    raise_if_opposite(log.steering, turn, forward, LEAST_STEERING, other_side)


def _time(text: str, line: int) -> float:
    try:
        return datetime.strptime(text + "000", TIME_FORMAT).replace(tzinfo=UTC).timestamp()
    except ValueError:
        example = "2026_01_31_13_45_10_250"
        raise RecordingError(f"line {line}: the time stamp must be such as {example}, not '{text[:40]}'") from None


def _numbers(texts: list[str], line: int) -> list[float]:
    try:
        return [float(text) for text in texts]
    except ValueError as error:
        raise RecordingError(f"line {line}: {error}") from None
