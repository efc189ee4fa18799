"""A drive in closed form, and its log as a table with faults."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats

RADIUS, SPEED = 2.0, 1.5
"""Circle of the rear axle [m], and speed [m/s]."""
STEP = 0.02
"""Time between rows [s]."""


def circle(duration: float = 8.0, tracked_point: tuple[float, float] = (0.0, 0.0)) -> dict[str, Floats]:
    """A car on a circle to the left, from the origin along x; the position is that of a point of the car."""
    time = np.arange(0.0, duration, STEP)
    yaw = SPEED / RADIUS * time
    forward, left = tracked_point
    return {
        "time": time,
        "x": RADIUS * np.sin(yaw) + forward * np.cos(yaw) - left * np.sin(yaw),
        "y": RADIUS * (1.0 - np.cos(yaw)) + forward * np.sin(yaw) + left * np.cos(yaw),
        "yaw": yaw,
        "throttle": 0.4 + 0.1 * np.sin(time),
        "steering": np.full(len(time), 0.3),
    }


def write(path: Path, columns: Mapping[str, Floats | Sequence[str]], rows: Sequence[int] | None = None) -> Path:
    """Write a table; NaN is an empty cell. `rows`: which rows of the columns are written, in order."""
    count = len(next(iter(columns.values())))
    lines = [",".join(columns)]
    for row in range(count) if rows is None else rows:
        lines.append(",".join(cell_of(column[row]) for column in columns.values()))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def cell_of(value: float | str) -> str:
    """The text of a cell."""
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else repr(float(value))
