"""The next 30 s of driving that would reduce the uncertainty of a fit most, as a script."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.experiments.identification.gauss_newton import Point, Solver
from autodrive.experiments.identification.staged import StagedFit
from autodrive.experiments.identification.starts import DriveValues, starts_of
from autodrive.experiments.identification.synthetic import synthetic_drive

SEGMENT = 6.0
"""Length of a manoeuvre [s]."""
TOTAL = 30.0
"""Length of the whole drive [s]."""
INSTANTS = (0.25, 0.5, 1.0, 1.5, 2.0)
"""Instants at which the predictions of a manoeuvre are compared [s]."""


@dataclass(frozen=True)
class Manoeuvre:
    """Commands over SEGMENT seconds: straight lines between points of time [s], throttle and steering."""

    title: str
    points: tuple[tuple[float, float, float], ...]

    def at(self, times: Floats) -> Floats:
        """Throttle and steering at some times, shape (n, 2). A point at the time of the one before it is a step."""
        time, throttle, steering = np.transpose(self.points)
        return np.column_stack((np.interp(times, time, throttle), np.interp(times, time, steering)))


def manoeuvres(slow: float, fast: float) -> list[Manoeuvre]:
    """Candidates. `slow`, `fast`: throttles for about a third of the speed of the drives and for their highest."""
    middle = 0.5 * (slow + fast)
    made: list[Manoeuvre] = []
    for name, throttle in (("slow", slow), ("medium", middle), ("fast", fast)):
        steps = [(0.0, throttle, 0.0), (1.5, throttle, 0.0)]
        for i, angle in enumerate((0.9, -0.9, 0.5, -0.5, 0.0)):
            steps += [(1.501 + 0.9 * i, throttle, angle), (2.4 + 0.9 * i, throttle, angle)]
        made.append(Manoeuvre(f"steps of the steering, {name}", tuple(steps)))
        for side, sign in (("left", 1.0), ("right", -1.0)):
            made.append(
                Manoeuvre(
                    f"growing angle to the {side}, {name}",
                    ((0.0, throttle, 0.1 * sign), (1.0, throttle, 0.1 * sign), (6.0, throttle, sign)),
                )
            )
    for angle in (0.8, -0.8, 0.4, -0.4):
        made.append(
            Manoeuvre(
                f"speeding up on a circle, steering {angle:g}",
                ((0.0, slow, angle), (1.0, slow, angle), (5.0, fast, angle), (6.0, fast, angle)),
            )
        )
    made.append(
        Manoeuvre("coasting from speed", ((0.0, fast, 0.0), (2.5, fast, 0.0), (2.501, 0.0, 0.0), (6.0, 0.0, 0.0)))
    )
    made.append(
        Manoeuvre(
            "steps of the throttle",
            (
                (0.0, slow, 0.0),
                (1.5, slow, 0.0),
                (1.501, fast, 0.0),
                (3.0, fast, 0.0),
                (3.001, middle, 0.0),
                (6.0, middle, 0.0),
            ),
        )
    )
    made.append(Manoeuvre("straight ahead", ((0.0, slow, 0.0), (6.0, slow, 0.0))))
    return made


def design(
    fit: StagedFit, *, threads: int | None = None, progress: Callable[[str], None] = lambda text: None
) -> list[Manoeuvre]:
    """The manoeuvres, in the order of their use, that reduce the sum of the logarithms of the variances most.

    Each candidate is simulated with the fitted vehicle, and its information about the parameters is the curvature of
    the error of its predictions. They are added to the information of the drives one after another (greedy D-optimal
    design: Fedorov, Theory of Optimal Experiments, 1972).
    """
    throttles = np.concatenate([drive.in_shares(*fit.full_scale).throttle for drive in fit.drives])
    moving = throttles[throttles > 0.0]
    slow, fast = (float(np.percentile(moving, share)) for share in (15.0, 98.0))
    candidates = manoeuvres(slow, fast)
    progress(f"simulating {len(candidates)} manoeuvres")
    drives = [synthetic_drive(fit.spec, candidate.at, SEGMENT, candidate.title) for candidate in candidates]
    starts = starts_of(drives, fit.spec, INSTANTS, 0.5)
    solver = Solver(fit.file, starts, fit.free, (), fit.priors, threads=threads)
    try:
        point = Point({value.path: value.value for value in fit.fitted}, DriveValues.neutral(len(drives)))
        equations = solver.equations(point, solver.residuals([point])[0])
    finally:
        solver.close()
    numbers = [int(starts.drive[members[0]]) for members in solver.groups]
    information = {i: np.zeros_like(fit.information) for i in numbers}
    for number, curvature in zip(numbers, equations.curvatures, strict=True):
        information[number] = information[number] + curvature
    total, chosen = fit.information.copy(), []
    for _ in range(round(TOTAL / SEGMENT)):
        gains = {i: np.linalg.slogdet(total + part)[1] for i, part in information.items()}
        best = max(gains, key=lambda i: gains[i])
        total = total + information[best]
        chosen.append(candidates[best])
    return chosen


def script(chosen: Sequence[Manoeuvre], vehicle: str) -> str:
    """A Python program that drives the manoeuvres, in the simulator or, through its `command`, on a car."""
    rows = []
    for number, manoeuvre in enumerate(chosen):
        rows.append(f"    # {manoeuvre.title}")
        rows += [
            f"    ({number * SEGMENT + time:.3f}, {throttle:.4f}, {steering:.4f}),"
            for time, throttle, steering in manoeuvre.points
        ]
    return SCRIPT.format(seconds=f"{len(chosen) * SEGMENT:g}", vehicle=vehicle, rows="\n".join(rows))


def write_script(chosen: Sequence[Manoeuvre], vehicle: str, path: str | Path) -> None:
    """Write the program."""
    write_file(Path(path), script(chosen, vehicle))


SCRIPT = '''"""{seconds} s of driving that would improve the fit of {vehicle} most, from autodrive identify --design.

On a car: call `command(time)` at 50 Hz or more, in an open place, with a hand on the switch; it returns throttle and
steering as shares of the full scale. Without a car: python THIS_FILE drives a running simulator (autodrive run
--devkit 127.0.0.1:4567). python THIS_FILE --csv prints the commands as a table.
"""

import sys
from bisect import bisect_right

POINTS = [  # time [s], throttle, steering; straight lines between them
{rows}
]
TIMES = [time for time, _, _ in POINTS]


def command(time):
    """Throttle and steering, left positive, at a time after the start [s]; 0 after the end."""
    i = bisect_right(TIMES, time)
    if i == 0 or i == len(POINTS):
        return 0.0, 0.0
    (start, *before), (end, *after) = POINTS[i - 1], POINTS[i]
    share = (time - start) / (end - start) if end > start else 1.0
    return tuple(a + share * (b - a) for a, b in zip(before, after))


def main():
    if "--csv" in sys.argv:
        print("time,throttle,steering")
        for tick in range(int(50 * TIMES[-1]) + 1):
            print("%.2f,%.4f,%.4f" % (tick / 50, *command(tick / 50)))
        return
    import time

    from autodrive.devkit import RoboRacer, drive

    car, began = RoboRacer("V1"), time.monotonic()

    def step():
        car.throttle_command, car.steering_command = command(time.monotonic() - began)

    drive(step, car)


if __name__ == "__main__":
    main()
'''
