"""Makes a drive from the rows of a log: order, gaps, commands, the rear axle, speed and yaw rate."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.recording.drives import checks
from autodrive.recording.drives.differentiation import local_parabola, usual_half_width
from autodrive.recording.drives.drive import Drive, LogProblem
from autodrive.recording.drives.options import LogOptions
from autodrive.recording.drives.rows import LogRows
from autodrive.recording.drives.text_lines import naming
from autodrive.recording.errors import RecordingError

LEAST_GAP, GAP_STEPS = 0.2, 5.0
"""A gap between two rows is longer than this [s], and than so many usual steps."""
LEAST_SILENCE = 0.5
"""Commands that are sent again and again are missing for longer than this [s], and than `GAP_STEPS` usual steps."""
MOST_BACKWARD = 0.05
"""Share of the rows that may be earlier than those before them, each because the clock was set back."""
INTERLEAVED = 0.1
"""Rows of two sensors may be exchanged in time by this [s]."""
LONGEST_STEP = 2.0
"""Usual step of a log at most [s]; a log with a longer one has another unit of time."""
LEAST_ROWS = 3
"""Fewest rows with motion."""
JUMP, JUMP_STEPS, TURN_JUMP = 0.15, 3.0, 0.5
"""A pose has jumped if it is farther from the one before it than this [m], and so many usual steps near it; or is
turned by more than the last value [rad], and so many usual turns."""
NEAR_STEPS = 7
"""Steps near a row whose median is the usual one there."""
FROZEN, FROZEN_ROWS, FROZEN_STEP, FROZEN_SPEED = 0.3, 5, 0.05, 0.3
"""A pose is stuck if it is the same for this time [s] and number of rows, although the car is then farther away than
this [m], or was faster than this before and after it [m/s]."""
DENSE = 0.9
"""Share of the rows with a command, from which on commands are held and repeated in each row."""
REGULAR = 2.0
"""Commands are sent at a rate if the step that nine of ten do not exceed is at most so many usual steps."""
LEAST_LEFT_OUT = 1.0
"""Rows before the first command that a problem mentions [s]."""
SIGN_SPEED = 0.1
"""Least speed from poses that gives an unsigned speed its sign [m/s]."""

Flags = NDArray[np.bool_]


class _Commands(NamedTuple):
    """Commands of a log, each with its row and its time."""

    rows: Integers
    time: Floats
    throttle: Floats
    steering: Floats
    period: float
    """Usual step [s]; 0: not known."""


def drive_of(log: LogRows, options: LogOptions) -> Drive:
    """The drive in the rows of a log. Raises `RecordingError` if they have none, or if units or signs are wrong."""
    with naming(log.source):
        return _drive(log, options)


def _drive(log: LogRows, options: LogOptions) -> Drive:
    log = _with_yaw(log)
    checks.check_quantities(log)
    log, starts_part = _without_gaps(*_in_order(log))
    problems = log.problems
    has_pose = log.has("x")
    part = np.cumsum(starts_part, dtype=np.int64)
    commands = _commands(log, options)
    rows = np.flatnonzero(np.isfinite(log.values["x" if has_pose else "speed"]))
    if has_pose:
        rows, is_broken = _distinct_poses(log, rows, part)
    else:
        is_broken = np.zeros(len(rows), np.bool_)
    rows, is_broken = _with_commands(log, rows, is_broken, commands)
    if len(rows) < LEAST_ROWS:
        raise RecordingError(
            f"rows with {'a pose' if has_pose else 'a speed'} and a command: {len(rows)}; a drive has at least "
            f"{LEAST_ROWS}"
        )
    time = log.time[rows]
    is_broken[1:] |= np.diff(part[rows]) != 0
    is_broken[1:] |= np.diff(time) > _longest_step(time)
    is_broken[0] = False
    if has_pose:
        is_broken |= _jumps(log, rows, is_broken)
    breaks = time[is_broken]
    motion, derived = _motion(log, rows, breaks, options) if has_pose else (_integrated(log, rows), None)
    is_known = np.isfinite(motion).all(axis=0)
    if is_known.sum() < LEAST_ROWS:
        raise RecordingError("the log has no part without gaps that is long enough for speed and yaw rate")
    x, y, heading, speed, yaw_rate = motion[:, is_known]
    is_angle = not log.has("steering")
    drive = Drive(
        time=time[is_known],
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        yaw_rate=yaw_rate,
        command_time=commands.time,
        throttle=commands.throttle,
        steering=commands.steering if options.is_left_positive else -commands.steering,
        is_angle=is_angle,
        breaks=breaks,
        source=log.source,
        throttle_unit="share" if checks.is_share(log, "throttle") else "m/s",
        steering_unit="rad" if is_angle or not checks.is_share(log, "steering") else "share",
        command_period=commands.period,
        tracked_point=options.tracked_point,
        heading_offset=options.heading_offset,
        clock_offset=options.clock_offset,
        has_pose=has_pose,
        is_differentiated=not log.has("speed"),
        lines=log.lines[rows[is_known]],
        command_lines=log.lines[commands.rows],
    )
    if derived is not None:
        problems += checks.check_motion(drive, log.units, derived[:, is_known])
    checks.check_steering(drive, "right" if options.is_left_positive else "left")
    problems += checks.problems_of_commands(drive, log.line_name)
    problems.sort(key=lambda problem: problem.time)
    counts = Counter(problem.kind for problem in problems)
    note = f"problems of the log: {', '.join(f'{kind} ({count})' for kind, count in counts.items())}"
    return checks.with_problems(drive, problems, note if problems else "")


def _with_yaw(log: LogRows) -> LogRows:
    """The rows with the yaw in place of a quaternion."""
    if not log.has("yaw") and all(log.has(name) for name in ("qw", "qx", "qy", "qz")):
        w, x, y, z = (log.values.pop(name) for name in ("qw", "qx", "qy", "qz"))
        log.values["yaw"] = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        log.units["yaw"] = "rad"
    return log


def _in_order(log: LogRows) -> tuple[LogRows, Flags]:
    """The rows in order of time, and which rows follow a clock that was set back."""
    step = np.diff(log.time)
    restarts = np.zeros(len(log.time), np.bool_)
    if (step >= 0.0).all():
        return log, restarts
    is_back = False
    for name in ("x", "speed", "throttle", "steering", "steering_angle"):
        rows = np.flatnonzero(np.isfinite(log.values[name])) if name in log.values else np.empty(0, np.int64)
        backward = np.flatnonzero(np.diff(log.time[rows]) < 0.0)
        is_back |= len(backward) > 0
        if len(backward) > MOST_BACKWARD * len(rows):
            raise RecordingError(
                f"{log.place(int(rows[backward[0] + 1]))}: the time is earlier than the one before; sort the "
                f"{log.line_name}s by time"
            )
    if is_back:
        is_dense = "x" in log.values and bool(np.isfinite(log.values["x"]).mean() > DENSE)
        restarts[1:] = step < (0.0 if is_dense else -INTERLEAVED)
    order = np.lexsort((log.time, np.cumsum(restarts)))
    return log.chosen(order), restarts


def _without_gaps(log: LogRows, restarts: Flags) -> tuple[LogRows, Flags]:
    """The rows with times from 0 on and the usual step in place of each gap, and which rows follow a gap."""
    step = np.diff(log.time)
    forward = step[step > 0.0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    if usual > LONGEST_STEP:
        raise RecordingError(
            f"the usual step of the time is {usual:.6g} s: give the unit of the time, such as --columns 'time=NAME "
            "[ms]' (or us, ns)"
        )
    is_gap = restarts.copy()
    is_gap[1:] |= step > max(LEAST_GAP, GAP_STEPS * usual)
    time = np.concatenate(([0.0], np.cumsum(np.where(is_gap[1:], usual, step))))
    for row in np.flatnonzero(is_gap).tolist():
        length = f"{abs(step[row - 1]):.6g} s"
        if restarts[row]:
            kind, text = "clock", f"the clock is set back by {length} before {log.place(row)}"
        elif _goes_on(log, row):
            kind, text = "clock", f"the clock jumps by {length} before {log.place(row)}: the position goes on"
        else:
            kind, text = "gap", f"{length} without rows before {log.place(row)}"
        log.problems.append(LogProblem(kind, int(log.lines[row]), float(time[row]), text))
    log.time = time
    return log, is_gap


def _goes_on(log: LogRows, row: int) -> bool:
    """Whether a moving car is as far away after a gap of the time as after one usual step."""
    if not log.has("x"):
        return False
    near = np.arange(max(0, row - 40), min(len(log.time), row + 40))
    near = near[np.isfinite(log.values["x"][near])]
    after = int(np.searchsorted(near, row))
    if not 0 < after < len(near):
        return False
    way = np.hypot(np.diff(log.values["x"][near]), np.diff(log.values["y"][near]))
    others = np.delete(way, after - 1)
    usual = float(np.median(others)) if len(others) else 0.0
    return usual > 1e-3 and bool(way[after - 1] < JUMP_STEPS * usual)


def _commands(log: LogRows, options: LogOptions) -> _Commands:
    """The new commands; the switch of the motor multiplies the throttle, and a change of it is a new command."""
    angle = "steering" if log.has("steering") else "steering_angle"
    throttle, steering = _held(log.values["throttle"]), _held(log.values[angle])
    has_command = np.isfinite(log.values["throttle"]) | np.isfinite(log.values[angle])
    if log.has("safety"):
        safety = _held(log.values["safety"])
        safety[~np.isfinite(safety)] = 0.0  # before its first message the motor is off
        throttle = throttle * safety
        has_command |= np.concatenate(([False], np.diff(safety) != 0.0))
    rows = np.flatnonzero(has_command & np.isfinite(throttle) & np.isfinite(steering))
    if len(rows) == 0:
        raise RecordingError(f"no {log.line_name} has a throttle and a steering")
    is_changed = np.concatenate(([True], (np.diff(throttle[rows]) != 0.0) | (np.diff(steering[rows]) != 0.0)))
    time, period = log.time[rows], 0.0
    if log.has("command_time"):
        stamp = _held(log.values["command_time"])[rows]
        is_sent = np.concatenate(([True], np.diff(stamp) != 0.0))
        is_new, period = is_sent | is_changed, _usual_step(time[is_sent])
    elif len(rows) < DENSE * len(log.time):
        is_new, period = np.ones(len(rows), np.bool_), _usual_step(time)
    else:
        is_new = is_changed
    new = rows[is_new]
    return _Commands(new, log.time[new] + options.clock_offset, throttle[new], steering[new], period)


def _usual_step(time: Floats) -> float:
    return float(np.median(np.diff(time))) if len(time) > 1 else 0.0


def _held(values: Floats) -> Floats:
    """The values, each held until the next; NaN before the first."""
    latest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(latest >= 0, values[np.maximum(latest, 0)], np.nan)


def _longest_step(time: Floats) -> float:
    """A longer step is a gap [s]."""
    return max(LEAST_GAP, GAP_STEPS * _usual_step(time)) + 1e-9


def _distinct_poses(log: LogRows, rows: Integers, part: Integers) -> tuple[Integers, Flags]:
    """The rows that have a pose of their own, and which of them follow a pose that was stuck."""
    same_time = np.concatenate(([False], (np.diff(log.time[rows]) == 0.0) & (np.diff(part[rows]) == 0)))
    if same_time.any():
        first = int(rows[np.argmax(same_time)])
        text = (
            f"{int(same_time.sum())} poses have the time of the pose before, the first in {log.place(first)}; they are "
            "left out"
        )
        log.problems.append(LogProblem("duplicate", int(log.lines[first]), float(log.time[first]), text))
        rows = rows[~same_time]
    starts, lengths = _runs(log, rows)
    usual = round(float(np.median(lengths)))
    if usual > 1 and len(starts) > LEAST_ROWS:
        text = f"each pose is repeated in {usual} rows; the first of them is used"
        log.problems.append(LogProblem("repeated", int(log.lines[rows[0]]), float(log.time[rows[0]]), text))
        place = np.arange(len(rows)) - np.repeat(starts, lengths)
        rows = rows[place % usual == 0]
        starts, lengths = _runs(log, rows)
    return _without_frozen(log, rows, starts, lengths)


def _runs(log: LogRows, rows: Integers) -> tuple[Integers, Integers]:
    """Place and length of each run of rows with the same pose."""
    poses = np.array([log.values[name][rows] for name in ("x", "y", "yaw")])
    starts = np.flatnonzero(np.concatenate(([True], (np.diff(poses) != 0.0).any(axis=0))))
    return starts, np.diff(np.append(starts, len(rows)))


def _without_frozen(log: LogRows, rows: Integers, starts: Integers, lengths: Integers) -> tuple[Integers, Flags]:
    time, x, y = log.time[rows], log.values["x"][rows], log.values["y"][rows]
    is_used, is_broken = np.ones(len(rows), np.bool_), np.zeros(len(rows), np.bool_)
    for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
        last, after = start + length - 1, start + length
        if length < FROZEN_ROWS or time[last] - time[start] < FROZEN or start == 0 or after == len(rows):
            continue
        steps = [(start - 1, start), (last, after)]
        ways = [float(np.hypot(x[b] - x[a], y[b] - y[a])) for a, b in steps]
        is_fast = [way > FROZEN_SPEED * (time[b] - time[a]) for way, (a, b) in zip(ways, steps, strict=True)]
        if ways[1] > FROZEN_STEP or all(is_fast):
            is_used[start + 1 : after] = False
            is_broken[after] = True
            text = (
                f"the pose is stuck from {log.place(int(rows[start]))} to {log.lines[rows[last]]} "
                f"({time[last] - time[start]:.3g} s), and then {ways[1]:.3g} m away; these rows are left out"
            )
            log.problems.append(LogProblem("frozen", int(log.lines[rows[start]]), float(time[start]), text))
    return rows[is_used], is_broken[is_used]


def _with_commands(log: LogRows, rows: Integers, is_broken: Flags, commands: _Commands) -> tuple[Integers, Flags]:
    """The rows at whose time a command is known; a row after others that are left out follows a break."""
    time = log.time[rows]
    is_used = time >= commands.time[0] - 1e-9
    if not is_used.all() and (early := commands.time[0] - time[0]) > LEAST_LEFT_OUT:
        text = f"{early:.3g} s before the first command, in {log.place(int(commands.rows[0]))}, are left out"
        log.problems.append(LogProblem("no command", int(log.lines[rows[0]]), float(time[0]), text))
    steps = np.diff(commands.time)
    silence = max(LEAST_SILENCE, GAP_STEPS * commands.period)
    if commands.period > 0.0 and np.quantile(steps, 0.9) <= REGULAR * commands.period + 1e-9:
        for i in np.flatnonzero(steps > silence).tolist():
            is_used &= (time <= commands.time[i] + silence) | (time >= commands.time[i + 1] - 1e-9)
            text = (
                f"{steps[i]:.3g} s without a new command after {log.place(int(commands.rows[i]))}; the rows in it are "
                "left out"
            )
            line = int(log.lines[commands.rows[i]])
            log.problems.append(LogProblem("no command", line, float(commands.time[i]), text))
    follows = np.concatenate(([False], ~is_used[:-1])) if len(is_used) else is_used
    return rows[is_used], (is_broken | follows)[is_used]


def _jumps(log: LogRows, rows: Integers, is_broken: Flags) -> Flags:
    """The rows whose pose is not explained by the motion near them."""
    x, y, yaw = (log.values[name][rows] for name in ("x", "y", "yaw"))
    step = np.diff(log.time[rows])
    way = np.hypot(np.diff(x), np.diff(y))
    turn = np.abs(np.remainder(np.diff(yaw) + np.pi, 2.0 * np.pi) - np.pi)
    has_jumped = (way > JUMP + JUMP_STEPS * step * _near_median(way / step)) | (
        turn > TURN_JUMP + JUMP_STEPS * step * _near_median(turn / step)
    )
    has_jumped &= ~is_broken[1:]
    for i in np.flatnonzero(has_jumped).tolist():
        row = int(rows[i + 1])
        text = f"the pose jumps by {way[i]:.3g} m and {np.degrees(turn[i]):.3g} degrees before {log.place(row)}"
        log.problems.append(LogProblem("jump", int(log.lines[row]), float(log.time[row]), text))
    return np.concatenate(([False], has_jumped))


def _near_median(values: Floats) -> Floats:
    """The median of the values near each."""
    margin = NEAR_STEPS // 2
    return np.median(sliding_window_view(np.pad(values, margin, mode="edge"), NEAR_STEPS), axis=1)


def _motion(log: LogRows, rows: Integers, breaks: Floats, options: LogOptions) -> tuple[Floats, Floats]:
    """x, y, heading, speed, yaw rate of the rear axle, shape (5, n); and speed, yaw rate, course from the poses."""
    time = log.time[rows]
    heading = np.unwrap(log.values["yaw"][rows]) + options.heading_offset
    forward, left = options.tracked_point
    x = log.values["x"][rows] - forward * np.cos(heading) + left * np.sin(heading)
    y = log.values["y"][rows] - forward * np.sin(heading) - left * np.cos(heading)
    half_width = options.half_width or usual_half_width(time)
    _, slope = local_parabola(time, np.column_stack((x, y, heading)), breaks, half_width)
    way_x, way_y, turn = slope.T
    ahead = np.cos(heading) * way_x + np.sin(heading) * way_y
    derived = np.array([np.copysign(np.hypot(way_x, way_y), ahead), turn, np.arctan2(way_y, way_x)])
    speed = derived[0]
    if log.has("speed"):
        speed = _interpolated(log, "speed", time)
        if (speed[np.isfinite(speed)] >= 0.0).all():  # an encoder without a sign
            speed = np.copysign(speed, np.where(np.abs(ahead) > SIGN_SPEED, ahead, 1.0))
    yaw_rate = _interpolated(log, "yaw_rate", time) if log.has("yaw_rate") else turn
    return np.array([x, y, heading, speed, yaw_rate]), derived


def _integrated(log: LogRows, rows: Integers) -> Floats:
    """x, y, heading, speed, yaw rate of a log without poses, shape (5, n): the path is the sum of the steps."""
    time, speed = log.time[rows], log.values["speed"][rows]
    yaw_rate = _interpolated(log, "yaw_rate", time)
    heading = _sum(yaw_rate, time)
    return np.array(
        [_sum(speed * np.cos(heading), time), _sum(speed * np.sin(heading), time), heading, speed, yaw_rate]
    )


def _sum(rates: Floats, time: Floats) -> Floats:
    """The integral by the trapezoidal rule, from 0 on; where a rate is not known, it is 0."""
    known = np.nan_to_num(rates)
    return np.concatenate(([0.0], np.cumsum(0.5 * (known[1:] + known[:-1]) * np.diff(time))))


def _interpolated(log: LogRows, quantity: str, time: Floats) -> Floats:
    """A quantity at some times; NaN where its rows are too far away."""
    rows = np.flatnonzero(np.isfinite(log.values[quantity]))
    own = log.time[rows]
    after = np.clip(np.searchsorted(own, time), 0, len(own) - 1)
    distance = np.minimum(np.abs(own[after] - time), np.abs(own[np.maximum(after - 1, 0)] - time))
    values = np.interp(time, own, log.values[quantity][rows])
    return np.where(distance <= _longest_step(own), values, np.nan)
