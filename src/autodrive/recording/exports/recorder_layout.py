"""Writes the layout of AutoDRIVE's data recorder: 'V1 Log.csv' without a header, and a folder of images.

`autodrive.recording.drives.recorder_log` describes the columns and reads such a log.
"""

from __future__ import annotations

import csv
import math
from datetime import datetime, timedelta
from pathlib import Path

from autodrive.base.cache import make_folder, write_file
from autodrive.protocol.messages import VehicleFrame
from autodrive.recording import Moment, Recording
from autodrive.recording.drives.recorder_log import NIGEL_COLUMNS, ROBORACER_COLUMNS, TIME_FORMAT
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.recording import LazyImages

RATES = {NIGEL_COLUMNS: 10.0, ROBORACER_COLUMNS: 30.0}
"""Rates of the original data recorder [Hz]."""


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
