"""The layout of AutoDRIVE's data recorder, in both directions: 'V1 Log.csv' without a header, and a folder of images.

A row of Nigel has 21 columns: time stamp (yyyy_MM_dd_HH_mm_ss_fff), throttle, steering [rad], ticks of the left and the
right encoder, position x, y, z [m], roll, pitch, yaw [rad], speed [m/s], angular velocity x, y, z [rad/s], linear
acceleration x, y, z [m/s^2], paths of the front and the rear image, ranges of the LIDAR [m] between blanks. A row of
the RoboRacer car has 22 columns: linear velocity x, y, z [m/s] in place of the speed, and one image.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import make_folder, write_file
from autodrive.base.readable import readable
from autodrive.protocol.messages import VehicleFrame
from autodrive.recording import Moment, Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages

TIME_FORMAT = "%Y_%m_%d_%H_%M_%S_%f"
NIGEL_COLUMNS, ROBORACER_COLUMNS = 21, 22
RATES = {NIGEL_COLUMNS: 10.0, ROBORACER_COLUMNS: 30.0}
"""Rates of the original data recorder [Hz]."""
MAX_ROWS = 10_000_000
"""Largest length of a log that is read."""
LEAST_GAP, GAP_STEPS = 0.5, 5.0
"""A gap between two rows is longer than this [s], and than so many times the usual step."""
MOST_BACKWARD = 0.05
"""Share of the rows of a log that may be earlier than those before them, each because the clock was set back."""
LEAST_STEERING, LEAST_TURN, LEAST_SPEED, LEAST_ROWS = 0.03, 0.1, 0.05, 20
"""Least angle [rad], yaw rate [rad/s] and speed [m/s] of rows that show the sign of the steering, and their number."""
MOST_OPPOSITE = 0.8
"""Share of these rows; if more of them turn to the other side, the sign of the steering is wrong."""


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write 'V1 Log.csv' and 'V1 Camera Frames' of each vehicle into a folder."""
    make_folder(path)
    for vehicle in options.vehicles(recording):
        type_ = recording.scenario_of(vehicle).spec["vehicles"][vehicle]["type"]
        columns = ROBORACER_COLUMNS if Path(type_).stem.startswith("roboracer") else NIGEL_COLUMNS
        began = datetime.strptime(recording.about.get("recorded_at", "2000-01-01T00:00:00Z"), "%Y-%m-%dT%H:%M:%SZ")
        with (path / f"{vehicle} Log.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            images = _ImageFiles(path, vehicle, 1 if columns == ROBORACER_COLUMNS else 2)
            for moment in options.moments(recording, options.rate or RATES[columns]):
                if vehicle not in moment.frame.vehicles:
                    continue
                stamp = (began + timedelta(seconds=moment.time)).strftime(TIME_FORMAT)[:-3]
                writer.writerow(_row(moment, vehicle, stamp, columns, images))


class _ImageFiles:
    """Writes each image once; `count` cameras have a column."""

    def __init__(self, path: Path, vehicle: str, count: int) -> None:
        self._path, self._folder = path, f"{vehicle} Camera Frames"
        self._count = count
        self._latest: dict[str, tuple[float, str]] = {}

    def paths(self, frame: VehicleFrame, stamp: str) -> list[str]:
        """Path of the latest image of each camera; empty before there is one."""
        cameras = frame.cameras
        assert isinstance(cameras, LazyImages)
        names = [name for name in ("front", "rear") if name in cameras]
        names = (names or [*cameras])[: self._count]
        written = [self._written(cameras, name, i, stamp) for i, name in enumerate(names)]
        return written + [""] * (self._count - len(written))

    def _written(self, cameras: LazyImages, name: str, number: int, stamp: str) -> str:
        time, path = self._latest.get(name, (math.nan, ""))
        if time != cameras.times[name] and (picture := cameras.picture(name)) is not None:
            path = f"{self._folder}/Camera{number}_Frame_{stamp}.jpg"
            make_folder(self._path / self._folder)
            write_file(self._path / path, picture.jpeg)
            self._latest[name] = picture.time, path
        return path


def _row(moment: Moment, vehicle: str, stamp: str, columns: int, images: _ImageFiles) -> list[object]:
    frame = moment.frame.vehicles[vehicle]
    velocity = frame.velocity.tolist()
    return [
        stamp,
        frame.throttle,
        frame.steering,
        *frame.encoders.ticks.tolist(),
        *frame.ips.position.tolist(),
        *frame.imu.euler.tolist(),
        *(velocity if columns == ROBORACER_COLUMNS else [math.hypot(*velocity)]),
        *frame.imu.angular_velocity.tolist(),
        *frame.imu.linear_acceleration.tolist(),
        *images.paths(frame, stamp),
        "" if frame.lidar is None else " ".join(map(str, frame.lidar.ranges.tolist())),
    ]


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
    def note(self) -> str:
        """Says where the log has gaps; empty if it has none."""
        if not self.breaks:
            return ""
        lines = ", ".join(str(row + 1) for row in self.breaks[:5]) + (", ..." if self.breaks[5:] else "")
        text = f"the log has gaps or jumps of its clock before lines {lines}"
        return f"{text}: each part of the drive starts with the recorded state"

    @property
    def vehicle_type(self) -> str:
        """Name of the type of the vehicle: 'nigel', or 'roboracer', whose log has one image in a row."""
        return "roboracer" if len(self.images[0]) == 1 else "nigel"


def read(path: Path, *, is_left_positive: bool = True) -> DriveLog:
    """Read a log of the data recorder. Raises `RecordingError` with the line that is wrong.

    `is_left_positive`: direction of the steering angle in the file, which differs between releases. A log in which the
    car turns to the other side is an error, too.
    """
    rows: list[list[str]] = []
    try:
        with readable(path).open(newline="", encoding="utf-8-sig") as file:  # a spreadsheet may have written it
            for number, row in enumerate(csv.reader(file), 1):
                if len(row) not in (NIGEL_COLUMNS, ROBORACER_COLUMNS) or (rows and len(row) != len(rows[0])):
                    raise RecordingError(
                        f"line {number} has {len(row)} columns; a log of Nigel has 21 and one of the RoboRacer car 22  "
                        f"({path})"
                    )
                rows.append(row)
                if number > MAX_ROWS:
                    raise RecordingError(f"the log has more than {MAX_ROWS} lines  ({path})")
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"cannot read the log: {error}  ({path})") from None
    if len(rows) < 2:
        raise RecordingError(f"the log has {len(rows)} lines; a drive has at least 2  ({path})")
    speeds = 3 if len(rows[0]) == ROBORACER_COLUMNS else 1
    times = [_time(row[0], number, path) for number, row in enumerate(rows, 1)]
    numbers = np.array([_numbers(row[1 : 17 + speeds], i, path) for i, row in enumerate(rows, 1)])
    time, breaks = _without_gaps(np.array(times), path)
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
        ranges=tuple(np.array(_numbers(row[-1].split(), number, path)) for number, row in enumerate(rows, 1)),
        breaks=breaks,
    )
    _check_steering(log, "right" if is_left_positive else "left", path)
    return log


