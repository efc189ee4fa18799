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
CENTRE_LINE = "x_m, y_m, w_tr_right_m, w_tr_left_m"
RACE_LINE = "s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"
CENTRE_COLUMNS: tuple[str, ...] = ("x", "y", "right", "left")
RACE_COLUMNS: tuple[str, ...] = ("s", "x", "y", "psi", "kappa", "vx", "ax")
NAMES: dict[str, tuple[str, ...]] = {
    "x": ("x", "x_ref", "pos_x", "position_x", "x_pos"),
    "y": ("y", "y_ref", "pos_y", "position_y", "y_pos"),
    "right": ("w_tr_right", "width_right", "right_width", "w_right", "right"),
    "left": ("w_tr_left", "width_left", "left_width", "w_left", "left"),
    "width": ("width", "track_width"),
    "s": ("s",),
    "psi": ("psi", "yaw", "heading", "theta"),
    "kappa": ("kappa", "curvature"),
    "vx": ("vx", "v", "speed", "velocity"),
    "ax": ("ax", "acceleration"),
}
"""What a column holds -> its possible names, without unit."""


def read_centre_line(path: Path, width: float | None, warnings: list[str]) -> Floats:
    """x, y, width to the right, width to the left [m], shape (n, 4); adds to the warnings. Raises `SpecError`.

    The columns are found by their names; without names they are x, y, right, left, or only x and y. `width` [m], from
    edge to edge, replaces the widths of the file, and is needed if it has none.
    """
    names, rows = _read(path, CENTRE_COLUMNS)
    if not names and rows.shape[1] not in (2, 4):
        text = f"the file has {rows.shape[1]} columns without names; expected x, y and the widths to the right and left"
        raise SpecError([f"{text}, or only x and y. Name them in the first line: {CENTRE_LINE}"], str(path))
    columns = _columns(names, path) if names else dict(zip(CENTRE_COLUMNS, range(rows.shape[1]), strict=False))
    _require(("x", "y"), columns, names, path)
    sides = [rows[:, columns[side]] for side in ("right", "left") if side in columns]
    if len(sides) != 2:
        sides = [rows[:, columns["width"]] / 2.0] * 2 if "width" in columns else []
    if width is None and not sides:
        known = ", ".join(names) or "x, y"
        text = f"the file has no widths (w_tr_right_m and w_tr_left_m, or width_m) in its columns {known}"
        raise SpecError([f"{text}; give the width of the track with --width"], str(path))
    if width is not None:
        if sides:
            warnings.append(f"the widths of the file are not used: --width makes the track {width:g} m wide")
        sides = [np.full(len(rows), width / 2.0)] * 2
    return np.column_stack([rows[:, columns["x"]], rows[:, columns["y"]], *sides])


def read_race_line(path: Path) -> Floats:
    """s, x, y, psi, kappa, vx, ax, shape (n, 7). Raises `SpecError`.

    The columns are found by their names; without names they are these.
    """
    names, rows = _read(path, RACE_COLUMNS)
    if not names and rows.shape[1] != len(RACE_COLUMNS):
        text = f"a race line has 7 columns ({RACE_LINE}), not {rows.shape[1]}"
        raise SpecError([text], str(path))
    columns = _columns(names, path) if names else {name: i for i, name in enumerate(RACE_COLUMNS)}
    _require(RACE_COLUMNS, columns, names, path)
    rows = rows[:, [columns[name] for name in RACE_COLUMNS]]
    if len(slow := np.flatnonzero(rows[:, 5] <= 0.0)):
        text = f"row {slow[0] + 1}: the speed vx of a race line must be above 0, not {rows[slow[0], 5]:g} m/s"
        raise SpecError([text], str(path))
    return rows


def write_centre_line(path: Path, rows: Floats) -> None:
    """Write the CSV file of a centre line, as f1tenth_racetracks has it."""
    _write(path, CENTRE_LINE, ", ", rows)


def write_race_line(path: Path, rows: Floats) -> None:
    """Write the CSV file of a race line, as f1tenth_racetracks has it: scripts skip its three lines of comments."""
    _write(path, f"race line of the AutoDRIVE Simulator\n# SI units, left is positive\n# {RACE_LINE}", "; ", rows)


