"""Rows of a log before they are a drive: each has a time and some of the quantities."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.recording.drives.drive import LogProblem

MAX_ROWS = 500_000
"""Most rows of a log that is read: 83 minutes at 100 Hz."""


@dataclass
class LogRows:
    """Rows of a log, in the order of the file."""

    time: Floats
    """[s], shape (r,)."""
    lines: Integers
    """Line of the file of each row, or number of the message, shape (r,)."""
    values: dict[str, Floats]
    """Quantity, see `options.UNITS`, in SI units -> shape (r,); NaN: the row does not have it."""
    units: dict[str, str]
    """Unit that the log gives for a quantity; '': none."""
    source: str
    """File, with the run."""
    line_name: str = "line"
    """'line' or 'message'."""
    problems: list[LogProblem] = field(default_factory=list[LogProblem])

    def has(self, quantity: str) -> bool:
        """Whether any row has the quantity."""
        return quantity in self.values and bool(np.isfinite(self.values[quantity]).any())

    def chosen(self, rows: Integers | NDArray[np.bool_]) -> LogRows:
        """Some of the rows."""
        values = {name: column[rows] for name, column in self.values.items()}
        return LogRows(
            self.time[rows], self.lines[rows], values, self.units, self.source, self.line_name, self.problems
        )

    def place(self, row: int) -> str:
        """Words for the line of a row."""
        return f"{self.line_name} {self.lines[row]}"
