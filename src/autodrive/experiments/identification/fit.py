"""Fits parameters of a vehicle to a recorded drive."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.experiments.identification.drive import IdentificationError, check_drive, read_drive
from autodrive.experiments.identification.parameters import Free, VehicleFile
from autodrive.experiments.identification.result import Fitted, Identification
from autodrive.experiments.identification.search import Objective, refine, search, without_influence
from autodrive.experiments.identification.windows import (
    Simulator,
    Windows,
    whole_drive,
    windows_of,
    without_gyro_offset,
)
from autodrive.recording.drives import Drive
from autodrive.recording.exports.comparison import Comparison

DEAD_TIMES = ("steering.dead_time", "drivetrain.dead_time")
HIDDEN = "steering.", "drivetrain.dead_time"
"""What a log of the data recorder does not show, because it has the feedback in place of the commands."""
SAME = 0.98
"""Correlation from which two parameters have the same effect."""
AT_BOUND = 0.01
"""Share of the range within which a value is at its bound."""


def identify(
    drive: str | Path | Drive,
    vehicle: str,
    free: Sequence[str] | Mapping[str, tuple[float, float] | None],
    *,
    name: str = "",
    is_left_positive: bool = True,
    trials: int = 24,
    seed: int = 0,
    window: float = 2.0,
    warm_up: float = 0.5,
    threads: int | None = None,
) -> Identification:
    """Fit parameters of a vehicle's file to a recorded drive.

    `drive`: a recording (.mcap), a log of AutoDRIVE's data recorder (.csv), or a `Drive`. `vehicle`: name or file.
    `free`: paths in that file, such as 'wheels.damping_rate' or 'wheels.damping_rate=0.1:0.5', or paths with bounds
    (None: from half the value to twice the value). `name`: the vehicle of a recording; empty: the first one.
    `is_left_positive`: of the steering angle of a log. `trials`: simulations of the global search. `window`, `warm_up`
    [s]: see `windows_of`. The number of `threads` does not change
    the result. Raises `IdentificationError`, `RecordingError` or `SpecError`.
    """
    began = time.perf_counter()
    if not (window >= 0.5 and 0.0 <= warm_up <= 5.0 and trials >= 1):
        raise IdentificationError("a window must be at least 0.5 s, the warm-up from 0 to 5 s, and trials at least 1")
    file = VehicleFile(vehicle)
    parameters = file.free(free)
    drive = drive if isinstance(drive, Drive) else read_drive(drive, name, is_left_positive=is_left_positive)
    check_drive(drive)
    drive = drive.in_shares(file.spec.full_throttle_speed, file.spec.steering.limit)
    if drive.is_angle and (unseen := [parameter.path for parameter in parameters if parameter.path.startswith(HIDDEN)]):
        raise IdentificationError(
            f"{', '.join(unseen)}: a log of the data recorder has the angle of the steering and the throttle after its "
            f"dead time, not the commands; use a recording (.mcap)  ({drive.source})"
        )
    drive = without_gyro_offset(drive)
    windows = windows_of(drive, window, warm_up)
    longest = {parameter.path: parameter.high for parameter in parameters if parameter.path in DEAD_TIMES}
    population = 4 + math.floor(3.0 * math.log(len(parameters)))
    simulator = Simulator(drive, windows, file, longest, population, threads)
    try:
        objective = Objective(drive, windows, file, parameters, simulator)
        if silent := without_influence(objective, parameters):
            raise IdentificationError(
                f"{', '.join(silent)}: no influence on this drive; leave out parameters without influence  "
                f"({drive.source})"
            )
        coarse, _ = search(objective, parameters, trials, seed, population=population)
        best, covariance = refine(objective, coarse)
        ends = objective.errors(np.array([[parameter.share(parameter.start) for parameter in parameters], best]))
    finally:
        simulator.close()
    values = objective.values(best.tolist())
    before, after = _whole(drive, file, values, longest)
    deviations = np.sqrt(np.diagonal(covariance)).tolist()
    fitted = [
        Fitted(
            parameter.path,
            parameter.value,
            values[parameter.path],
            _in_unit(parameter, share, deviation),
            parameter.low,
            parameter.high,
        )
        for parameter, share, deviation in zip(parameters, best.tolist(), deviations, strict=True)
    ]
    comments = [
        f"Vehicle '{vehicle}' with parameters that autodrive identify has fitted to {Path(drive.source).name}:",
        *(f"{parameter.path} {parameter.value:.5g} +- {parameter.deviation:.2g}" for parameter in fitted),
        f"Path error of the drive: {before.errors['distance'].rms:.3g} m rms before, "
        f"{after.errors['distance'].rms:.3g} m after.",
    ]
    return Identification(
        parameters=tuple(fitted),
        before=before,
        after=after,
        window_errors=tuple(zip(ends.rms[0].tolist(), ends.rms[1].tolist(), strict=True)),
        simulations=objective.simulations + 2,
        seconds=time.perf_counter() - began,
        notes=(*filter(None, [drive.note]), *_notes(parameters, best, covariance, windows, drive)),
        text=file.text(values, comments),
    )


def _in_unit(parameter: Free, share: float, deviation: float) -> float:
    """A deviation of the share of a range as one of the parameter."""
    slope = (parameter.at(share + 1e-4) - parameter.at(share - 1e-4)) / 2e-4
    return abs(slope) * deviation


def _whole(
    drive: Drive, file: VehicleFile, values: Mapping[str, float], longest: Mapping[str, float]
) -> tuple[Comparison, Comparison]:
    """The whole drive, from its start, with the values of the file and with the fitted ones."""
    window = whole_drive(drive)
    simulator = Simulator(drive, window, file, longest, 2, 1)
    try:
        motion = simulator.run([file.spec, file.with_values(values)], window.poses)
    finally:
        simulator.close()
    rows = window.rows[0]
    recorded = {
        "x": drive.x[rows],
        "y": drive.y[rows],
        "heading": drive.heading[rows],
        "speed": np.abs(drive.speed[rows]),
        "yaw rate": drive.yaw_rate[rows],
    }
    columns = (motion.x, motion.y, motion.heading, motion.speed, motion.yaw_rate)
    first, second = (
        Comparison(drive.time[rows], recorded, dict(zip(recorded, [column[i, 0] for column in columns], strict=True)))
        for i in range(2)
    )
    return first, second


def _notes(parameters: Sequence[Free], best: Floats, covariance: Floats, windows: Windows, drive: Drive) -> list[str]:
    notes = [
        f"{parameter.path} is at its bound {parameter.low if share < 0.5 else parameter.high:g}; give wider bounds"
        for parameter, share in zip(parameters, best.tolist(), strict=True)
        if min(share, 1.0 - share) < AT_BOUND
    ]
    deviations = np.sqrt(np.diagonal(covariance))
    for i, parameter in enumerate(parameters):
        for j in range(i):
            if (product := deviations[i] * deviations[j]) > 0.0 and abs(covariance[i, j] / product) > SAME:
                notes.append(
                    f"{parameters[j].path} and {parameter.path} have nearly the same effect on this drive (correlation "
                    f"{covariance[i, j] / product:.3f}); fit only one of these two parameters"
                )
        if deviations[i] > 0.1:
            notes.append(
                f"the drive hardly depends on {parameter.path}: its deviation is {100 * deviations[i]:.0f} % of its "
                "range"
            )
    if len(drive.breaks):
        notes.append(f"{len(drive.breaks)} collisions, resets or jumps; {len(windows.starts)} windows are used")
    return notes
