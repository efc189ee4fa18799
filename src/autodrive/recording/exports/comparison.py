"""Compares a recorded drive with our simulation of its commands: a table of errors, and a plot.

The drive is a log of AutoDRIVE's data recorder (`compare_log`), any drive (`compare_drive`), or a recording of ours
(`compare_recording`), which can be simulated in another scenario or with another vehicle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.suggest import suggest
from autodrive.base.svg_plot import HEIGHT, LEFT, RIGHT, TOP, WIDTH, Curves, curve, legend, panel, text
from autodrive.base.transforms import Vector, euler_from_quaternion, rotate
from autodrive.base.units import DEGREE
from autodrive.recording import Recording, RecordingError
from autodrive.recording.drives import Drive, local_parabola
from autodrive.recording.drives.recorder_log import DriveLog
from autodrive.recording.plot import check_suffix, write_panels
from autodrive.recording.resimulation import simulated_again
from autodrive.scenario import ScenarioSpec, VehiclePlacement, load_scenario
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.batch import BatchWorld

SIGNALS = ("x", "y", "heading", "speed", "yaw rate")
"""Signals of a drive [m, m, rad, m/s, rad/s]."""
PATH_HEIGHT = 420
"""Height of the panel with both paths [pixels]."""
START = 0.25
"""Time after the start of a part within which its rows give the speed to the left [s]."""
MAX_POINTS = 2000
"""Points of a drawn path at most."""

Signals: TypeAlias = dict[str, NDArray[np.float64]]


class SignalDeviation(NamedTuple):
    """The error of a signal, in its unit."""

    rms: float
    """Root mean square."""
    largest: float
    """Largest magnitude."""


class Quantity(NamedTuple):
    """How an error is shown."""

    unit: str
    factor: float = 1.0
    """Factor from the unit of the values to the unit that is shown."""
    is_length: bool = False
    """Whether it is shown in % of the length of the drive, too."""


QUANTITIES = {
    "along": Quantity("m", is_length=True),
    "across": Quantity("m", is_length=True),
    "distance": Quantity("m", is_length=True),
    "heading": Quantity("deg", 1.0 / DEGREE),
    "speed": Quantity("m/s"),
    "yaw rate": Quantity("rad/s"),
}


@dataclass(frozen=True)
class Comparison:
    """A recorded drive and ours, at the times of the recorded one."""

    time: NDArray[np.float64]
    """[s], shape (n,)."""
    recorded: Signals
    """'x' and 'y' [m], 'heading' [rad], 'speed' [m/s] without its sign, 'yaw rate' [rad/s], each of shape (n,)."""
    simulated: Signals
    """Signals of the simulated drive, with the names, units and shapes of `recorded`."""
    breaks: tuple[int, ...] = ()
    """Rows, from 0, at which the simulation starts again as recorded."""
    note: str = ""
    """What a user should know about the drive."""
    marks: tuple[float, ...] = ()
    """Times of the problems of a log [s], which a plot marks."""

    @cached_property
    def length(self) -> float:
        """Length of the recorded path [m], without jumps such as a reset."""
        steps = np.hypot(np.diff(self.recorded["x"]), np.diff(self.recorded["y"]))
        steps[np.array(self.breaks, np.int64) - 1] = 0.0
        return float(steps[np.diff(self.time) > 0.0].sum())

    @cached_property
    def differences(self) -> Signals:
        """Simulated minus recorded value at each time, shape (n,), by name.

        'along' and 'across': the difference of the positions in the axes of the recorded vehicle, forward and to the
        left [m]; 'distance': its magnitude [m]; 'heading': -pi to pi [rad]; 'speed' [m/s]; 'yaw rate' [rad/s].
        """
        differences = {name: self.simulated[name] - self.recorded[name] for name in SIGNALS}
        dx, dy, heading = differences.pop("x"), differences.pop("y"), self.recorded["heading"]
        along = np.cos(heading) * dx + np.sin(heading) * dy
        across = np.cos(heading) * dy - np.sin(heading) * dx
        differences["heading"] = np.remainder(differences["heading"] + math.pi, 2.0 * math.pi) - math.pi
        return {"along": along, "across": across, "distance": np.hypot(dx, dy)} | differences

    @property
    def errors(self) -> dict[str, SignalDeviation]:
        """Root mean square and largest magnitude of each of the `differences`, in their units."""
        return {
            name: SignalDeviation(float(np.sqrt(np.mean(values**2))), float(np.max(np.abs(values))))
            for name, values in self.differences.items()
        }

    def table(self) -> str:
        """The errors as text; those of the position also in % of the length of the recorded path."""
        share = 100.0 / self.length if self.length > 0.0 else math.nan
        rows = [f"{'error':10}{'rms':>10}{'largest':>10}{'':7}{'% of the length: rms':>22}{'largest':>10}"]
        for name, (rms, largest) in self.errors.items():
            unit, factor, is_length = QUANTITIES[name]
            row = f"{name:10}{factor * rms:10.4f}{factor * largest:10.4f}  {unit:5}"
            rows.append(row + (f"{share * rms:22.2f}{share * largest:10.2f}" if is_length else ""))
        duration = float(self.time[-1] - self.time[0])
        return "\n".join(
            [
                f"{len(self.time)} rows, {duration:.2f} s, length {self.length:.3f} m",
                *map(str.rstrip, rows),
                *([f"note: {self.note}"] if self.note else []),
            ]
        )

    def plot(self, path: str | Path) -> None:
        """Draw both paths, and the errors of position, heading and speed over time, as PNG or SVG.

        Raises `RecordingError`.
        """
        path = Path(path)
        check_suffix(path)
        panels = [paths({"recorded": self.recorded, "simulated": self.simulated})]
        for i, names in enumerate((("along", "across"), ("heading",), ("speed",))):
            unit, factor, _ = QUANTITIES[names[0]]
            title = f"error of the {'position' if i == 0 else names[0]} [{unit}]"
            columns = [factor * self.differences[name] for name in names]
            above = PATH_HEIGHT + i * HEIGHT
            curves = Curves(title, self.time, columns, names, self.marks)
            panels.append(panel(curves, above, self.time[0], self.time[-1]))
        write_panels(path, panels, PATH_HEIGHT + 3 * HEIGHT)


def compare_log(log: DriveLog, scenario: str | Path | ScenarioSpec | None = None, *, type_: str = "") -> Comparison:
    """Simulate the commands of a log from its first pose on, with the first vehicle of a scenario.

    The vehicle starts at rest; after a gap of the log it starts again as recorded. Without a scenario: on the plane, a
    Nigel or, for a log of 22 columns, a RoboRacer car. `type_`: name or file of another type of that vehicle. The log
    has the feedback of throttle and steering, not the commands: the value of a row is commanded from the row before it
    on. Positions are those of the vehicle's indoor positioning sensor.
    """
    drive = Drive(
        time=log.time,
        x=log.position[:, 0],
        y=log.position[:, 1],
        heading=log.euler[:, 2],
        speed=log.signed_speed,
        yaw_rate=log.angular_velocity[:, 2],
        command_time=log.time[:-1],
        throttle=log.throttle[1:],
        steering=log.steering[1:],
        is_angle=True,
        breaks=np.empty(0),
        note=log.note,
        steering_unit="rad",
        problems=log.problems,
    )
    return _compare(drive, log.breaks, scenario, type_ if scenario else type_ or log.vehicle_type, is_positioning=True)


def compare_drive(drive: Drive, scenario: str | Path | ScenarioSpec | None = None, *, type_: str = "") -> Comparison:
    """Simulate the commands of a drive from its first row on, with the first vehicle of a scenario.

    The vehicle starts as recorded, and again after each of the breaks. Without a scenario: on the plane, the vehicle
    `type_`; otherwise the name or file of another type of that vehicle. Positions are those of the centre of the rear
    axle. Raises `RecordingError` without both.
    """
    if scenario is None and not type_:
        raise RecordingError(f"name the vehicle that is simulated: --type, or --scenario  ({drive.source})")
    part = np.searchsorted(drive.breaks, drive.time, side="right")
    return _compare(drive, (np.flatnonzero(np.diff(part)) + 1).tolist(), scenario, type_, is_positioning=False)


def _compare(
    drive: Drive,
    breaks: Sequence[int],
    scenario: str | Path | ScenarioSpec | None,
    type_: str,
    *,
    is_positioning: bool,
) -> Comparison:
    """`is_positioning`: the positions are those of the positioning sensor, and the vehicle is at rest at the start."""
    if scenario is None:
        spec = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type=type_)})
    else:
        spec = scenario if isinstance(scenario, ScenarioSpec) else load_scenario(scenario)
    name = next(iter(spec.vehicles))
    spec = with_type(spec, name, type_)
    without_own = {
        vehicle: placement.model_copy(update={"own_sensors": {}}) for vehicle, placement in spec.vehicles.items()
    }
    batch = BatchWorld(spec.model_copy(update={"vehicles": without_own}), threads=1)
    vehicle = batch.compiled.vehicles[name]
    drive = in_commands(drive, vehicle)
    lever = vehicle.sensors.ips.mount.position if is_positioning else (0.0, 0.0, 0.0)
    rows: list[list[float]] = []
    with closing(batch):
        for first, end in itertools.pairwise((0, *breaks, len(drive.time))):
            is_moving = first > 0 or not is_positioning
            rows += _simulated_part(batch, drive, range(first, end), lever, is_moving=is_moving)
    recorded = [drive.x, drive.y, drive.heading, np.abs(drive.speed), drive.yaw_rate]
    return Comparison(
        drive.time,
        dict(zip(SIGNALS, recorded, strict=True)),
        _signals(rows),
        tuple(breaks),
        drive.note,
        tuple(problem.time for problem in drive.problems if problem.line),
    )


def _simulated_part(
    batch: BatchWorld, drive: Drive, part: range, lever: Vector, *, is_moving: bool
) -> list[list[float]]:
    """The signals of the first vehicle, simulated from the first of some rows on."""
    start, name = part[0], batch.vehicle_names[0]
    time = drive.time[start : part[-1] + 1] - drive.time[start]
    x, y, heading = float(drive.x[start]), float(drive.y[start]), float(drive.heading[start])
    right, ahead, _ = rotate((math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)), lever)
    ticks = np.arange(math.ceil(float(time[-1]) / batch.tick_duration) + 1)
    middles = drive.time[start] + (ticks + 0.5) * batch.tick_duration
    held = np.clip(np.searchsorted(drive.command_time, middles, side="right") - 1, 0, len(drive.throttle) - 1)
    commands = np.zeros((1, len(batch.commanded_names), 2))
    motion = [0.0] * 5
    if is_moving:
        motion = start_motion(drive, part)
    readings = batch.reset(poses={name: (x - right, y - ahead, heading)}, motions={name: motion})
    rows: list[list[float]] = []
    tick = 0
    for moment in time.tolist():
        while readings.time[0] < moment - 0.5 * batch.tick_duration:
            commands[0, 0] = drive.throttle[held[tick]], drive.steering[held[tick]]
            batch.step(commands)
            tick += 1
        r = readings
        rows.append(_row(r.position[0, 0], r.orientation[0, 0], r.velocity[0, 0], r.angular_velocity[0, 0], lever))
    return rows


def in_commands(drive: Drive, vehicle: VehicleSpec) -> Drive:
    """The drive with the commands that the vehicle takes, in [-1, 1], also in place of a measured angle."""
    drive = drive.in_shares(vehicle.full_throttle_speed, vehicle.steering.limit)
    return replace(drive, steering=vehicle.steering.commands(drive.steering)) if drive.is_angle else drive


def start_motion(drive: Drive, part: range) -> list[float]:
    """Motion at the first of some rows: forward and left speed [m/s], yaw rate [rad/s], throttle, steering.

    The drive has the commands that the vehicle takes; see `in_commands`.
    """
    start = part[0]
    speed, left = float(drive.speed[start]), _left_speed(drive, part)
    forward = math.copysign(math.sqrt(max(speed**2 - left**2, 0.0)), speed)
    before = max(int(np.searchsorted(drive.command_time, drive.time[start])) - 1, 0)
    throttle, steering = (float(np.clip(column[before], -1.0, 1.0)) for column in (drive.throttle, drive.steering))
    return [forward, left, float(drive.yaw_rate[start]), throttle, steering]


def _left_speed(drive: Drive, part: range) -> float:
    """Speed to the left at the first of some rows [m/s]: that of a car that slides."""
    time = drive.time[part[0] : part[-1] + 1]
    near = slice(part[0], part[0] + int(np.searchsorted(time, time[0] + START)))
    _, slope = local_parabola(drive.time[near], np.column_stack((drive.x[near], drive.y[near])), np.empty(0), START)
    heading = float(drive.heading[part[0]])
    left = math.cos(heading) * slope[0, 1] - math.sin(heading) * slope[0, 0]
    return float(left) if abs(left) < abs(drive.speed[part[0]]) else 0.0


def compare_recording(
    recording: Recording,
    vehicle: str = "",
    scenario: str | Path | ScenarioSpec | None = None,
    *,
    type_: str = "",
) -> Comparison:
    """Simulate the commands and requests of a recording from its start on, and compare a vehicle, by default the first.

    In another scenario, which must have vehicles of the same names, or in that of the recording; `type_`: name or file
    of another type of that vehicle. Positions are those of the centre of the rear axle. Raises `RecordingError` if the
    recording does not begin at the start of a run.
    """
    names = recording.vehicles
    if vehicle and vehicle not in names:
        raise RecordingError(f"vehicle '{vehicle}' is not in the recording. {suggest(vehicle, [*names])}")
    name = vehicle or names[0]
    own_scenario = load_scenario(scenario) if isinstance(scenario, str | Path) else scenario
    if own_scenario is not None and name not in own_scenario.vehicles:
        raise RecordingError(f"the scenario has no vehicle '{name}'. {suggest(name, [*own_scenario.vehicles])}")

    def changed(spec: ScenarioSpec) -> ScenarioSpec:
        return with_type(own_scenario or spec, name, type_)

    times: list[float] = []
    rows: list[list[float]] = []
    ours: list[list[float]] = []
    with closing(simulated_again(recording, changed)) as pairs:
        for time, frame, simulated in pairs:
            if name in frame.vehicles and name in simulated.vehicles:
                times.append(time)
                for table, car in ((rows, frame.vehicles[name]), (ours, simulated.vehicles[name])):
                    table.append(_row(car.pose.position, car.pose.orientation, car.velocity, car.angular_velocity))
    return Comparison(np.array(times), _signals(rows), _signals(ours))


def with_type(spec: ScenarioSpec, vehicle: str, type_: str) -> ScenarioSpec:
    """A scenario in which a vehicle has another type; empty: that of the scenario."""
    if not type_ or vehicle not in spec.vehicles:
        return spec
    placement = spec.vehicles[vehicle].model_copy(update={"type": type_})
    return spec.model_copy(update={"vehicles": {**spec.vehicles, vehicle: placement}})


def _row(
    position: Floats, orientation: Floats, velocity: Floats, angular_velocity: Floats, lever: Vector = (0.0, 0.0, 0.0)
) -> list[float]:
    """The signals of a vehicle, see `VehicleFrame`, at a point in its axes [m]."""
    w, x, y, z = orientation.tolist()
    right, ahead, _ = position + np.array(rotate((w, x, y, z), lever))
    heading = euler_from_quaternion((w, x, y, z))[2]
    return [float(right), float(ahead), heading, abs(float(velocity[0])), float(angular_velocity[2])]


def _signals(rows: Sequence[Sequence[float]]) -> Signals:
    return dict(zip(SIGNALS, np.array(rows, np.float64).T, strict=True))


def paths(drives: Mapping[str, Signals]) -> str:
    """The SVG of the paths of drives, by name, with the same scale in both directions."""
    lines: list[NDArray[np.float64]] = []
    for drive in drives.values():
        chosen = np.unique(np.linspace(0, len(drive["x"]) - 1, MAX_POINTS).astype(int))
        lines.append(np.array([drive["x"][chosen], drive["y"][chosen]]))
    least, most = (least(np.concatenate(lines, axis=1), axis=1) for least in (np.min, np.max))
    middle, extent = 0.5 * (least + most), np.maximum(most - least, 1e-3)
    width, height = WIDTH - RIGHT - LEFT, PATH_HEIGHT - TOP - 34
    scale = 0.95 * min(width / extent[0], height / extent[1])
    parts = [text(LEFT, TOP - 8, "path [m]", more='font-weight="bold"')]
    parts.append(f'<rect x="{LEFT}" y="{TOP}" width="{width}" height="{height}" fill="none" stroke="#ddd"/>')
    for i, ((x, y), name) in enumerate(zip(lines, drives, strict=True)):
        across, down = LEFT + width / 2 + scale * (x - middle[0]), TOP + height / 2 - scale * (y - middle[1])
        parts += (curve(across, down, i), legend(name, TOP, i))
    bar = _round_length(0.2 * width / scale)
    start, under = LEFT, TOP + height + 14
    parts.append(
        f'<path d="M{start} {under - 5}V{under}H{start + scale * bar:.1f}V{under - 5}" fill="none" stroke="black"/>'
    )
    return "".join([*parts, text(start + scale * bar + 8, under + 2, f"{bar:g} m")])


def _round_length(length: float) -> float:
    """The largest of 1, 2, 5, 10 ... that is not longer."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= length * (1.0 + 1e-9))
