"""Tables of a recording as CSV: one of each vehicle, its scans, the commands and the events."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from autodrive.base.cache import make_folder
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.options import ExportOptions
from autodrive.recording.records import encode_json


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
        chosen = _range(table["time"], options)
        _table(path / f"{vehicle}.csv", [*table], zip(*(table[name][chosen].tolist() for name in table), strict=True))
        name = f"{vehicle}/lidar/ranges"
        ranges, times = recording[name], recording.signals.times(name)
        if len(ranges):
            rays = [f"range_{i}" for i in range(ranges.shape[1])]
            of = _range(times, options)
            rows = ([time, *scan] for time, scan in zip(times[of].tolist(), ranges[of].tolist(), strict=True))
            _table(path / f"{vehicle}_lidar.csv", ["time", *rays], rows)
    commands = (
        [time, record.tick, vehicle, *(getattr(command, name) for name in _COMMAND)]
        for time, record in recording.commands
        for vehicle, command in record.commands.items()
        if vehicle in vehicles and _range(time, options)
    )
    _table(path / "commands.csv", ["time", "tick", "vehicle", *_COMMAND], commands)
    events = (
        [time, tick, type(event).__name__, encode_json(event).decode()]
        for time, tick, event in recording.events
        if getattr(event, "vehicle", vehicles[0]) in vehicles and _range(time, options)
    )
    _table(path / "events.csv", ["time", "tick", "event", "values"], events)


_COMMAND = ("throttle", "steering", "headlights", "indicators")


def _range(times: Any, options: ExportOptions) -> Any:
    start = -np.inf if options.start is None else options.start
    end = np.inf if options.end is None else options.end
    return (times >= start) & (times <= end)


def _table(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
