"""Reads the drives of a file, whatever its format."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.suggest import suggest
from autodrive.protocol.messages import Collision, Hold, Place, Reset, Teleport
from autodrive.recording.drives import recorder_log
from autodrive.recording.drives.assembly import drive_of
from autodrive.recording.drives.bag import is_bag, read_bag
from autodrive.recording.drives.drive import Drive
from autodrive.recording.drives.options import LogOptions
from autodrive.recording.drives.table import is_numeric, read_table
from autodrive.recording.drives.text_lines import naming, text_lines
from autodrive.recording.errors import RecordingError
from autodrive.recording.mcap.reader import Reader
from autodrive.recording.recording import Recording
from autodrive.scenario.maps.map import load_map
from autodrive.world.observer import ResetTo, Restored, SetPoses

JUMP = 0.5
"""A row that is farther from the one before it than the speed explains, by this [m], is a jump, such as a reset."""


def read_drives(path: str | Path, options: LogOptions | None = None) -> tuple[Drive, ...]:
    """Read the drives of a recording (.mcap), a log of the data recorder, a table with a header, or a ROS bag.

    Texts may be compressed by gzip. A table with a column 'run' has several drives. Raises `RecordingError` with the
    line that is wrong.
    """
    path, options = Path(path), options or LogOptions()
    if is_bag(path) or (path.suffix.lower() == ".mcap" and has_ros_messages(path)):
        return (drive_of(read_bag(path, options), options),)
    if options.topics:
        raise RecordingError(f"--topics is for bags of ROS  ({path})")
    if path.suffix.lower() == ".mcap":
        with Recording(path) as recording:
            return (_of_recording(recording, options.name),)
    if options.name:
        raise RecordingError(f"only a recording (.mcap) has names of vehicles  ({path})")
    if is_recorder_log(path):
        return (_of_recorder_log(path, options),)
    return tuple(drive_of(rows, options) for rows in read_table(path, options))


def has_ros_messages(path: Path) -> bool:
    """Whether an MCAP file has messages of ROS 2, and so is no recording. Raises `RecordingError`."""
    reader = Reader(path)
    try:
        return any(schema.encoding.startswith("ros2") for schema in reader.schemas.values())
    finally:
        reader.close()


def is_recorder_log(path: Path) -> bool:
    """Whether a text has no header, as a log of AutoDRIVE's data recorder. Raises `RecordingError`."""
    if is_bag(path) or path.suffix.lower() == ".mcap":
        return False
    with naming(path):
        cells = next(csv.reader([next(text_lines(path), "")]), [])
    return not cells or cells[0].count("_") >= 6 or is_numeric(cells)


def _of_recorder_log(path: Path, options: LogOptions) -> Drive:
    if options.columns:
        raise RecordingError(f"--columns is for tables with a header; this log has none  ({path})")
    log = recorder_log.read(path, is_left_positive=options.is_left_positive)
    columns = {"throttle": log.throttle, "steering": log.steering, "speed": log.speed, "yaw": log.euler[:, 2]}
    columns |= {"x": log.position[:, 0], "y": log.position[:, 1], "yaw rate": log.angular_velocity[:, 2]}
    wrong = {name: np.flatnonzero(~np.isfinite(column)) for name, column in columns.items()}
    faults = [f"line {rows[0] + 1}: the {name} is not a finite number" for name, rows in wrong.items() if len(rows)]
    if faults:
        raise RecordingError(f"{'; '.join(faults)}  ({path})")
    rising = np.concatenate(([True], np.diff(log.time) > 0.0))  # several rows may have the same time stamp
    time, x, y = log.time[rising], *log.position[rising, :2].T
    heading = log.euler[rising, 2]
    speed = log.signed_speed[rising]
    lines = np.flatnonzero(rising) + 1
    # the log has the feedback of throttle and steering: the value of a row was commanded from the row before it on
    return Drive(
        time=time,
        x=x,
        y=y,
        heading=heading,
        speed=speed,
        yaw_rate=log.angular_velocity[rising, 2],
        command_time=time[:-1] + options.clock_offset,
        throttle=log.throttle[rising][1:],
        steering=log.steering[rising][1:],
        is_angle=True,
        breaks=np.sort(np.concatenate((log.time[list(log.breaks)], _jumps(time, x, y, speed)))),
        source=str(path),
        note=log.note,
        steering_unit="rad",
        clock_offset=options.clock_offset,
        lines=lines,
        command_lines=lines[1:],
        problems=log.problems,
    )


def _of_recording(recording: Recording, name: str) -> Drive:
    names = recording.vehicles
    if name and name not in names:
        raise RecordingError(f"vehicle '{name}' is not in the recording. {suggest(name, [*names])}  ({recording.path})")
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


def _jumps(time: Floats, x: Floats, y: Floats, speed: Floats) -> Floats:
    """The times at which a car is somewhere else, or after a gap."""
    way = np.hypot(np.diff(x), np.diff(y))
    explained = np.maximum(np.abs(speed[1:]), np.abs(speed[:-1])) * np.diff(time)
    usual = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    is_gap = np.diff(time) > max(recorder_log.LEAST_GAP, recorder_log.GAP_STEPS * usual)
    return time[1:][(way > 2.0 * explained + JUMP) | is_gap]