def _without_gaps(times: Floats, path: Path) -> tuple[Floats, tuple[int, ...]]:
    """Times since the first [s] with the usual step in place of each gap, and the rows after them."""
    steps = np.diff(times)
    is_backward = steps < 0.0
    if is_backward.sum() > MOST_BACKWARD * len(steps):
        line = int(np.argmax(is_backward)) + 2
        raise RecordingError(
            f"line {line}: the time stamp is earlier than the one before; sort the lines by time  ({path})"
        )
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    is_break = is_backward | (steps > max(LEAST_GAP, GAP_STEPS * usual))
    return np.concatenate(([0.0], np.cumsum(np.where(is_break, usual, steps)))), tuple(
        (np.flatnonzero(is_break) + 1).tolist()
    )


def _check_steering(log: DriveLog, other_side: str, path: Path) -> None:
    """Raises `RecordingError` if the car turns to the other side than its steering."""
    if len(log.time) < LEAST_ROWS:
        return
    step = np.maximum(np.gradient(log.time), 1e-6)
    heading = log.euler[:, 2]
    forward = (
        np.cos(heading) * np.gradient(log.position[:, 0]) + np.sin(heading) * np.gradient(log.position[:, 1])
    ) / step
    turn = np.gradient(np.unwrap(heading)) / step
    is_clear = (np.abs(log.steering) > LEAST_STEERING) & (np.abs(turn) > LEAST_TURN) & (np.abs(forward) > LEAST_SPEED)
    is_opposite = (log.steering * turn * forward < 0.0)[is_clear]
    if len(is_opposite) >= LEAST_ROWS and is_opposite.mean() > MOST_OPPOSITE:
        raise RecordingError(
            f"the car turns to the opposite side of its steering: a positive angle in this log points to the "
            f"{other_side}, use --steering {other_side}  ({path})"
        )


def _time(text: str, line: int, path: Path) -> float:
    try:
        return datetime.strptime(text + "000", TIME_FORMAT).replace(tzinfo=UTC).timestamp()
    except ValueError:
        example = "2026_01_31_13_45_10_250"
        raise RecordingError(
            f"line {line}: the time stamp must be such as {example}, not '{text[:40]}'  ({path})"
        ) from None


def _numbers(texts: list[str], line: int, path: Path) -> list[float]:
    try:
        return [float(text) for text in texts]
    except ValueError as error:
        raise RecordingError(f"line {line}: {error}  ({path})") from None
