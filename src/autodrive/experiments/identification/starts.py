"""Starts in recorded drives, from which vehicles are simulated with the recorded commands, all in one batch."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.experiments.identification.drive import Drive, IdentificationError
from autodrive.experiments.identification.parameters import VehicleFile
from autodrive.recording.drives import local_parabola
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.batch import BatchWorld

PAST = 0.6
"""Time before a start whose commands fill dead times, servo and drive of the simulated vehicle [s]."""
CLEAR = 0.15
"""Time before a start in which the drive has no break [s]: the motion at the start is a parabola around it."""
LEAST_SPEED = 0.2
"""A start shows nothing if the car is slower than this [m/s], or has no throttle, in the whole window."""
ROWS = 4096
"""Worlds of a batch at most, so that its memory stays below 1 GB."""
NAME = "V1"
SIGNALS = ("along", "across", "heading", "speed")
"""What is predicted: position along and across the heading of the start [m], heading [rad], speed [m/s]."""


@dataclass(frozen=True)
class Starts:
    """Instants of drives from which a simulation starts in the measured motion. w starts, T ticks, s instants."""

    drives: tuple[Drive, ...]
    """The drives, with commands in shares of their full scale."""
    drive: Integers
    """Number of the drive of each start, shape (w,)."""
    time: Floats
    """[s] in that drive, shape (w,)."""
    pose: Floats
    """x, y [m] and heading [rad] of the rear axle in the drive, shape (w, 3)."""
    motion: Floats
    """Forward and left speed of the centre of the rear axle [m/s], yaw rate [rad/s], shape (w, 3)."""
    instants: Floats
    """Times after the start at which prediction and drive are compared [s], shape (s,)."""
    measured: Floats
    """`SIGNALS` at the instants: position in the axes of the start, change of the heading, speed, shape (w, s, 4)."""
    turning: Floats
    """Greatest lateral acceleration, speed times yaw rate, up to the last instant [m/s^2], shape (w,)."""
    fastest: Floats
    """Greatest speed up to the last instant [m/s], shape (w,)."""

    @property
    def tick(self) -> float:
        """Tick of the simulation [s]."""
        return self.drives[0].tick

    @property
    def ticks(self) -> int:
        """Ticks from a start to its last instant."""
        return math.ceil(float(self.instants[-1]) / self.tick - 1e-6)

    def chosen(self, is_chosen: NDArray[np.bool_] | Integers) -> Starts:
        """Some of the starts, by a mask or by numbers."""
        columns = ("drive", "time", "pose", "motion", "measured", "turning", "fastest")
        picked = {name: getattr(self, name)[np.asarray(is_chosen)] for name in columns}
        return Starts(drives=self.drives, instants=self.instants, **picked)

    def commands(self, first: float, ticks: int, shifts: Floats | None = None) -> Floats:
        """Throttle and steering of `ticks` ticks from `first` [s] after each start on, shape (w, ticks, 2).

        `shifts`: by how much the commands of each drive are given later than they were recorded [s], shape (d,).
        """
        # the command in the middle of each tick
        middle = self.time[:, None] + first + (np.arange(ticks) + 0.5) * self.tick
        values = np.empty((len(self.time), ticks, 2))
        for i, drive in enumerate(self.drives):
            rows = self.drive == i
            late = 0.0 if shifts is None else float(shifts[i])
            held = _held(drive, middle[rows] - late)
            values[rows] = np.stack((drive.throttle[held], drive.steering[held]), axis=-1)
        return np.clip(values, -1.0, 1.0)


def starts_of(drives: Sequence[Drive], vehicle: VehicleSpec, instants: Sequence[float], every: float) -> Starts:
    """Starts each `every` [s] in the drives, in which they have no break until the last of the `instants` [s].

    Commands in m/s and rad become shares of the full scale of the `vehicle`. Raises `IdentificationError` if no start
    is left, or if the drives have different ticks.
    """
    if len({(drive.tick, drive.substep) for drive in drives}) > 1:
        raise IdentificationError("the drives have different ticks: fit recordings of one scenario, or logs, together")
    if unusable := [drive.source for drive in drives if drive.is_angle]:
        raise IdentificationError(
            f"{', '.join(unusable)}: the log has the measured angle of the steering, not its commands; prediction from "
            "commands needs commands"
        )
    full = vehicle.drivetrain.speed_limit * vehicle.wheels.radius, vehicle.steering.limit
    shares = tuple(drive.in_shares(*full) for drive in drives)
    at = np.asarray(instants, np.float64)
    parts = [_starts_of_drive(drive, i, at, every) for i, drive in enumerate(shares)]
    joined = [np.concatenate(columns) for columns in zip(*parts, strict=True)]
    if len(joined[0]) == 0:
        raise IdentificationError(
            f"no drive has {at[-1] + CLEAR:g} s without a gap, a jump or a collision in which the car moves; use "
            "shorter times"
        )
    number, time, pose, motion, measured, turning, fastest = joined
    return Starts(shares, number.astype(np.int64), time, pose, motion, at, measured, turning, fastest)


def _starts_of_drive(drive: Drive, number: int, instants: Floats, every: float) -> tuple[Floats, ...]:
    """Number of the drive, time, pose, motion, measured signals, turning, fastest: of each start."""
    time, length = drive.time, float(instants[-1])
    step = float(np.median(np.diff(time)))
    half = max(0.1, 2.5 * step)
    columns = (drive.x, drive.y, np.unwrap(drive.heading))
    smooth = [local_parabola(time, column, drive.breaks, half) for column in columns]
    starts: list[int] = []
    wanted = float(time[0]) + CLEAR
    while wanted + length <= float(time[-1]):
        row = int(np.searchsorted(time, wanted - 1e-9))
        start = float(time[row])
        if start + length > float(time[-1]):
            break
        broken = drive.breaks[(drive.breaks > start - CLEAR) & (drive.breaks <= start + length + step)]
        if len(broken):
            wanted = float(broken[-1]) + CLEAR + 1e-6
            continue
        inside = slice(row, int(np.searchsorted(time, start + length)) + 1)
        commanded = drive.throttle[_held(drive, start) : _held(drive, start + length) + 1]
        if np.abs(drive.speed[inside]).max() > LEAST_SPEED and commanded.any():
            starts.append(row)
        wanted = start + every
    rows = np.array(starts, np.int64)
    at = time[rows][:, None] + instants
    heading = smooth[2][0][rows]
    cos, sin = np.cos(heading), np.sin(heading)
    (x, x_slope), (y, y_slope) = smooth[0], smooth[1]
    pose = np.column_stack((x[rows], y[rows], heading))
    motion = np.column_stack(
        (cos * x_slope[rows] + sin * y_slope[rows], cos * y_slope[rows] - sin * x_slope[rows], smooth[2][1][rows])
    )
    dx = _between(time, x, x_slope, at) - x[rows][:, None]
    dy = _between(time, y, y_slope, at) - y[rows][:, None]
    turned = _between(time, *smooth[2], at) - heading[:, None]
    along, across = cos[:, None] * dx + sin[:, None] * dy, cos[:, None] * dy - sin[:, None] * dx
    speed = np.interp(at, time, np.abs(drive.speed))
    measured = np.stack((along, across, turned, speed), axis=-1).reshape(len(rows), len(instants), 4)
    ends = np.searchsorted(time, time[rows] + length) + 1
    spans = [slice(row, end) for row, end in zip(rows.tolist(), ends.tolist(), strict=True)]
    lateral = np.abs(drive.speed * drive.yaw_rate)
    turning = np.array([np.percentile(lateral[span], 95) for span in spans])
    fastest = np.array([np.abs(drive.speed[span]).max() for span in spans])
    return np.full(len(rows), float(number)), time[rows], pose, motion, measured, turning, fastest


def _held(drive: Drive, time: Floats | float) -> Any:
    """Number of the command that holds at a time [s], or at each of an array."""
    return np.maximum(np.searchsorted(drive.command_time, time, side="right") - 1, 0)


def _between(time: Floats, values: Floats, slopes: Floats, at: Floats) -> Floats:
    """The cubic through values and slopes of the two rows around each instant (Hermite interpolation)."""
    row = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    step = time[row + 1] - time[row]
    t = (at - time[row]) / step
    rest = 1.0 - t
    ends = values[row] * (1.0 + 2.0 * t) * rest * rest + values[row + 1] * (1.0 + 2.0 * rest) * t * t
    return ends + step * t * rest * (slopes[row] * rest - slopes[row + 1] * t)


@dataclass(frozen=True)
class DriveValues:
    """Values of each of d drives that do not belong to the vehicle, each of shape (d,)."""

    trim: Floats
    """Added to the angle of the steered wheels [rad]."""
    drive: Floats
    """Factor of the force of the motor, such as that of the battery."""
    grip: Floats
    """Factor of the friction of the tyres on the surface of that drive."""
    delay: Floats
    """Time by which the commands are given later than recorded [s]."""

    @staticmethod
    def neutral(count: int) -> DriveValues:
        """No trim, the force and friction of the vehicle's file, and commands as recorded."""
        return DriveValues(np.zeros(count), np.ones(count), np.ones(count), np.zeros(count))


