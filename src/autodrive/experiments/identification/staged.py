"""Fits a vehicle to recorded drives in stages, states its error on driving that was not used, and its intervals."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.experiments.identification.accuracy import Accuracy, measure_accuracy
from autodrive.experiments.identification.drive import Drive, IdentificationError
from autodrive.experiments.identification.gauss_newton import (
    SESSION_PRIORS,
    NormalEquations,
    Point,
    Solver,
    resampled_steps,
)
from autodrive.experiments.identification.parameters import Free, VehicleFile
from autodrive.experiments.identification.stages import plan_for, used_by
from autodrive.experiments.identification.starts import DriveValues, Starts, starts_of
from autodrive.scenario.vehicles.spec import VehicleSpec

SHORT = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Instants of the predictions of the first stages [s]."""
LONG = (0.5, 1.0, 2.0, 3.0, 4.0)
"""Instants of the predictions that the last stage adds [s]."""
REPORT_INSTANTS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
"""Instants of the statement of the error [s]."""
HELD_SHARE = 0.2
"""Share of each drive, its end, that is held out where no drive is."""
MOST_STARTS = 320
"""Starts of a stage at most, chosen evenly: more of them cost time and add little."""
STEPS = 8
"""Steps of each stage at most."""
INTERVAL = (5.0, 95.0)
"""Percentiles of the resamplings between which the interval of 90 % lies."""
SAME = 0.95
"""Correlation from which two parameters cannot be told apart."""


@dataclass(frozen=True)
class FittedValue:
    """A fitted value of a vehicle's file."""

    path: str
    before: float | None
    value: float
    low: float
    """Lower end of the interval of 90 %."""
    high: float
    """Upper end of the interval of 90 %."""
    is_at_bound: bool
    is_seen: bool
    """Whether the drives depend on it; otherwise it has the value of the file."""


@dataclass(frozen=True)
class StagedFit:
    """A vehicle that was fitted in stages."""

    file: VehicleFile
    """The vehicle's file with what the fit added, such as a curve of the steering."""
    values: dict[str, float]
    """Values by path, which the fit changed or added."""
    fitted: tuple[FittedValue, ...]
    session: DriveValues
    """Values of the drives of the fit."""
    session_names: tuple[str, ...]
    drives: tuple[Drive, ...]
    pairs: tuple[tuple[str, str, float], ...]
    """Pairs of parameters that cannot be told apart, with the correlation of their errors."""
    held: Accuracy | None
    """Errors on driving that was not used in the fit."""
    used: Accuracy
    """Errors on the driving of the fit."""
    held_name: str
    free: tuple[Free, ...]
    """The parameters, with their bounds."""
    priors: dict[str, float]
    """Deviations of the priors of the parameters, as shares of their ranges."""
    information: Floats
    """Curvature of the error over the shares of the parameters, without the values of the drives, shape (p, p)."""
    seconds: float

    @property
    def spec(self) -> VehicleSpec:
        """The fitted vehicle."""
        return self.file.with_values(self.values)

    @property
    def full_scale(self) -> tuple[float, float]:
        """Speed [m/s] and angle [rad] at the command 1."""
        spec = self.file.spec
        return spec.drivetrain.speed_limit * spec.wheels.radius, spec.steering.limit

    def comments(self) -> list[str]:
        """The statement of the error, for the head of the file."""
        sources = sorted({Path(drive.source.partition(",")[0]).name for drive in self.drives})
        held = self.held or self.used
        where = f"On {self.held_name}" if self.held else "On the driving of the fit (nothing was held out)"
        return [
            f"Vehicle '{self.file.name}' fitted by autodrive identify to {_listed(sources)}.",
            f"{where} the vehicle is {held.statement()}.",
            *([held.circle_sentence().capitalize() + "."] if len(held.circles.radius) else []),
            *(f"{value.path} {value.value:.5g} ({value.low:.5g} to {value.high:.5g})" for value in self.fitted),
        ]

    def text(self) -> str:
        """The vehicle's file with the fitted values and the statement of the error."""
        return self.file.text(self.values, self.comments())

    def write(self, path: str | Path) -> None:
        """Write the vehicle's file."""
        write_file(Path(path), self.text())

    def table(self) -> str:
        """Values with intervals of 90 %, values of the drives, errors."""
        width = max(30, *(len(value.path) for value in self.fitted))
        rows = [f"{'parameter':{width}}{'before':>12}{'after':>12}   90 % interval"]
        for value in self.fitted:
            note = "  at its bound" if value.is_at_bound else "" if value.is_seen else "  not seen in the drives"
            before = "none" if value.before is None else f"{value.before:.5g}"
            rows.append(
                f"{value.path:{width}}{before:>12}{value.value:12.5g}   {value.low:.5g} to {value.high:.5g}{note}"
            )
        if self.session_names:
            rows += ["", f"{'drive':44}" + "".join(f"{name:>10}" for name in self.session_names)]
            for i, drive in enumerate(self.drives):
                numbers = "".join(f"{float(getattr(self.session, name)[i]):10.4f}" for name in self.session_names)
                rows.append(f"{drive.source.rpartition('/')[2][-43:]:44}{numbers}")
        for first, second, correlation in self.pairs:
            rows.append(f"note: {first} and {second} cannot be told apart (correlation {correlation:.2f})")
        title = f"held out: {self.held_name}" if self.held else "the driving of the fit"
        rows += ["", title, (self.held or self.used).table(), f"{self.seconds:.0f} s"]
        return "\n".join(rows)


