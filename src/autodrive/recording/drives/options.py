"""How a log is read: columns, units, topics, the measured point, offsets; and the units that columns may have."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from autodrive.base.suggest import suggest, suggesting
from autodrive.base.units import DEGREE
from autodrive.recording.errors import RecordingError

_TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE, "°": DEGREE}
_SPEEDS = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "mph": 0.44704}
_RATES = {"rad/s": 1.0, "deg/s": DEGREE, "°/s": DEGREE, "mrad/s": 1e-3}
_SHARES = {"": 1.0, "1": 1.0, "-": 1.0, "%": 0.01}

UNITS: dict[str, dict[str, float]] = {
    "time": {"": 1.0} | _TIMES,
    "x": {"": 1.0} | _LENGTHS,
    "y": {"": 1.0} | _LENGTHS,
    "yaw": {"": 1.0} | _ANGLES,
    **dict.fromkeys(("qw", "qx", "qy", "qz"), _SHARES),
    "speed": {"": 1.0} | _SPEEDS,
    "yaw_rate": {"": 1.0} | _RATES,
    "throttle": _SHARES | _SPEEDS,
    "steering": _SHARES | _ANGLES,
    "steering_angle": {"": 1.0} | _ANGLES,
    "safety": _SHARES,
    "command_time": {"": 1.0} | _TIMES,
    "run": {"": 1.0},
}
"""Quantity of a log -> unit that its column may have -> factor to the SI unit; '': no unit is given."""

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_FORMULA = re.compile(
    rf"(?P<minus>-?)\s*(?P<name>.+?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*(?:(?P<operator>[*/])\s*(?P<factor>{_NUMBER}))?"
    rf"\s*(?P<constant>[+-]\s*{_NUMBER})?\s*"
)
_HEADER = re.compile(r"(?P<name>.*?)\s*(?:\[(?P<unit>[^\]]*)\]|\((?P<round>[^)]*)\))")


@suggesting
@dataclass(frozen=True)
class LogOptions:
    """How a log is read."""

    name: str = ""
    """Vehicle of a recording; empty: the first one."""
    run: str = ""
    """Run of a table that is read; empty: all runs."""
    is_left_positive: bool = True
    """Whether a positive steering of the log points to the left."""
    columns: str = ""
    """Columns of a table, such as 'time=t,yaw=psi [deg],throttle=u*0.01-0.2'."""
    topics: str = ""
    """Topics of a bag, such as 'pose=/odom,steering=/drive'."""
    tracked_point: tuple[float, float] = (0.0, 0.0)
    """Point whose position the log has, forward and left of the centre of the rear axle [m]."""
    heading_offset: float = 0.0
    """Angle from the yaw of the log to the heading of the car [rad]."""
    clock_offset: float = 0.0
    """Time that is added to the times of the commands [s]."""
    half_width: float | None = None
    """Half width of the parabola that gives speed and yaw rate from poses [s]; None: by the rate of the poses."""


class TableColumn(NamedTuple):
    """A column of a table: `scale` * cell + `constant` is the value in SI units."""

    place: int
    """Number of the column, from 0."""
    name: str
    scale: float
    constant: float
    unit: str
    """Unit of the cells; '': no unit is given."""


def pairs(text: str, option: str, known: Sequence[str], example: str) -> dict[str, str]:
    """The pairs of an option such as 'a=b,c=d'. Raises `RecordingError`."""
    result: dict[str, str] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, sign, value = (part.strip() for part in part.partition("="))
        if not sign or not value:
            raise RecordingError(f"{option}: '{part[:80]}' must be such as {example}")
        if name not in known:
            raise RecordingError(f"{option}: '{name[:80]}' is not known. {suggest(name, [*known])}")
        if name in result:
            raise RecordingError(f"{option}: '{name}' is named twice")
        result[name] = value
    return result


def columns_of(header: Sequence[str], option: str) -> dict[str, TableColumn]:
    """The column of each quantity in a table with that header; `option`: see `LogOptions.columns`.

    A column that is called like a quantity needs no entry. Raises `RecordingError`.
    """
    wanted = pairs(option, "--columns", [*UNITS], "time=t or yaw=psi [deg]")
    columns: dict[str, TableColumn] = {}
    for quantity, units in UNITS.items():
        source = wanted.get(quantity)
        if source is None:
            matches = [i for i, cell in enumerate(header) if _plain(_split(cell, units)[0]) == quantity]
            if matches:
                columns[quantity] = _column(quantity, header, matches, "", units, 1.0, 0.0)
        else:
            columns[quantity] = mapped_column(quantity, source, header, units)
    return columns


def source_name(source: str) -> str:
    """The name in a source such as '-name [unit] * 2 + 1'."""
    match = _FORMULA.fullmatch(source)
    return match["name"] if match else source


def mapped_column(
    quantity: str, source: str, header: Sequence[str], units: dict[str, float], option: str = "--columns"
) -> TableColumn:
    """The column of a source such as '-name [unit] * 2 + 1'. Raises `RecordingError`."""
    matches = [i for i, cell in enumerate(header) if source in (cell, _split(cell, units)[0])]
    if matches:
        return _column(quantity, header, matches, "", units, 1.0, 0.0)
    match = _FORMULA.fullmatch(source)
    name = match["name"] if match else source
    matches = [i for i, cell in enumerate(header) if name in (cell, _split(cell, units)[0])]
    if match is None or not matches:
        raise RecordingError(f"{option}: the table has no column '{name[:80]}'. {suggest(name, [*header])}")
    factor = float(match["factor"] or 1.0)
    if match["operator"] == "/":
        if factor == 0.0:
            raise RecordingError(f"{option}: '{quantity}' is divided by 0")
        factor = 1.0 / factor
    scale = -factor if match["minus"] else factor
    constant = float((match["constant"] or "0").replace(" ", ""))
    return _column(quantity, header, matches, match["unit"] or "", units, scale, constant)


def _column(
    quantity: str,
    header: Sequence[str],
    matches: Sequence[int],
    unit: str,
    units: dict[str, float],
    scale: float,
    constant: float,
) -> TableColumn:
    """The column with `scale` and `constant` in its own unit, which the option or the header has."""
    if len(matches) > 1:
        raise RecordingError(f"the table has {len(matches)} columns '{header[matches[0]]}'; each needs its own name")
    name, own_unit = _split(header[matches[0]], units)
    unit = (unit or own_unit).strip()
    if unit not in units:
        known = ", ".join(filter(None, units))
        raise RecordingError(f"'{unit[:40]}' is no unit of '{quantity}' (column '{name}'). Known: {known}")
    factor = units[unit]
    if not math.isfinite(scale) or scale == 0.0 or not math.isfinite(constant):
        raise RecordingError(f"--columns: the scale of '{quantity}' must not be 0, and its numbers must be finite")
    return TableColumn(matches[0], name, scale * factor, constant * factor, unit)


def _split(cell: str, units: dict[str, float]) -> tuple[str, str]:
    """Name and unit of a cell of the header, such as 'yaw [deg]'; round brackets may be a part of the name."""
    match = _HEADER.fullmatch(cell.strip())
    if match is None:
        return cell.strip(), ""
    if match["unit"] is not None:
        return match["name"], match["unit"].strip()
    return (match["name"], match["round"].strip()) if match["round"].strip() in units else (cell.strip(), "")


def _plain(name: str) -> str:
    """A name without case, and with an underscore in place of blanks."""
    return re.sub(r"[\s_]+", "_", name.strip().lower())
