"""Reads tables: CSV with a header, whose columns have names and units."""

from __future__ import annotations

import csv
import math
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from autodrive.base.suggest import suggest
from autodrive.recording.drives.drive import LogProblem
from autodrive.recording.drives.options import LogOptions, TableColumn, columns_of
from autodrive.recording.drives.rows import MAX_ROWS, LogRows
from autodrive.recording.drives.text_lines import naming, text_lines
from autodrive.recording.errors import RecordingError

DELIMITERS = ",;\t"
MOST_FAULTS = 5
"""Cells that a message names."""
MAX_RUNS = 1000
"""Most runs of a table."""
SWITCHES = ("safety", "deadman", "dead_man", "enable", "estop", "e_stop")
"""Words in the names of columns that probably switch the motor off."""


def read_table(path: Path, options: LogOptions) -> list[LogRows]:
    """The rows of each run of a table with a header; without a column 'run' there is one run.

    A cell may be empty: the row does not have that quantity. Raises `RecordingError` with the line.
    """
    with naming(path):
        return _read(path, options)


def _read(path: Path, options: LogOptions) -> list[LogRows]:
    lines = text_lines(path)
    first = next(lines, "")
    delimiter = max(DELIMITERS, key=first.count)
    reader = csv.reader(_chained(first, lines), delimiter=delimiter)
    try:
        header = [cell.strip() for cell in next(reader, [])]
        columns = columns_of(header, options.columns)
        if "time" not in columns:
            raise RecordingError(
                f"the table has no column 'time'; name it, such as --columns time={header[0] if header else 't'}. "
                f"Columns: {', '.join(header)[:400]}"
            )
        run = columns.pop("run", None)
        numbers, runs, row_lines = _cells(reader, columns, run, len(header))
    except csv.Error as error:
        raise RecordingError(f"cannot read the table: {error}") from None
    values = {
        name: column.scale * np.frombuffer(cells) + column.constant
        for (name, column), cells in zip(columns.items(), numbers, strict=True)
    }
    units = {name: column.unit for name, column in columns.items()}
    whole = LogRows(values.pop("time"), np.frombuffer(row_lines, np.int64), values, units, str(path))
    whole.problems += _unused_switches(header, columns)
    if run is None:
        if options.run:
            raise RecordingError("--run: the table has no column 'run'")
        return [whole]
    if len(runs[0]) > MAX_RUNS:
        raise RecordingError(f"column '{run.name}' has {len(runs[0])} runs; a table has at most {MAX_RUNS}")
    number_of = np.frombuffer(runs[1], np.int64)
    if options.run and options.run not in runs[0]:
        raise RecordingError(f"--run: the table has no run '{options.run}'. {suggest(options.run, [*runs[0]])}")
    parts: list[LogRows] = []
    for name, number in runs[0].items():
        if options.run not in ("", name):
            continue
        part = whole.chosen(number_of == number)
        part.source = f"{path}, run {name}"
        part.problems = [*whole.problems]
        parts.append(part)
    return parts


def _chained(first: str, lines: Iterator[str]) -> Iterator[str]:
    yield first
    yield from lines


def _cells(
    reader: Iterator[list[str]], columns: dict[str, TableColumn], run: TableColumn | None, width: int
) -> tuple[list[array[float]], tuple[dict[str, int], array[int]], array[int]]:
    """The cells of each column (NaN: empty), the runs and the run of each row, and the line of each row."""
    numbers = [array("d") for _ in columns]
    places = [(column.place, cells.append) for column, cells in zip(columns.values(), numbers, strict=True)]
    names, rows_of_runs, row_lines = dict[str, int](), array("q"), array("q")
    faults: list[str] = []
    time_index = columns["time"].place
    for row in reader:
        number: int = reader.line_num  # type: ignore[attr-defined]  # pyright: ignore
        if len(row_lines) >= MAX_ROWS or number > 2 * MAX_ROWS:
            raise RecordingError(f"the table has more than {MAX_ROWS:,} rows: cut the log into parts")
        if not row:
            continue
        if len(row) != width:
            faults.append(f"line {number} has {len(row)} cells, the header has {width}")
        elif not row[time_index].strip():
            faults.append(f"line {number} has no time")
        else:
            for index, append in places:
                try:
                    value = float(row[index]) if row[index] else math.nan
                except ValueError:
                    value = math.nan
                    if row[index].strip():
                        faults.append(f"line {number}: {_no_number(row[index])}")
                if not math.isfinite(value) and row[index].strip().lower().lstrip("+-") in ("nan", "inf", "infinity"):
                    faults.append(
                        f"line {number}: '{row[index]}' is not a finite number; leave the cell empty if there is no "
                        "value"
                    )
                append(value)
            row_lines.append(number)
            if run is not None:
                rows_of_runs.append(names.setdefault(row[run.place].strip(), len(names)))
        if len(faults) > MOST_FAULTS:
            break
    if faults:
        raise RecordingError("; ".join([*faults[:MOST_FAULTS], *(["..."] if faults[MOST_FAULTS:] else [])]))
    return numbers, (names, rows_of_runs), row_lines


def _no_number(cell: str) -> str:
    text = f"'{cell[:40]}' is no number"
    return f"{text}; write a decimal point, not a comma" if cell.count(",") == 1 else text


def _unused_switches(header: Sequence[str], columns: dict[str, TableColumn]) -> list[LogProblem]:
    """Columns that look like a switch of the motor and are not used."""
    if "safety" in columns:
        return []
    return [
        LogProblem(
            "column",
            1,
            0.0,
            f"column '{name}' is not used; if the motor is off where it is 0, add --columns 'safety={name}'",
        )
        for name in header
        if any(word in name.lower().replace(" ", "_") for word in SWITCHES)
    ]


def is_numeric(cells: Sequence[str]) -> bool:
    """Whether a row has numbers only, and so is no header."""
    try:
        [float(cell) for cell in cells]
    except ValueError:
        return False
    return True