def fit_in_stages(
    drives: Sequence[Drive],
    vehicle: str,
    *,
    held: Sequence[Drive] = (),
    session: Sequence[str] | None = None,
    threads: int | None = None,
    seed: int = 0,
    progress: Callable[[str], None] = lambda text: None,
) -> StagedFit:
    """Fit the steering map, then speed or force, then the tyres and all together, to drives with commands.

    `vehicle`: name or file; its kind of drivetrain decides on the parameters. `held`: drives that only judge; none:
    the last fifth of each drive. `session`: values of each drive that are fitted, of 'trim', 'drive', 'grip', 'delay';
    None: the trim, and without speed control the force. Raises `IdentificationError` and `SpecError`.
    """
    began = time.perf_counter()
    names = tuple(session) if session is not None else None
    if unknown := [name for name in names or () if name not in SESSION_PRIORS]:
        raise IdentificationError(f"{', '.join(unknown)}: values of a drive are {', '.join(SESSION_PRIORS)}")
    file = VehicleFile(vehicle)
    plan = plan_for(file.spec)
    names = plan.session if names is None else names
    prepared = file.prepared(plan.values)
    spec = prepared.spec

    def of_fit(instants: Sequence[float], every: float) -> Starts:
        starts = starts_of(drives, spec, instants, every)
        return starts if held else starts.chosen(_ends(starts) <= _middles(starts))

    short = of_fit(SHORT, 0.7)
    point = Point({path: plan.start(prepared, path) for path in plan.bounds}, DriveValues.neutral(len(drives)))
    moving: list[str] = []
    for stage in plan.stages:
        moving = [*stage.paths] if stage.is_alone else [*plan.bounds]
        chosen = thinned(short.chosen(used_by(stage, short)))
        solver = Solver(
            prepared, chosen, plan.free(prepared, moving), names, plan.priors, threads=threads, progress=progress
        )
        try:
            point, _ = solver.solve(point, STEPS, stage.title)
        finally:
            solver.close()
    long = thinned(of_fit(LONG, 1.4), MOST_STARTS // 2)
    solver = Solver(prepared, long, plan.free(prepared, moving), names, plan.priors, threads=threads, progress=progress)
    try:
        point, _ = solver.solve(point, STEPS // 2, "long predictions")
        equations = solver.equations(point, solver.residuals([point])[0])
    finally:
        solver.close()
    fitted, pairs = _intervals(solver, point, equations, file, seed)
    changed = {value.path: value.value for value in fitted if value.is_seen}
    vehicle_after = prepared.with_values(changed)
    progress("errors on the driving that was held out")
    if held:
        judged, held_name = starts_of(held, spec, REPORT_INSTANTS, 1.0), _listed([drive.source for drive in held])
    else:
        every = starts_of(drives, spec, REPORT_INSTANTS, 0.5)
        judged, held_name = every.chosen(every.time >= _middles(every)), "the last fifth of each drive"
    used = thinned(of_fit(REPORT_INSTANTS, 1.0))
    before = file.spec
    accuracies = [
        measure_accuracy(starts, vehicle_after, before=before, threads=threads) if len(starts.time) else None
        for starts in (judged, used)
    ]
    assert accuracies[1] is not None
    return StagedFit(
        file=prepared,
        values=changed,
        fitted=tuple(fitted),
        session=point.session,
        session_names=names,
        drives=tuple(drives),
        pairs=tuple(pairs),
        held=accuracies[0],
        used=accuracies[1],
        held_name=held_name,
        free=tuple(solver.free),
        priors=plan.priors,
        information=_information(equations, len(solver.free)),
        seconds=time.perf_counter() - began,
    )


def thinned(starts: Starts, most: int = MOST_STARTS) -> Starts:
    """The starts, or so many of them, evenly chosen."""
    count = len(starts.time)
    return starts if count <= most else starts.chosen(np.linspace(0, count - 1, most).round().astype(np.int64))


def _ends(starts: Starts) -> Floats:
    return starts.time + starts.instants[-1]


def _middles(starts: Starts) -> Floats:
    """When the part of each start's drive that is held out begins [s]."""
    begins = np.array([drive.time[0] + (1.0 - HELD_SHARE) * drive.duration for drive in starts.drives])
    return begins[starts.drive]


def _intervals(
    solver: Solver, point: Point, equations: NormalEquations, file: VehicleFile, seed: int
) -> tuple[list[FittedValue], list[tuple[str, str, float]]]:
    """The values with their intervals, and the pairs that cannot be told apart."""
    steps = resampled_steps(equations, seed)
    seen = equations.curvatures.sum(axis=0).diagonal()
    fitted, shown = [], []
    for i, parameter in enumerate(solver.free):
        value = point.values[parameter.path]
        share = parameter.share(value)
        is_seen = bool(seen[i] > 1e-9)
        is_at_bound = is_seen and not equations.is_free[i]
        ends = [share + float(np.percentile(steps[:, i], end)) for end in INTERVAL]
        low, high = (parameter.at(min(max(end, 0.0), 1.0)) for end in ends)
        before = file.values.get(parameter.path)
        fitted.append(FittedValue(parameter.path, before, value, low, high, is_at_bound, is_seen))
        if is_seen and not is_at_bound:
            shown.append(i)
    whole = equations.curvatures.sum(axis=0) + np.diag(equations.prior)
    kept = np.flatnonzero(equations.is_free)
    covariance = np.zeros_like(whole)
    covariance[np.ix_(kept, kept)] = np.linalg.pinv(whole[np.ix_(kept, kept)])
    deviations = np.sqrt(np.maximum(covariance.diagonal(), 1e-300))
    pairs = []
    for i in shown:
        for j in shown:
            correlation = float(covariance[i, j] / (deviations[i] * deviations[j]))
            if j < i and abs(correlation) > SAME:
                pairs.append((solver.free[j].path, solver.free[i].path, correlation))
    return fitted, pairs


def _information(equations: NormalEquations, count: int) -> Floats:
    """Curvature over the first `count` parameters, after the values of the drives follow each of their steps."""
    whole = equations.curvatures.sum(axis=0) + np.diag(equations.prior)
    rest, across = whole[count:, count:], whole[:count, count:]
    return whole[:count, :count] - across @ np.linalg.pinv(rest) @ across.T


def _listed(names: Sequence[str]) -> str:
    """Names, of many the first ones and their number."""
    names = [Path(name).name for name in names]
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:2])} and {len(names) - 2} more"
