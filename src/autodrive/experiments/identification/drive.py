"""A recorded drive that parameters can be fitted to."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from autodrive.base.errors import AutodriveError
from autodrive.recording import RecordingError
from autodrive.recording.drives import Drive, LogOptions, read_drives

MIN_DURATION = 2.0
"""Shortest drive [s]."""
MIN_ROWS = 20
"""Fewest rows of a drive."""
LEAST_THROTTLE = 1e-3
"""A drive whose throttle is never greater has no commands."""


class IdentificationError(AutodriveError):
    """Parameters cannot be fitted: the drive, a parameter or a bound is wrong. The message has all faults."""


def read_drive(
    path: str | Path, name: str = "", *, is_left_positive: bool = True, options: LogOptions | None = None
) -> Drive:
    """Read the only drive of a file, and check that parameters can be fitted to it; see `read_drives`.

    `name`: the vehicle of a recording; empty: the first one. `is_left_positive`: of the steering of a log. `options`:
    how a log is read, in place of both. Raises `IdentificationError` and `RecordingError`.
    """
    drive, *others = read_drives(path, options or LogOptions(name=name, is_left_positive=is_left_positive))
    if others:
        raise RecordingError(f"the log has {1 + len(others)} runs: choose a run, or use read_drives  ({path})")
    check_drive(drive)
    return drive


def check_drive(drive: Drive) -> None:
    """Raises `IdentificationError` if parameters cannot be fitted to a drive."""
    rows = len(drive.time)
    columns = {"time": drive.time, "x": drive.x, "y": drive.y, "heading": drive.heading, "speed": drive.speed}
    columns |= {"yaw rate": drive.yaw_rate, "throttle": drive.throttle, "steering": drive.steering}
    wrong = {name: ~np.isfinite(column) for name, column in columns.items()}
    problems = [
        f"the {name} of row {int(np.argmax(is_wrong)) + 1} is not a finite number"
        for name, is_wrong in wrong.items()
        if is_wrong.any()
    ]
    if rows < MIN_ROWS or drive.duration < MIN_DURATION:
        length = drive.duration if rows else 0.0
        problems.append(
            f"the drive is too short: {rows} rows in {length:.2f} s; it must have {MIN_ROWS} rows and "
            f"{MIN_DURATION:g} s"
        )
    if not problems and not (np.abs(drive.throttle) > LEAST_THROTTLE).any():
        problems.append("the drive has no commands: its throttle is always 0")
    if problems:
        raise IdentificationError(f"{'; '.join(problems)}  ({drive.source})")
