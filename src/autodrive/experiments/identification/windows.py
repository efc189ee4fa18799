"""Simulates parts of a drive, all at once, with many candidates for the vehicle; each part starts as recorded."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.experiments.identification.drive import IdentificationError
from autodrive.experiments.identification.parameters import VehicleFile
from autodrive.recording.drives import Drive
from autodrive.scenario import ScenarioSpec, SensorSettings, VehiclePlacement
from autodrive.scenario.vehicles.spec import VehicleSpec
from autodrive.world.batch import BatchWorld

SMOOTHING = 0.15
"""The motion at the start of a window is that of lines through the rows within this time of it [s]."""
NAME = "V1"


@dataclass(frozen=True)
class Windows:
    """Parts of a drive. The arrays of samples have the shape (w, s): w windows, at most s rows of the drive in each."""

    starts: Floats
    """[s], shape (w,)."""
    ticks: int
    """Length of each window [ticks]."""
    motions: Floats
    """Forward and left speed, yaw rate, throttle, steering at the start; see `BatchWorld.reset`, shape (w, 5)."""
    poses: Floats
    """x, y [m] and heading [rad] at the start, shape (w, 3)."""
    commands: Floats
    """Throttle and steering in each tick, shape (ticks, w, 2)."""
    rows: Integers
    """Row of the drive of each sample."""
    is_used: NDArray[np.bool_]
    """Which samples there are; the others are fill."""
    places: Floats
    """Ticks since the start of the window at each sample."""


def windows_of(drive: Drive, length: float, warm_up: float) -> Windows:
    """Windows of `length` [s] that follow each other, each with a `warm_up` [s] before it whose rows do not count.

    Raises `IdentificationError` if none is left between the breaks of the drive.
    """
    length = min(length, drive.duration - warm_up)
    first, last = float(drive.time[0]), float(drive.time[-1])
    count = max(1, math.floor((last - first - warm_up) / length + 1e-9))
    wanted = np.linspace(first, last - warm_up - length, count) if count > 1 else np.array([first])
    starts = np.unique(drive.time[np.searchsorted(drive.time, wanted - 1e-9)])  # several may follow the same gap
    whole = warm_up + length
    starts = np.array([start for start in starts.tolist() if not _is_broken(drive, start - SMOOTHING, start + whole)])
    if len(starts) == 0:
        raise IdentificationError(
            f"the drive has no {whole:g} s without a collision, a reset, a jump or a gap; use shorter windows  "
            f"({drive.source})"
        )
    return _cut(drive, starts, whole, warm_up)


def whole_drive(drive: Drive) -> Windows:
    """The longest part of the drive without a break, as one window."""
    edges = np.concatenate((drive.time[:1], drive.breaks + 1e-6, drive.time[-1:]))
    longest = int(np.argmax(np.diff(edges)))
    rows = np.flatnonzero((drive.time >= edges[longest]) & (drive.time <= edges[longest + 1] - 2e-6))
    first, last = int(rows[0]), int(rows[-1])
    return _cut(drive, drive.time[first : first + 1], float(drive.time[last] - drive.time[first]), 0.0)


def _is_broken(drive: Drive, start: float, end: float) -> bool:
    return bool(((drive.breaks > start) & (drive.breaks <= end)).any())


def _cut(drive: Drive, starts: Floats, whole: float, warm_up: float) -> Windows:
    ticks = math.ceil(whole / drive.tick - 1e-6)
    chosen = [
        np.flatnonzero((drive.time >= start + warm_up - 1e-9) & (drive.time <= start + ticks * drive.tick + 1e-9))
        for start in starts.tolist()
    ]
    most = max(map(len, chosen))
    rows = np.array(
        [
            np.concatenate(
                (rows_of_window, np.full(most - len(rows_of_window), rows_of_window[-1] if len(rows_of_window) else 0))
            )
            for rows_of_window in chosen
        ]
    )
    is_used = np.arange(most) < np.array([[len(rows_of_window)] for rows_of_window in chosen])
    # the command in the middle of each tick
    middle = starts + (np.arange(ticks)[:, None] + 0.5) * drive.tick
    held = np.maximum(np.searchsorted(drive.command_time, middle, side="right") - 1, 0)
    commands = np.stack((drive.throttle[held], drive.steering[held]), axis=-1)
    x, y, heading, speed, rate = (_smooth(drive, column, starts) for column in _COLUMNS)
    left = np.cos(heading[0]) * y[1] - np.sin(heading[0]) * x[1]  # of a car that slides
    forward = np.copysign(np.sqrt(np.maximum(speed[0] ** 2 - left**2, 0.0)), speed[0])
    motions = np.column_stack((forward, left, rate[0], commands[0]))
    return Windows(
        starts=starts,
        ticks=ticks,
        motions=motions,
        poses=np.column_stack((x[0], y[0], heading[0])),
        commands=commands,
        rows=rows.astype(np.int64),
        is_used=is_used,
        places=np.clip((drive.time[rows] - starts[:, None]) / drive.tick, 0.0, ticks),
    )


_COLUMNS = ("x", "y", "heading", "speed", "yaw_rate")


def _smooth(drive: Drive, column: str, times: Floats) -> Floats:
    """Value and slope, at some times, of the line through the rows near each of them, shape (2, w)."""
    values: Floats = getattr(drive, column)
    if column == "heading":
        values = np.unwrap(values)
    smoothed = np.empty((2, len(times)))
    for i, time in enumerate(times.tolist()):
        near = np.flatnonzero(np.abs(drive.time - time) <= SMOOTHING + 1e-9)
        if len(near) < 2:
            middle = int(np.searchsorted(drive.time, time))
            near = np.arange(max(0, middle - 1), min(len(values), middle + 2))
        smoothed[1, i], smoothed[0, i] = np.polyfit(drive.time[near] - time, values[near], 1)
    return smoothed


@dataclass(frozen=True)
class SimulatedMotion:
    """The motion of c candidates at the samples of the windows: arrays of the shape (c, w, s)."""

    x: Floats
    y: Floats
    """[m]."""
    heading: Floats
    """[rad]."""
    speed: Floats
    """Magnitude [m/s]."""
    yaw_rate: Floats
    """[rad/s]."""


class Simulator:
    """Simulates windows for several candidates in one batch."""

    def __init__(
        self,
        drive: Drive,
        windows: Windows,
        file: VehicleFile,
        longest: Mapping[str, float],
        candidates: int,
        threads: int | None,
    ) -> None:
        """`longest`: greatest values of the dead times that are tried, by path. `candidates`: at once."""
        self.candidates = candidates
        self._drive = drive
        self._windows = windows
        largest = math.degrees(float(np.abs(drive.steering).max())) if drive.is_angle else 0.0
        self._limit_deg = max(file.spec.steering.limit_deg, 1.0001 * largest)
        suite = file.spec.sensors
        off = {name: SensorSettings(is_on=False) for name in ("lidar", "range") if getattr(suite, name) is not None}
        with tempfile.TemporaryDirectory(prefix="autodrive-") as folder:
            path = Path(folder) / "vehicle.yaml"
            path.write_text(file.text(longest), encoding="utf-8")
            placement = VehiclePlacement(type=str(path), grip_factor=drive.grip, sensors=off)
            spec = ScenarioSpec(map="plane", vehicles={NAME: placement}, tick=drive.tick, substep=drive.substep)
            self._batch = BatchWorld(spec, candidates * len(windows.starts), threads=threads)
        commands = windows.commands.copy()
        motions = windows.motions.copy()
        if drive.is_angle:
            commands[..., 1] /= math.radians(self._limit_deg)
            motions[:, 4] /= math.radians(self._limit_deg)
        motions[:, 3:] = np.clip(motions[:, 3:], -1.0, 1.0)
        self._commands = np.tile(commands, (1, candidates, 1))[:, :, None, :]
        self._motions = np.tile(motions, (candidates, 1))

    def run(self, specs: Sequence[VehicleSpec], poses: Floats | None = None) -> SimulatedMotion:
        """The motion of each candidate. `poses`: where the windows start, shape (w, 3); None: all at the origin."""
        parts = [self._run(specs[i : i + self.candidates], poses) for i in range(0, len(specs), self.candidates)]
        return SimulatedMotion(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in SimulatedMotion.__annotations__)
        )

    def close(self) -> None:
        """End the threads."""
        self._batch.close()

    def _run(self, specs: Sequence[VehicleSpec], poses: Floats | None) -> SimulatedMotion:
        batch, w = self._batch, len(self._windows.starts)
        driven = [self._driven(spec) for spec in specs]
        filled = [*driven, *driven[:1] * (self.candidates - len(specs))]
        start = np.zeros((batch.n, 3)) if poses is None else np.tile(poses, (self.candidates, 1))
        readings = batch.reset(
            poses={NAME: start},
            motions={NAME: self._motions},
            vehicles={NAME: [parameters for parameters in filled for _ in range(w)]},
        )
        ticks = np.empty((self._windows.ticks + 1, 5, batch.n))
        for tick in range(self._windows.ticks + 1):
            orientation, velocity = readings.orientation[:, 0], readings.velocity[:, 0]
            ticks[tick, :2] = readings.position[:, 0, :2].T
            ticks[tick, 2] = 2.0 * np.arctan2(orientation[:, 3], orientation[:, 0])
            ticks[tick, 3] = np.hypot(velocity[:, 0], velocity[:, 1])
            ticks[tick, 4] = readings.angular_velocity[:, 0, 2]
            if tick < self._windows.ticks:
                batch.step(self._commands[tick])
        ticks[:, 2] = np.unwrap(ticks[:, 2], axis=0)
        ticks[:, :, readings.is_unstable] = np.nan
        return self._sampled(ticks.reshape(self._windows.ticks + 1, 5, self.candidates, w), len(specs))

    def _sampled(self, ticks: Floats, count: int) -> SimulatedMotion:
        """Interpolate between ticks; `ticks` has the shape (ticks + 1, 5, c, w)."""
        before = np.minimum(self._windows.places.astype(np.int64), self._windows.ticks - 1)
        share = self._windows.places - before
        window = np.arange(before.shape[0])[:, None]
        # indices separated by slices: the shape is (w, s, 5, c)
        lower, upper = ticks[before, :, :, window], ticks[before + 1, :, :, window]
        values = lower + share[..., None, None] * (upper - lower)
        return SimulatedMotion(*np.moveaxis(values, (2, 3), (0, 1))[:, :count])

    def _driven(self, spec: VehicleSpec) -> VehicleSpec:
        """The vehicle as it obeys the recorded commands: a recorded angle of the steering is obeyed at once."""
        if not self._drive.is_angle:
            return spec
        steering = spec.steering.at_once(self._limit_deg)
        drivetrain = spec.drivetrain.model_copy(update={"dead_time": 0.0})
        return spec.model_copy(update={"steering": steering, "drivetrain": drivetrain})


def without_gyro_offset(drive: Drive) -> Drive:
    """The drive without the constant offset of its yaw rate: the mean difference from the change of the heading."""
    turned = np.diff(np.unwrap(drive.heading))
    steps = np.diff(drive.time)
    measured = 0.5 * (drive.yaw_rate[1:] + drive.yaw_rate[:-1]) * steps
    is_whole = ~np.array([_is_broken(drive, a, b) for a, b in zip(drive.time[:-1], drive.time[1:], strict=True)])
    offset = float((measured - turned)[is_whole].sum() / steps[is_whole].sum())
    return replace(drive, yaw_rate=drive.yaw_rate - offset)
