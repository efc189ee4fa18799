"""A recorded drive: commands and measured motion, from a log of AutoDRIVE's data recorder or from a recording."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import Collision, Hold, Place, Reset, Teleport
from autodrive.recording import Recording
from autodrive.recording import open as open_recording
from autodrive.recording.exports.recorder_layout import GAP_STEPS, LEAST_GAP, read
from autodrive.scenario.maps.map import load_map
from autodrive.world.observer import ResetTo, Restored, SetPoses

MIN_DURATION = 2.0
"""Shortest drive [s]."""
MIN_ROWS = 20
"""Fewest rows of a drive."""
LEAST_THROTTLE = 1e-3
"""A drive whose throttle is never greater has no commands."""
JUMP = 0.5
"""A row that is farther from the one before it than the speed explains, by this [m], is a jump, such as a reset."""


class IdentificationError(AutodriveError):
    """Parameters cannot be fitted: the drive, a parameter or a bound is wrong. The message has all faults."""


@dataclass(frozen=True)
class Drive:
    """What a car was commanded, and how it moved. Arrays have one row for each of n instants or m commands."""

    time: Floats
    """Rising [s], shape (n,)."""
    x: Floats
    """Centre of the rear axle [m], shape (n,)."""
    y: Floats
    """Position of the centre of the rear axle along y of the map [m], shape (n,)."""
    heading: Floats
    """[rad], shape (n,)."""
    speed: Floats
    """Speed of the centre of the rear axle [m/s], negative in reverse, shape (n,)."""
    yaw_rate: Floats
    """[rad/s], shape (n,)."""
    command_time: Floats
    """When each command began to hold [s], shape (m,)."""
    throttle: Floats
    """[-1, 1], shape (m,)."""
    steering: Floats
    """Share of the steering limit [-1, 1], or the angle that the steering had [rad]; left positive, shape (m,)."""
    is_angle: bool
    """Whether `steering` is the angle: then a drive does not show how the steering responds to a command."""
    breaks: Floats
    """Times of collisions, resets and jumps [s]; the simulation explains no motion across them."""
    tick: float = 0.01
    """Tick of the simulation [s]."""
    substep: float = 0.001
    """Substep of the simulation [s]."""
    grip: float = 1.0
    """Factor of the friction of the ground."""
    source: str = "the drive"
    """File that it comes from."""
    note: str = ""
    """What a user should know about it."""

    def __post_init__(self) -> None:
        """Raises `IdentificationError` if it cannot be used."""
        rows = len(self.time)
        columns = {"time": self.time, "x": self.x, "y": self.y, "heading": self.heading, "speed": self.speed}
        columns |= {"yaw rate": self.yaw_rate, "throttle": self.throttle, "steering": self.steering}
        problems = [f"the {name} of row {row} is not a finite number" for name, row in _not_finite(columns)]
        if rows < MIN_ROWS or self.time[-1] - self.time[0] < MIN_DURATION:
            length = float(self.time[-1] - self.time[0]) if rows else 0.0
            problems.append(
                f"the drive is too short: {rows} rows in {length:.2f} s; it must have {MIN_ROWS} rows and "
                f"{MIN_DURATION:g} s"
            )
        if not problems and not (np.abs(self.throttle) > LEAST_THROTTLE).any():
            problems.append("the drive has no commands: its throttle is always 0")
        if problems:
            raise IdentificationError(f"{'; '.join(problems)}  ({self.source})")

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.time[-1] - self.time[0])


def read_drive(path: str | Path, name: str = "", *, is_left_positive: bool = True) -> Drive:
    """Read a log of the data recorder (.csv) or a recording (.mcap).

    `name`: the vehicle of a recording; empty: the first one. `is_left_positive`: of the steering angle of a log. Raises
    `IdentificationError` and `RecordingError`.
    """
    path = Path(path)
    if path.suffix.lower() == ".mcap":
        with open_recording(path) as recording:
            return _of_recording(recording, name)
    return _of_log(path, is_left_positive)


def _of_log(path: Path, is_left_positive: bool) -> Drive:
    log = read(path, is_left_positive=is_left_positive)
    columns = {"throttle": log.throttle, "steering": log.steering, "speed": log.speed, "yaw": log.euler[:, 2]}
    columns |= {"x": log.position[:, 0], "y": log.position[:, 1], "yaw rate": log.angular_velocity[:, 2]}
    faults = [f"line {row}: the {name} is not a finite number" for name, row in _not_finite(columns)]
    if faults:
        raise IdentificationError(f"{'; '.join(faults)}  ({path})")
    rising = np.concatenate(([True], np.diff(log.time) > 0.0))  # several rows may have the same time stamp
    time, x, y = log.time[rising], *log.position[rising, :2].T
    heading = log.euler[rising, 2]
    forward = np.cos(heading) * np.gradient(x) + np.sin(heading) * np.gradient(y) if len(time) > 1 else x
    speed = np.copysign(log.speed[rising], np.where(log.speed[rising] < 0.0, -1.0, forward))  # most have no sign
    # the log has the feedback of throttle and steering: the value of a row was commanded from the row before it on
    return Drive(
        time=time,
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        yaw_rate=log.angular_velocity[rising, 2],
        command_time=time[:-1],
        throttle=log.throttle[rising][1:],
        steering=log.steering[rising][1:],
        is_angle=True,
        breaks=np.sort(np.concatenate((log.time[list(log.breaks)], _jumps(time, x, y, speed)))),
        source=str(path),
        note=log.note,
    )


def _of_recording(recording: Recording, name: str) -> Drive:
    names = recording.vehicles
    if name and name not in names:
        raise IdentificationError(
            f"vehicle '{name}' is not in the recording. {suggest(name, [*names])}  ({recording.path})"
        )
    name = name or names[0]
    with recording.scenario_spec() as scenario:
        tick, substep = scenario.tick, scenario.substep
        lasts = tick * scenario.command_ticks
        grip = load_map(scenario.map).ground.grip
    rows: list[tuple[float, ...]] = []
    breaks: list[float] = []
    for time, frame in recording.moments():
        car = frame.vehicles.get(name)
        breaks += [time for event in frame.events if isinstance(event, Collision) and event.vehicle == name]
        if car is None or (rows and time <= rows[-1][0]):
            continue
        is_new = min(car.ips.time, car.imu.time) > frame.time - 0.5 * tick
        x, y, _ = car.ips.position.tolist()
        speed = math.copysign(math.hypot(*car.velocity.tolist()), car.speed)
        rows.append((time, x, y, float(car.imu.euler[2]), speed, float(car.imu.angular_velocity[2]), is_new))
    columns = np.array(rows, np.float64).reshape(-1, 7).T
    if columns[6].any():  # sensors that are slower than the ticks repeat their readings
        columns = columns[:, columns[6] > 0.0]
    time, x, y, heading, speed, yaw_rate, _ = columns
    moved = Reset | Teleport | Place | Hold | SetPoses | ResetTo | Restored
    breaks += [at for at, record in recording.requests if isinstance(record.request, moved)]
    own_commands = [(at, record.commands[name]) for at, record in recording.commands if name in record.commands]
    commands: list[tuple[float, float, float]] = [(-math.inf, 0.0, 0.0)]
    for at, command in own_commands:
        if lasts + 0.5 * tick < at - commands[-1][0] < math.inf:
            commands.append((commands[-1][0] + lasts, 0.0, 0.0))
        commands.append((at, min(1.0, max(-1.0, command.throttle)), min(1.0, max(-1.0, command.steering))))
    if math.isfinite(commands[-1][0]):
        commands.append((commands[-1][0] + lasts, 0.0, 0.0))
    command_time, throttle, steering = np.array(commands).T
    return Drive(
        time=time,
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        yaw_rate=yaw_rate,
        command_time=command_time,
        throttle=throttle,
        steering=steering,
        is_angle=False,
        breaks=np.sort(np.concatenate((breaks, _jumps(time, x, y, speed)))),
        tick=tick,
        substep=substep,
        grip=grip,
        source=str(recording.path),
    )


def _not_finite(columns: Mapping[str, Floats]) -> list[tuple[str, int]]:
    """The columns that have a number that is not finite, and its first row, from 1."""
    wrong = {name: np.flatnonzero(~np.isfinite(column)) for name, column in columns.items()}
    return [(name, int(rows[0]) + 1) for name, rows in wrong.items() if len(rows)]


def _jumps(time: Floats, x: Floats, y: Floats, speed: Floats) -> Floats:
    """The times at which a car is somewhere else, or after a gap."""
    way = np.hypot(np.diff(x), np.diff(y))
    explained = np.maximum(np.abs(speed[1:]), np.abs(speed[:-1])) * np.diff(time)
    is_gap = np.diff(time) > max(LEAST_GAP, GAP_STEPS * float(np.median(np.diff(time)))) if len(time) > 1 else False
    return time[1:][(way > 2.0 * explained + JUMP) | is_gap]