def _write(path: Path, names: str, separator: str, rows: Floats) -> None:
    lines = [f"# {names}", *(separator.join(map(repr, row)) for row in rows.tolist())]
    write_file(path, "\n".join(lines) + "\n")


def _read(path: Path, usual: tuple[str, ...]) -> tuple[list[str], Floats]:
    """Names of the columns, empty if they are the usual ones without names, and the rows. Raises `SpecError`."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise SpecError([f"a CSV file must have at most {MAX_BYTES // 2**20} MiB"], str(path))
        text = readable(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SpecError([f"cannot be read: {error.strerror or error}"], str(path)) from None
    except UnicodeDecodeError:
        raise SpecError(["is not text in UTF-8"], str(path)) from None
    heads: list[str] = []
    rows: list[list[float]] = []
    errors: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        fields = [field.strip() for field in re.split(r" *[;,\t] *| +(?=[-+.\d])", line.strip().rstrip(";, "))]
        if not any(fields):
            continue
        if line.lstrip().startswith("#"):
            heads += [] if rows else [line.strip()]
            continue
        if _has_decimal_commas(line):
            errors.append(f"line {number}: '{line.strip()[:50]}' has decimal commas; write 1.5, not 1,5")
            continue
        try:
            row = list(map(float, fields))
        except ValueError:
            if not rows and not any(head[0] != "#" for head in heads):
                heads.append(line.strip())
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
    return _header(heads, len(rows[0]), usual, path), np.array(rows)


def _has_decimal_commas(line: str) -> bool:
    """Whether numbers such as 1,5 are separated by something else than a comma."""
    return bool(re.search(r"\d,\d", line) and re.search(r"[;\t]|\d\s+[-+.\d]", line))


def _header(lines: list[str], count: int, usual: tuple[str, ...], path: Path) -> list[str]:
    """The names of the columns in the lines before the numbers: comments, or one line of words.

    The last comment with as many names as there are columns counts, if one of them is known or they are separated as in
    a table; other comments are remarks. A header with another number of names raises `SpecError`, unless it is a
    comment with the first of the usual names.
    """
    for line in reversed(lines):
        is_comment = line.startswith("#")
        text = re.sub(r"[\[(](m|rad|1/m|rad/m|m/s|m/s\^?2)[])]", "", line.lstrip("#").strip())
        names = [name.strip().strip("\"'") for name in re.split(r"[;,\t]", text.rstrip(";,"))]
        is_table = len(names) > 1
        names = names if is_table else text.split()
        meanings = [_meaning(name) for name in names]
        if len(names) == count and (not is_comment or is_table or any(meanings)):
            return names
        is_table = is_table and len(set(meanings) - {""}) > 1 and tuple(meanings) != usual[: len(meanings)]
        if is_table or not is_comment:
            text = f"the header names {len(names)} columns ({line.lstrip('# ')[:80]}); the rows have {count}"
            raise SpecError([text], str(path))
    return []


def _meaning(name: str) -> str:
    """What a column of that name holds, see `NAMES`; '' if the name is not known."""
    plain = re.sub(r"_(m|rad|radpm|mps|mps2)$", "", re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_"))
    return next((meaning for meaning, names in NAMES.items() if plain in names), "")


def _columns(names: list[str], path: Path) -> dict[str, int]:
    """What is in which column, by the names. Raises `SpecError` if two columns hold the same."""
    columns: dict[str, int] = {}
    for number, name in enumerate(names):
        if (meaning := _meaning(name)) and meaning in columns:
            raise SpecError([f"two columns have the same meaning: {names[columns[meaning]]} and {name}"], str(path))
        columns |= {meaning: number} if meaning else {}
    return columns


def _require(meanings: tuple[str, ...], columns: dict[str, int], names: list[str], path: Path) -> None:
    """Raises `SpecError` if a column is missing."""
    if missing := [meaning for meaning in meanings if meaning not in columns]:
        known = "; ".join(f"{meaning}: {', '.join(NAMES[meaning])}" for meaning in missing)
        text = f"the header '{', '.join(names)[:80]}' has no column for {', '.join(missing)}. Names that are known"
        raise SpecError([f"{text}, with or without the unit: {known}"], str(path))
