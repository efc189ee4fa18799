"""How far predictions of a vehicle are from measured drives: errors by time, motion and drive, and circles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.units import RPM
from autodrive.experiments.identification.starts import DriveValues, Predictor, Starts
from autodrive.scenario.vehicles.spec import VehicleSpec

REPORTED = (0.5, 1.0, 2.0, 5.0)
"""Times after a start at which the error is stated [s]."""
LEAST_YAW_RATE = 0.15
"""Yaw rate from which a car drives a circle [rad/s]."""
STEADY = 0.08
"""Relative change of speed and yaw rate over 1 s up to which a circle is steady."""


@dataclass(frozen=True)
class PredictionErrors:
    """Errors of predictions at some instants after w starts."""

    title: str
    instants: Floats
    """[s], shape (s,)."""
    position: Floats
    """Distance of the predicted centre of the rear axle from the measured one [m], shape (w, s)."""
    heading: Floats
    """[rad], shape (w, s)."""
    speed: Floats
    """[m/s], shape (w, s)."""

    @staticmethod
    def of(title: str, errors: Floats, instants: Floats) -> PredictionErrors:
        """The errors of predictions, from errors of `SIGNALS`, shape (w, s, 4); infinite where physics diverges."""
        finite = np.where(np.isfinite(errors), errors, np.inf)
        position = np.hypot(finite[..., 0], finite[..., 1])
        return PredictionErrors(title, instants, position, np.abs(finite[..., 2]), np.abs(finite[..., 3]))

    def chosen(self, mask: NDArray[np.bool_]) -> PredictionErrors:
        """The errors of some starts."""
        return PredictionErrors(self.title, self.instants, self.position[mask], self.heading[mask], self.speed[mask])

    def at(self, time: float) -> tuple[float, float, float, float, float, float]:
        """Median and 95 % of position [m], heading [rad] and speed [m/s] after that time."""
        i = int(np.argmin(np.abs(self.instants - time)))
        columns = (self.position[:, i], self.heading[:, i], self.speed[:, i])
        numbers = [float(np.percentile(column, share)) for column in columns for share in (50.0, 95.0)]
        return numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]

    def as_numbers(self) -> dict[str, dict[str, float]]:
        """`at` of the reported times, by time and by name, for JSON."""
        names = ("position", "position_95", "heading", "heading_95", "speed", "speed_95")
        times = [time for time in REPORTED if time <= self.instants[-1] + 1e-9]
        return {f"{time:g}": dict(zip(names, self.at(time), strict=True)) for time in times}


@dataclass(frozen=True)
class SteadyCircles:
    """Steady circles of drives, and those of the predictions from the same starts, each of shape (k,)."""

    speed: Floats
    """[m/s]."""
    radius: Floats
    """Measured radius of the circle of the centre of the rear axle [m], positive to the left."""
    predicted: Floats
    """Radius of the prediction [m]."""
    command: Floats
    """Command of the steering, a share of its full scale."""

    @property
    def errors(self) -> Floats:
        """Relative errors of the radius."""
        return np.abs(self.predicted / self.radius - 1.0)


@dataclass(frozen=True)
class Accuracy:
    """Errors of a vehicle on drives, beside those of simpler predictions."""

    starts: Starts
    vehicle: PredictionErrors
    others: tuple[PredictionErrors, ...]
    """Constant motion, a kinematic car, and the vehicle before the fit."""
    circles: SteadyCircles
    signed: Floats
    """Errors of `SIGNALS` of the vehicle, shape (w, s, 4)."""

    def statement(self) -> str:
        """One sentence for people: error of position and heading after the reported times."""
        times = [time for time in REPORTED if time <= self.vehicle.instants[-1] + 1e-9]
        numbers = [self.vehicle.at(time) for time in times]
        position = " / ".join(f"{100.0 * number[0]:.1f} (95 %: {100.0 * number[1]:.0f})" for number in numbers)
        heading = " / ".join(
            f"{math.degrees(number[2]):.1f} (95 %: {math.degrees(number[3]):.0f})" for number in numbers
        )
        return (
            f"within {position} cm and {heading} degrees after {' / '.join(f'{time:g}' for time in times)} s "
            f"(median of {len(self.starts.time)} starts)"
        )

    def table(self) -> str:
        """The errors as text."""
        head = f"{'':34}{'position [cm]':>16}{'heading [deg]':>16}{'speed [cm/s]':>16}"
        rows = [head, f"{'after':>6}  {'prediction':26}" + f"{'median':>8}{'95 %':>8}" * 3]
        for time in REPORTED:
            if time > self.vehicle.instants[-1] + 1e-9:
                continue
            for errors in (self.vehicle, *self.others):
                p, p95, h, h95, v, v95 = errors.at(time)
                rows.append(
                    f"{time:4g} s  {errors.title[:26]:26}{100 * p:8.1f}{100 * p95:8.1f}{math.degrees(h):8.1f}"
                    f"{math.degrees(h95):8.1f}{100 * v:8.1f}{100 * v95:8.1f}"
                )
        rows += ["", *self.by_drive(), "", *self.by_motion()]
        if len(self.circles.radius):
            rows += ["", self.circle_sentence()]
        return "\n".join(rows)

    def circle_sentence(self) -> str:
        """How far the radius of steady circles is from the measured one."""
        errors = self.circles.errors
        return (
            f"radius of {len(errors)} steady circles, {self.circles.speed.min():.1f} to {self.circles.speed.max():.1f} "
            f"m/s: error {100 * float(np.median(errors)):.1f} % (median), {100 * float(errors.max()):.1f} % (largest)"
        )

    def by_drive(self) -> list[str]:
        """Median position errors of each drive."""
        rows = [f"{'drive':44}{'starts':>7}" + "".join(f"{time:g} s".rjust(8) for time in self._times()) + "  [cm]"]
        for i, drive in enumerate(self.starts.drives):
            mask = self.starts.drive == i
            if mask.any():
                rows.append(self._row(drive.source.rpartition("/")[2][-43:], mask))
        return rows

    def by_motion(self) -> list[str]:
        """Median position errors by speed and by lateral acceleration."""
        starts = self.starts
        rows: list[str] = []
        for title, values, edges in (
            ("speed [m/s]", starts.fastest, (0.0, 0.6, 1.2, 2.0, 3.0, math.inf)),
            ("lateral acceleration [m/s^2]", starts.turning, (0.0, 0.5, 2.0, 4.0, 6.0, math.inf)),
        ):
            for low, high in pairwise(edges):
                mask = (values >= low) & (values < high)
                if mask.any():
                    rows.append(self._row(f"{title} {low:g} to {high:g}", mask))
        return rows

    def as_numbers(self) -> dict[str, object]:
        """All figures, for JSON."""
        numbers: dict[str, object] = {errors.title: errors.as_numbers() for errors in (self.vehicle, *self.others)}
        numbers["starts"] = len(self.starts.time)
        if len(self.circles.radius):
            errors = self.circles.errors
            numbers["circles"] = {
                "number": len(errors),
                "median": float(np.median(errors)),
                "worst": float(errors.max()),
            }
        return numbers

    def _times(self) -> list[float]:
        return [time for time in REPORTED if time <= self.vehicle.instants[-1] + 1e-9]

    def _row(self, title: str, mask: NDArray[np.bool_]) -> str:
        chosen = self.vehicle.chosen(mask)
        return f"{title:44}{int(mask.sum()):7}" + "".join(f"{100 * chosen.at(time)[0]:8.1f}" for time in self._times())


def measure_accuracy(
    starts: Starts,
    vehicle: VehicleSpec,
    *,
    before: VehicleSpec | None = None,
    session: DriveValues | None = None,
    threads: int | None = None,
) -> Accuracy:
    """Errors of predictions from these starts.

    `before`: the vehicle before the fit. `session`: values of the drives, for the vehicle.
    """
    neutral = DriveValues.neutral(len(starts.drives))
    candidates = [(vehicle, session or neutral), *([] if before is None else [(before, neutral)])]
    errors = []
    for spec, values in candidates:  # their longest dead times may differ
        predictor = Predictor(starts, spec, threads=threads)
        try:
            errors.append(predictor.errors([(spec, values)])[0])
        finally:
            predictor.close()
    others = [
        PredictionErrors.of("constant motion", constant_motion(starts) - starts.measured, starts.instants),
        PredictionErrors.of("kinematic car", kinematic(starts, vehicle) - starts.measured, starts.instants),
    ]
    if before is not None:
        others.append(PredictionErrors.of("vehicle before the fit", errors[1], starts.instants))
    circles = steady_circles(starts, errors[0] + starts.measured)
    title = PredictionErrors.of("this vehicle", errors[0], starts.instants)
    return Accuracy(starts, title, tuple(others), circles, errors[0])


def constant_motion(starts: Starts) -> Floats:
    """`SIGNALS` of a car that keeps forward speed, left speed and yaw rate of the start, shape (w, s, 4)."""
    forward, left, rate = (column[:, None] for column in starts.motion.T)
    turned = rate * starts.instants
    # the integrals of cos and sin of the heading over time
    small = np.abs(rate) < 1e-6
    safe = np.where(small, 1.0, rate)
    along = np.where(small, starts.instants, np.sin(turned) / safe)
    across = np.where(small, 0.0, (1.0 - np.cos(turned)) / safe)
    speed = np.broadcast_to(np.hypot(forward, left), turned.shape)
    return np.stack((forward * along - left * across, forward * across + left * along, turned, speed), axis=-1)


def kinematic(starts: Starts, vehicle: VehicleSpec) -> Floats:
    """`SIGNALS` of a car whose wheels roll without slip and reach each command at once, shape (w, s, 4).

    Under speed control it has the commanded speed, otherwise that of the start (Rajamani (2.1)).
    """
    commands = starts.commands(0.0, starts.ticks)
    angles = vehicle.steering.angles(commands[..., 1])
    drive = vehicle.drivetrain
    speed = np.broadcast_to(starts.motion[:, :1], angles.shape)
    if drive.control == "speed":
        wheel_speed = drive.speed_gain * drive.speed_limit * commands[..., 0] + drive.speed_offset_rpm * RPM
        speed = np.where(commands[..., 0] == 0.0, 0.0, wheel_speed * vehicle.wheels.radius)
    steps = speed * np.tan(angles) / vehicle.wheelbase * starts.tick
    heading = np.cumsum(steps, axis=1)
    middle = heading - 0.5 * steps
    x = np.cumsum(speed * np.cos(middle), axis=1) * starts.tick
    y = np.cumsum(speed * np.sin(middle), axis=1) * starts.tick
    at = np.rint(starts.instants / starts.tick).astype(int) - 1
    return np.stack((x[:, at], y[:, at], heading[:, at], np.abs(speed[:, at])), axis=-1)


def steady_circles(starts: Starts, predicted: Floats) -> SteadyCircles:
    """The starts after which the car drives a steady circle, from 1 s to 2 s after the start."""
    instants = starts.instants
    if not (np.isclose(instants, 1.0).any() and np.isclose(instants, 2.0).any()):
        empty = np.zeros(0)
        return SteadyCircles(empty, empty, empty, empty)
    first, last = int(np.argmin(np.abs(instants - 1.0))), int(np.argmin(np.abs(instants - 2.0)))
    steering = starts.commands(0.0, round(2.0 / starts.tick))[..., 1]
    measured = starts.measured

    def radius(signals: Floats) -> Floats:
        turned = signals[:, last, 2] - signals[:, first, 2]
        chord = np.hypot(*(signals[:, last, i] - signals[:, first, i] for i in range(2)))
        safe = np.where(np.abs(turned) < 1e-6, 1e-6, turned)
        return chord / (2.0 * np.sin(np.clip(0.5 * safe, -1.5, 1.5)))

    speeds = measured[:, first : last + 1, 3]
    middle = speeds.mean(axis=1)
    turned = measured[:, last, 2] - measured[:, first, 2]
    early = measured[:, first, 2] - 0.0
    is_steady = (np.ptp(steering, axis=1) < 1e-3) & (np.ptp(speeds, axis=1) < STEADY * middle)
    is_steady &= (np.abs(turned) > LEAST_YAW_RATE) & (np.abs(turned) < 2.9)
    is_steady &= np.abs(early - turned) < 2.0 * STEADY * np.abs(turned)
    is_steady &= np.isfinite(predicted).all(axis=(1, 2))
    return SteadyCircles(
        middle[is_steady], radius(measured)[is_steady], radius(predicted)[is_steady], steering[is_steady, 0]
    )
