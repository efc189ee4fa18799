"""Compares a recorded drive with our simulation of its commands: a table of errors, and a plot.

The drive is a log of AutoDRIVE's data recorder (`compare_log`) or a recording of ours (`compare_recording`), which can
be simulated in another scenario or with another vehicle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
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
from autodrive.recording.exports.recorder_layout import DriveLog
from autodrive.recording.plot import check_suffix, write_panels
from autodrive.recording.resimulation import simulated_again
from autodrive.scenario import ScenarioSpec, VehiclePlacement, load_scenario
from autodrive.world.batch import BatchWorld

SIGNALS = ("x", "y", "heading", "speed", "yaw rate")
"""Signals of a drive [m, m, rad, m/s, rad/s]."""
PATH_HEIGHT = 420
"""Height of the panel with both paths [pixels]."""
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
            panels.append(panel(Curves(title, self.time, columns, names), above, self.time[0], self.time[-1]))
        write_panels(path, panels, PATH_HEIGHT + 3 * HEIGHT)


def compare_log(log: DriveLog, scenario: str | Path | ScenarioSpec | None = None, *, type_: str = "") -> Comparison:
    """Simulate the commands of a log from its first pose on, with the first vehicle of a scenario.

    The vehicle starts at rest; after a gap of the log it starts again as recorded. Without a scenario: on the plane, a
    Nigel or, for a log of 22 columns, a RoboRacer car. `type_`: name or file of another type of that vehicle. The log
    has the feedback of throttle and steering, not the commands: the value of a row is commanded from the row before it
    on. Positions are those of the vehicle's indoor positioning sensor.
    """
    if scenario is None:
        spec = ScenarioSpec(map="plane", vehicles={"V1": VehiclePlacement(type=log.vehicle_type)})
    else:
        spec = scenario if isinstance(scenario, ScenarioSpec) else load_scenario(scenario)
    name = next(iter(spec.vehicles))
    spec = with_type(spec, name, type_)
    without_own = {
        vehicle: placement.model_copy(update={"own_sensors": {}}) for vehicle, placement in spec.vehicles.items()
    }
    batch = BatchWorld(spec.model_copy(update={"vehicles": without_own}), threads=1)
    vehicle = batch.compiled.vehicles[name]
    steering, lever = vehicle.steering.commands(log.steering), vehicle.sensors.ips.mount.position
    rows: list[list[float]] = []
    with closing(batch):
        for first, end in itertools.pairwise((0, *log.breaks, len(log.time))):
            rows += _simulated_part(batch, log, range(first, end), steering, lever)
    recorded = [*log.position.T[:2], log.euler[:, 2], np.abs(log.speed), log.angular_velocity[:, 2]]
    return Comparison(log.time, dict(zip(SIGNALS, recorded, strict=True)), _signals(rows), log.breaks, log.note)


def _simulated_part(
    batch: BatchWorld, log: DriveLog, part: range, steering: Floats, lever: Vector
) -> list[list[float]]:
    """The signals of the first vehicle, simulated from the first of some rows on; `steering`: commands of all rows."""
    start, name = part[0], batch.vehicle_names[0]
    heading = float(log.euler[start, 2])
    x, y, _ = log.position[start] - np.array(rotate((math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)), lever))
    motion = [0.0] * 5
    if start:
        step = log.position[min(start + 1, part[-1])] - log.position[start]
        speed = math.copysign(log.speed[start], math.cos(heading) * step[0] + math.sin(heading) * step[1])
        obeyed = np.clip((log.throttle[start], steering[start]), -1.0, 1.0)
        motion = [speed, 0.0, log.angular_velocity[start, 2], *obeyed]
    readings = batch.reset(poses={name: (float(x), float(y), heading)}, motions={name: motion})
    commands = np.zeros((1, len(batch.commanded_names), 2))
    rows: list[list[float]] = []
    for i in part:
        commands[0, 0] = log.throttle[i], steering[i]
        while readings.time[0] < log.time[i] - log.time[start] - 0.5 * batch.tick_duration:
            batch.step(commands)
        r = readings
        rows.append(_row(r.position[0, 0], r.orientation[0, 0], r.velocity[0, 0], r.angular_velocity[0, 0], lever))
    return rows


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
