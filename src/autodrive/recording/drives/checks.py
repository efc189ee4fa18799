"""Finds what is wrong in a log: units, signs, commands that do not act. Fatal faults raise `RecordingError`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.units import DEGREE
from autodrive.recording.drives.drive import Drive, LogProblem
from autodrive.recording.drives.options import UNITS
from autodrive.recording.drives.rows import LogRows
from autodrive.recording.errors import RecordingError

COMMANDS = ("throttle", "steering", "steering_angle", "safety")
LEAST_ROWS = 20
"""Rows that show a unit or a sign, at least."""
LEAST_STEERING, LEAST_SHARE, LEAST_TURN, LEAST_SPEED = 0.03, 0.1, 0.1, 0.05
"""Least angle [rad] or share of the steering, yaw rate [rad/s] and speed [m/s] of rows that show the sign."""
MOST_OPPOSITE = 0.8
"""Share of these rows; if more of them turn to the other side, the sign of the steering is wrong."""
LARGEST_ANGLE = 1.3
"""Largest angle of a steering [rad]."""
LEAST_DEGREES = 1.5
"""Largest steering of a log in degrees at least [degrees]."""
FASTEST = 50.0
"""Speed that no small car has [m/s]."""
CLEAR_SPEED, CLEAR_TURN = 0.3, 0.2
"""Speed [m/s] and yaw rate [rad/s] from poses from which on they are compared with those of the log."""
ALIKE = 0.4
"""Speed and yaw rate of a log may differ from those of the poses by this share."""
NO_DIRECTION, DIRECTION = 0.5, 0.9
"""Length of the mean of unit vectors (0 to 1) with no and with a clear common direction. Mardia and Jupp, (2.2.3)."""
ASIDE = 20.0 * DEGREE
"""Angle between heading and course that is mentioned [rad]."""
AT_LIMIT, LEAST_VALUES = 0.05, 20
"""Share of the commands at the largest value that is mentioned, and different values of a command that has no steps."""
STANDING, STANDING_SPEED, STANDING_THROTTLE = 1.0, 0.05, 0.2
"""Time [s] for which a car stands, at most at this speed [m/s], with this share of its largest throttle."""


def check_quantities(log: LogRows) -> None:
    """Raises `RecordingError` if the log lacks a quantity that a drive needs, or has impossible values."""
    missing = [name for name in ("throttle",) if not log.has(name)]
    if not log.has("steering") and not log.has("steering_angle"):
        missing.append("steering")
    if not log.has("x") and not log.has("speed"):
        missing.append("x, y, yaw, or speed and yaw_rate")
    elif log.has("x"):
        missing += [name for name in ("y", "yaw") if not log.has(name)]
    elif not log.has("yaw_rate"):
        missing.append("yaw_rate (or x, y and yaw)")
    if missing:
        places = "--columns" if log.line_name == "line" else "--topics"
        raise RecordingError(f"the log has no {'; no '.join(missing)}: name the source with {places}")
    for name in ("y", "yaw") if log.has("x") else ():
        if (rows := np.flatnonzero(np.isfinite(log.values["x"]) != np.isfinite(log.values[name]))).size:
            raise RecordingError(f"{log.place(int(rows[0]))} has only one of x and {name}; a pose has x, y and yaw")
    faults = [fault for name in COMMANDS if log.has(name) for fault in _range(log, name)]
    if faults:
        raise RecordingError("; ".join(faults))


def is_share(log: LogRows, quantity: str) -> bool:
    """Whether a command is a share of the full throttle or steering, by its unit."""
    return log.units.get(quantity, "") in ("", "1", "-", "%")


def _range(log: LogRows, name: str) -> list[str]:
    """What is wrong with the largest value of a command."""
    values = np.abs(log.values[name])
    row = int(np.nanargmax(values))
    largest, unit = float(values[row]), log.units.get(name, "")
    if is_share(log, name) and name != "steering_angle":
        if largest <= 1.0 + 1e-9:
            return []
        units = ", ".join(unit for unit in UNITS[name] if unit not in ("", "1", "-"))
        return [
            f"the {name} of {log.place(row)} is {log.values[name][row]:g}, but a share of its range is in [-1, 1]: "
            f"give the unit, such as --columns '{name}=NAME [{'deg' if name == 'steering' else 'm/s'}]' ({units}), or "
            f"a scale, such as '{name}=NAME/{max(largest, 2.0):.3g}'"
        ]
    if name != "throttle" and largest > LARGEST_ANGLE:
        return [
            f"the {name} of {log.place(row)} is {largest:.4g} rad, which no car steers: is it in degrees? Give the "
            f"unit, such as --columns '{name}=NAME [deg]'"
        ]
    if unit in ("deg", "°") and 0.0 < largest < LEAST_DEGREES * DEGREE and _turns(log):
        return [
            f"the largest {name} is {largest / DEGREE:.3g} degrees ({log.place(row)}): is it in rad? Give the unit, "
            f"such as --columns '{name}=NAME [rad]'"
        ]
    return []


def _turns(log: LogRows) -> bool:
    """Whether the yaw changes by more than a drive straight on."""
    if not log.has("yaw"):
        return False
    yaw = log.values["yaw"]
    return bool(np.ptp(np.unwrap(yaw[np.isfinite(yaw)])) > 1.0)


def check_motion(drive: Drive, units: dict[str, str], derived: Floats) -> list[LogProblem]:
    """Compare heading, speed and yaw rate with the path; `derived`: speed, yaw rate, course of the poses, shape (3, n).

    Returns the problems that remain usable. Raises `RecordingError` for a wrong unit or sign.
    """
    speed, turn, course = derived
    is_moving = np.abs(speed) > CLEAR_SPEED
    if is_moving.sum() < LEAST_ROWS:
        return []
    if (fast := float(np.median(np.abs(speed[is_moving])))) > FASTEST:
        raise RecordingError(
            f"the car drives {fast:.4g} m/s: are x and y in mm or cm? Give the unit, such as --columns 'x=NAME [mm],"
            "y=NAME [mm]'"
        )
    problems = _compare_heading(drive, course[is_moving], is_moving)
    if not drive.is_differentiated:
        ratios = drive.speed[is_moving] / speed[is_moving]
        problems += _compare(drive, "speed", float(np.median(ratios)), {3.6: "km/h", 2.237: "mph", 100.0: "cm/s"})
    is_turning = np.abs(turn) > CLEAR_TURN
    if is_turning.sum() >= LEAST_ROWS:
        ratio = float(np.median(drive.yaw_rate[is_turning] / turn[is_turning]))
        if ratio < 1.0 - 2.0 * ALIKE and ratio < 0.0:
            raise RecordingError(
                "the yaw rate of the log has the other sign than the change of the yaw: left turns are positive; use "
                "--columns 'yaw_rate=-NAME'"
            )
        problems += _compare(drive, "yaw rate", ratio, {1.0 / DEGREE: "deg/s"})
    return problems


def _compare(drive: Drive, name: str, ratio: float, units: dict[float, str]) -> list[LogProblem]:
    for factor, unit in units.items():
        if abs(ratio / factor - 1.0) < 0.12:
            raise RecordingError(
                f"the {name} of the log is {ratio:.3g} times that of the poses: it is in {unit}; say so, such as "
                f"--columns '{name.replace(' ', '_')}=NAME [{unit}]'"
            )
    if abs(ratio - 1.0) <= ALIKE:
        return []
    text = f"the {name} of the log is {ratio:.3g} times that of the poses; check its unit, its scale and its sign"
    return [LogProblem(name, 0, float(drive.time[0]), text)]


def _compare_heading(drive: Drive, course: Floats, rows: NDArray[np.bool_]) -> list[LogProblem]:
    """Compare the heading with the direction of the path: in all rows they differ by nearly the same angle."""
    heading = drive.heading[rows]
    plain = heading - drive.heading_offset
    if _common(course - heading) < NO_DIRECTION and np.ptp(course) > 0.5:
        if _common(course + heading) > DIRECTION:
            raise RecordingError(
                "the yaw turns to the other side than the path: it must be counterclockwise, or x and y are exchanged; "
                "use --columns 'yaw=-NAME'"
            )
        if np.abs(plain).max() > 2.0 * np.pi and _common(course - plain * DEGREE) > DIRECTION:
            raise RecordingError("the yaw of the log is in degrees; say so, such as --columns 'yaw=NAME [deg]'")
        text = "the yaw does not follow the direction of the path; check x, y, yaw and their units"
        return [LogProblem("heading", 0, float(drive.time[0]), text)]
    aside = float(np.angle(np.exp(1j * (course - heading)).mean()))
    if abs(aside) < ASIDE:
        return []
    text = (
        f"the car drives {np.degrees(aside):.0f} degrees beside its yaw: if it does not slide or drive backward, "
        f"correct the yaw by --heading-offset {aside:.3f}"
    )
    return [LogProblem("heading", 0, float(drive.time[0]), text)]


def _common(angles: Floats) -> float:
    """Length of the mean of unit vectors at twice these angles, so that forward and backward count alike."""
    return float(np.abs(np.exp(2j * angles).mean()))


def check_steering(drive: Drive, other_side: str) -> None:
    """Raises `RecordingError` if the car turns to the other side than its steering."""
    held = np.maximum(np.searchsorted(drive.command_time, drive.time, side="right") - 1, 0)
    steering = drive.steering[held]
    least = LEAST_SHARE if drive.steering_unit == "share" else LEAST_STEERING
    raise_if_opposite(steering, drive.yaw_rate, drive.speed, least, other_side)


def raise_if_opposite(steering: Floats, yaw_rate: Floats, speed: Floats, least: float, other_side: str) -> None:
    """Raises `RecordingError` if a car turns to the other side than its steering in most rows, each of shape (n,)."""
    is_clear = (np.abs(steering) > least) & (np.abs(yaw_rate) > LEAST_TURN) & (np.abs(speed) > LEAST_SPEED)
    is_opposite = (steering * yaw_rate * speed < 0.0)[is_clear]
    if len(is_opposite) >= LEAST_ROWS and is_opposite.mean() > MOST_OPPOSITE:
        raise RecordingError(
            f"the car turns to the opposite side of its steering: a positive angle in this log points to the "
            f"{other_side}, use --steering {other_side}"
        )


def problems_of_commands(drive: Drive, line_name: str) -> list[LogProblem]:
    """Commands at their limit, and a car that stands although it is commanded to drive."""
    limits = [_limit(drive, name, line_name) for name in ("throttle", "steering")]
    return [*filter(None, limits), *_standing(drive, line_name)]


def _limit(drive: Drive, name: str, line_name: str) -> LogProblem | None:
    values: Floats = getattr(drive, name)
    if name == "steering" and drive.is_angle:
        return None
    unit: str = getattr(drive, f"{name}_unit")
    held = np.diff(np.append(drive.command_time, max(drive.time[-1], drive.command_time[-1])))
    largest = float(np.abs(values).max())
    at_limit = np.abs(values) >= largest * (1.0 - 1e-6)
    share = float(held[at_limit].sum() / max(held.sum(), 1e-9))
    is_limit = largest > 1.0 - 1e-6 if unit == "share" else len(np.unique(values)) > LEAST_VALUES
    if share < AT_LIMIT or not is_limit:
        return None
    first = int(np.argmax(at_limit))
    text = (
        f"the {name} is at its largest value {largest:g} for {100.0 * share:.0f} % of the time, first in "
        f"{line_name} {drive.command_lines[first]}: a command that is cut does not show what was wanted"
    )
    return LogProblem("limit", int(drive.command_lines[first]), float(drive.command_time[first]), text)


def _standing(drive: Drive, line_name: str) -> list[LogProblem]:
    held = np.maximum(np.searchsorted(drive.command_time, drive.time, side="right") - 1, 0)
    throttle = np.abs(drive.throttle[held])
    is_still = (np.abs(drive.speed) < STANDING_SPEED) & (throttle > STANDING_THROTTLE * throttle.max(initial=0.0))
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_still, [False])).astype(np.int8)))
    problems: list[LogProblem] = []
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if (duration := float(drive.time[end - 1] - drive.time[start])) > STANDING:
            text = (
                f"the car stands for {duration:.3g} s from {line_name} {drive.lines[start]} on although the throttle "
                f"is {throttle[start]:.3g}: too little, or a dead man's switch turns the motor off ('safety')"
            )
            problems.append(LogProblem("standing", int(drive.lines[start]), float(drive.time[start]), text))
    return problems


def with_problems(drive: Drive, problems: Sequence[LogProblem], note: str) -> Drive:
    """The drive with its problems."""
    return replace(drive, problems=tuple(problems), note=note)
