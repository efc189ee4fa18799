"""Tables of a recording: the signals of a vehicle as columns."""

from __future__ import annotations

import importlib
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.installation import pip
from autodrive.protocol.channels import OwnSignal
from autodrive.recording.errors import RecordingError
from autodrive.recording.signals import Signals

Library: TypeAlias = Literal["pandas", "polars"]


def columns(signals: Signals, vehicle: str) -> dict[str, NDArray[Any]]:
    """Arrays of shape (n,) by name of a column: 'time' [s], then each element of each signal, such as 'ips.position.x'.

    Without scans, whose times are others, and without signals that the vehicle does not have. A sensor of the user has
    its latest reading in each row.
    """
    table: dict[str, NDArray[Any]] = {}
    for name, signal in signals.described.items():
        if not name.startswith(f"{vehicle}/") or signal.size or signal.name.startswith("lidar."):
            continue
        values = signals[name]
        if not table:
            table["time"] = signals.times(name)
        if values.dtype.kind == "f" and not np.any(~np.isnan(values)) and signal.is_optional:
            continue
        rows = signals.at_frames(name) if isinstance(signal, OwnSignal) else values.reshape(len(values), -1)
        for i, column in enumerate(signal.columns):
            table[column] = rows[:, min(i, rows.shape[1] - 1)]
    if not table:
        raise RecordingError(f"vehicle '{vehicle}' is not in the recording")
    return table


def table(signals: Signals, vehicle: str, library: Library) -> Any:
    """The `columns` as a data frame of pandas or polars. Raises `RecordingError` if the library is not installed."""
    if library not in ("pandas", "polars"):
        raise RecordingError(f"the library of a table must be 'pandas' or 'polars', not '{library}'")
    try:
        made = importlib.import_module(library)
    except ImportError:
        raise RecordingError(f"{library} is not installed. Install it:  {pip('install')} {library}") from None
    return made.DataFrame(columns(signals, vehicle))
