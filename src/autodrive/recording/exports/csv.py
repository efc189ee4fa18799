"""Tables of a recording as CSV: one of each vehicle, its scans, the commands and the events."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from autodrive.base.cache import make_folder
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.foxglove import lidar_scan
from autodrive.recording.records import encode_json, scan_topic


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write `V1.csv`, `V1_lidar.csv`, `commands.csv` and `events.csv` into a folder.

    The columns have the names of the signals and their elements; times are in seconds since the start of the
    recording. A table has all Frames, scans, commands or events from `start` to `end`.
    """
    if options.rate is not None:
        raise RecordingError("the tables have a row for each Frame and each scan: leave out the rate")
    make_folder(path)
    vehicles = options.vehicles(recording)
    for vehicle in vehicles:
        table = recording.columns(vehicle)
        chosen = options.includes(table["time"])
        _table(path / f"{vehicle}.csv", [*table], zip(*(table[name][chosen].tolist() for name in table), strict=True))
        _scans(recording, vehicle, path, options)
    commands = (
        [time, record.tick, vehicle, *(getattr(command, name) for name in _COMMAND)]
        for time, record in recording.commands
        for vehicle, command in record.commands.items()
        if vehicle in vehicles and options.includes(time)
    )
    _table(path / "commands.csv", ["time", "tick", "vehicle", *_COMMAND], commands)
    events = (
        [time, tick, type(event).__name__, encode_json(event).decode()]
        for time, tick, event in recording.events
        if getattr(event, "vehicle", None) in (None, *vehicles) and options.includes(time)
    )
    _table(path / "events.csv", ["time", "tick", "event", "values"], events)


def _scans(recording: Recording, vehicle: str, path: Path, options: ExportOptions) -> None:
    """Write the scans of a vehicle, if it has any; ray i points at `angle_min + i * angle_increment` [rad]."""
    topic = scan_topic(vehicle)
    scans = [lidar_scan(recording.scan_message.struct(data)) for data in recording.messages_of(topic)]
    if not scans:
        return
    rays = [f"range_{i}" for i in range(max(len(scan.ranges) for scan in scans))]
    rows = (
        [time, scan.angle_min, scan.angle_increment, *scan.ranges.tolist(), *[""] * (len(rays) - len(scan.ranges))]
        for time, scan in zip(recording.log_times(topic).tolist(), scans, strict=True)
        if options.includes(time)
    )
    _table(path / f"{vehicle}_lidar.csv", ["time", "angle_min", "angle_increment", *rays], rows)


_COMMAND = ("throttle", "steering", "headlights", "indicators")


def _table(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