class Predictor:
    """Simulates vehicles from all starts, several candidates in one batch."""

    def __init__(
        self,
        starts: Starts,
        vehicle: VehicleFile | VehicleSpec,
        *,
        candidates: int = 1,
        threads: int | None = None,
    ) -> None:
        """`candidates`: so many are simulated at once. The longest dead times are 0.3 s, or those of the vehicle."""
        self.starts = starts
        spec = vehicle if isinstance(vehicle, VehicleSpec) else vehicle.spec
        dead = {part: max(0.3, getattr(spec, part).dead_time) for part in ("steering", "drivetrain")}
        slowest = spec.model_copy(
            update={part: getattr(spec, part).model_copy(update={"dead_time": dead[part]}) for part in dead}
        )
        off = {name: SensorSettings(is_on=False) for name in ("lidar", "range") if getattr(spec.sensors, name)}
        batches = math.ceil(candidates * len(starts.time) / ROWS)
        self._candidates = math.ceil(candidates / batches)
        with tempfile.TemporaryDirectory(prefix="autodrive-") as folder:
            path = Path(folder) / "vehicle.yaml"
            path.write_text(_yaml(slowest), encoding="utf-8")
            first = starts.drives[0]
            placement = VehiclePlacement(type=str(path), grip_factor=first.grip, sensors=off)
            scenario = ScenarioSpec(map="plane", vehicles={NAME: placement}, tick=first.tick, substep=first.substep)
            self._batch = BatchWorld(scenario, self._candidates * len(starts.time), threads=threads)

    def close(self) -> None:
        """End the threads."""
        self._batch.close()

    def predict(self, candidates: Sequence[tuple[VehicleSpec, DriveValues]]) -> Floats:
        """`SIGNALS` of each candidate at the instants of the starts, shape (c, w, s, 4); NaN where physics diverges."""
        size = self._candidates
        return np.concatenate([self._run(candidates[i : i + size]) for i in range(0, len(candidates), size)])

    def errors(self, candidates: Sequence[tuple[VehicleSpec, DriveValues]]) -> Floats:
        """Predicted minus measured `SIGNALS`, shape (c, w, s, 4)."""
        return self.predict(candidates) - self.starts.measured

    def _run(self, candidates: Sequence[tuple[VehicleSpec, DriveValues]]) -> Floats:
        starts, batch, w = self.starts, self._batch, len(self.starts.time)
        filled = [*candidates, *[candidates[0]] * (self._candidates - len(candidates))]
        sessions = [session for _, session in filled]
        past_ticks = round(PAST / starts.tick)
        cuts = [starts.commands(-PAST, past_ticks + starts.ticks, session.delay) for session in sessions]
        commands = np.concatenate(cuts)
        past, future = commands[:, :past_ticks], commands[:, past_ticks:]
        motions = np.column_stack((np.tile(starts.motion, (len(filled), 1)), past[:, 0]))
        of_starts = {
            name: np.concatenate([getattr(session, name)[starts.drive] for session in sessions])
            for name in ("trim", "drive", "grip")
        }
        readings = batch.reset(
            poses={NAME: np.zeros((batch.n, 3))},
            motions={NAME: motions},
            past_commands={NAME: past},
            vehicles={NAME: [spec for spec, _ in filled for _ in range(w)]},
            trim=of_starts["trim"],
            drive=of_starts["drive"],
            grip=of_starts["grip"],
        )
        at = np.rint(starts.instants / starts.tick).astype(int).tolist()
        predicted = np.empty((batch.n, len(at), 4))
        heading, reached = np.zeros(batch.n), 0
        for i, tick in enumerate(at):
            for now in range(reached, tick):
                batch.step(future[:, now, None])
                turned = 2.0 * np.arctan2(readings.orientation[:, 0, 3], readings.orientation[:, 0, 0])
                heading += np.remainder(turned - heading + math.pi, 2.0 * math.pi) - math.pi
            reached = tick
            velocity = readings.velocity[:, 0]
            predicted[:, i, :2] = readings.position[:, 0, :2]
            predicted[:, i, 2] = heading
            predicted[:, i, 3] = np.hypot(velocity[:, 0], velocity[:, 1])
        predicted[readings.is_unstable] = np.nan
        return predicted.reshape(self._candidates, w, len(at), 4)[: len(candidates)]


def _yaml(spec: VehicleSpec) -> str:
    import yaml  # noqa: PLC0415

    return yaml.safe_dump(spec.model_dump(mode="json", exclude_none=True), sort_keys=False)
