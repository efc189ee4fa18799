"""CSV files of centre lines and race lines, as in f1tenth_racetracks and for AutoDRIVE's scripts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.errors import SpecError
from autodrive.base.readable import readable

MAX_BYTES = 20 * 2**20
RACE_LINE = "s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"
X_NAMES, Y_NAMES = {"x", "x_m", "pos_x", "x [m]", "position_x"}, {"y", "y_m", "pos_y", "y [m]", "position_y"}


def read_centre_line(path: Path, width: float | None) -> Floats:
    """x, y, width to the right, width to the left [m], shape (n, 4). Raises `SpecError`.

    A file without widths, with x and y as its first columns or in columns of these names, needs `width` [m], from edge
    to edge.
    """
    names, rows = _read(path)
    if rows.shape[1] == 4:
        return rows
    x, y = _column(names, X_NAMES, 0), _column(names, Y_NAMES, 1)
    right, left = _column(names, {"w_tr_right_m"}, -1), _column(names, {"w_tr_left_m"}, -1)
    if right >= 0 and left >= 0:
        return rows[:, [x, y, right, left]]
    if width is None:
        raise SpecError(
            ["the file has no widths (columns w_tr_right_m and w_tr_left_m); give the width of the track with --width"],
            str(path),
        )
    return np.column_stack([rows[:, x], rows[:, y], np.full((len(rows), 2), width / 2.0)])


def read_race_line(path: Path) -> Floats:
    """s, x, y, psi, kappa, vx, ax, shape (n, 7). Raises `SpecError`."""
    _, rows = _read(path)
    if rows.shape[1] != 7:
        text = f"a race line has 7 columns ({RACE_LINE}), not {rows.shape[1]}"
        raise SpecError([text], str(path))
    return rows


def write_centre_line(path: Path, rows: Floats) -> None:
    """Write the CSV file of a centre line, as f1tenth_racetracks has it."""
    _write(path, "x_m, y_m, w_tr_right_m, w_tr_left_m", ", ", rows)


def write_race_line(path: Path, rows: Floats) -> None:
    """Write the CSV file of a race line, as f1tenth_racetracks has it."""
    _write(path, RACE_LINE, "; ", rows)


def _write(path: Path, names: str, separator: str, rows: Floats) -> None:
    lines = [f"# {names}", *(separator.join(map(repr, row)) for row in rows.tolist())]
    write_file(path, "\n".join(lines) + "\n")


def _read(path: Path) -> tuple[list[str], Floats]:
    """Names of the columns, from the last comment or a line of words, and the rows. Raises `SpecError`."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SpecError([f"a CSV file must have at most {MAX_BYTES // 2**20} MiB"], str(path))
        text = readable(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SpecError([f"cannot be read: {error.strerror or error}"], str(path)) from None
    except UnicodeDecodeError:
        raise SpecError(["is not text in UTF-8"], str(path)) from None
    names: list[str] = []
    rows: list[list[float]] = []
    errors: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        fields = [field.strip() for field in re.split(r"[;,\t]|\s+(?=[-+.\d])", line.strip().lstrip("#").strip())]
        if not any(fields):
            continue
        if line.lstrip().startswith("#"):
            names = [field.lower() for field in fields]
            continue
        try:
            row = [float(field) for field in fields if field]
        except ValueError:
            if not rows and not names:
                names = [field.lower() for field in fields]
                continue
            errors.append(f"line {number}: expected numbers, found '{line.strip()[:50]}'")
            continue
        if rows and len(row) != len(rows[0]):
            errors.append(f"line {number}: {len(row)} numbers; the first row has {len(rows[0])}")
        elif not np.isfinite(row).all():
            errors.append(f"line {number}: a value is not a finite number")
        else:
            rows.append(row)
    if not errors and (len(rows) < 4 or len(rows[0]) < 2):
        errors.append(f"a closed line needs at least 4 rows of 2 numbers; the file has {len(rows)} rows")
    if errors:
        more = [f"and {len(errors) - 20} more errors"] if len(errors) > 20 else []
        raise SpecError([*errors[:20], *more], str(path))
    return names, np.array(rows)


def _column(names: list[str], known: set[str], otherwise: int) -> int:
    return next((i for i, name in enumerate(names) if name in known), otherwise)
