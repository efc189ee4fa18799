"""Gauss-Newton steps with bounds and priors: values of a vehicle, and values of each drive, fitted to predictions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.errors import SpecError
from autodrive.experiments.identification.parameters import Free, VehicleFile
from autodrive.experiments.identification.starts import DriveValues, Predictor, Starts
from autodrive.scenario.vehicles.spec import VehicleSpec

STEP = 0.004
"""Step of the differences from which the derivatives follow, as a share of the range of a parameter."""
DAMPING = (1e-3, 1e-2, 0.1, 1.0, 10.0)
"""Candidates for the next step: Marquardt's damping, relative to the curvature of each parameter."""
ENOUGH = 2e-3
"""A step that reduces the error by less than this share is the last one."""
BLOCK = 20.0
"""Length of the parts of a drive that are resampled where there are few drives [s], ..."""
LEAST_PARTS = 10
"""... or shorter ones, so that there are about so many."""
MIN_DRIVES = 6
"""Number of drives from which on whole drives are resampled: the starts of a drive share its trim and its battery."""
SAMPLES = 400
"""Number of resamplings."""
LEAST_NOISE = 0.01
"""Least mean square of the residuals for which the priors count."""
LARGEST = 50.0
"""Residual of a prediction that is not finite."""


@dataclass(frozen=True)
class SessionPrior:
    """What is known about a value of a drive before it is fitted."""

    deviation: float
    """Standard deviation around the value of the vehicle's file."""
    low: float
    high: float
    step: float
    """Step of the differences."""


SESSION_PRIORS: Mapping[str, SessionPrior] = {
    "trim": SessionPrior(0.01, -0.1, 0.1, 1e-3),
    "drive": SessionPrior(0.06, 0.5, 2.0, 1e-2),
    "grip": SessionPrior(0.3, 0.1, 2.0, 1e-2),
    "delay": SessionPrior(0.03, -0.1, 0.2, 0.02),
}
"""Priors of the trim [rad], the factors of force and friction, and the delay of the commands [s].

The deviations of trim and force are those of 17 logs of a small car on several days; the others are chosen."""


@dataclass(frozen=True)
class Point:
    """A candidate: values of the vehicle's file by path, and values of the drives."""

    values: dict[str, float]
    session: DriveValues


@dataclass(frozen=True)
class NormalEquations:
    """Curvature and slopes of the error at a point, one matrix for each group of starts."""

    curvatures: Floats
    """Shape (g, d, d); d: parameters, then each value of each drive."""
    slopes: Floats
    """Shape (g, d)."""
    prior: Floats
    """Curvature of the priors, a diagonal of shape (d,)."""
    prior_slopes: Floats
    """Shape (d,)."""
    is_free: NDArray[np.bool_]
    """Which parameters are not at a bound, shape (d,)."""
    noise: float
    """Mean square of the residuals that a step cannot explain: the curvature of a prior is this over its variance."""

    def solution(self, weights: Floats, damping: float = 0.0, prior_shift: Floats | float = 0.0) -> Floats:
        """The step that minimises the error with these weights of the groups, shape (d,).

        `prior_shift`: how far the middles of the priors are moved, in their standard deviations, shape (d,).
        """
        kept = np.flatnonzero(self.is_free)
        curvature = np.tensordot(weights, self.curvatures, 1) + np.diag(self.prior)
        curvature = curvature + damping * np.diag(np.diagonal(curvature))
        slope = weights @ self.slopes + self.prior_slopes - np.sqrt(self.noise * self.prior) * prior_shift
        step = np.zeros(len(slope))
        step[kept] = -np.linalg.lstsq(curvature[np.ix_(kept, kept)], slope[kept], rcond=None)[0]
        return step


def residuals_of(errors: Floats, instants: Floats) -> Floats:
    """Errors of `SIGNALS` of shape (..., s, 4), each divided by what is usual at its instant.

    Position (0.02 + 0.05 t) m, heading twice that in rad, speed (0.05 + 0.1 t) m/s: as the errors of good predictions
    grow, so that short and long times count alike.
    """
    position, speed = 0.02 + 0.05 * instants, 0.05 + 0.1 * instants
    scaled = errors / np.stack((position, position, 2.0 * position, speed), axis=-1)
    return np.clip(np.nan_to_num(scaled, nan=LARGEST), -LARGEST, LARGEST)


class Solver:
    """Moves a point to the least error of the predictions from some starts."""

    def __init__(
        self,
        file: VehicleFile,
        starts: Starts,
        free: Sequence[Free],
        session: Sequence[str],
        priors: Mapping[str, float],
        *,
        threads: int | None = None,
        progress: Callable[[str], None] = lambda text: None,
    ) -> None:
        """`session`: names of `SESSION_PRIORS` that are fitted. `priors`: deviations by path, as shares of the range.

        The middle of a prior is the value of the file.
        """
        self.file = file
        self.starts = starts
        self.free = [*free]
        self.session = [*session]
        self._priors = priors
        self._progress = progress
        candidates = max(len(DAMPING), len(free) + len(session))
        self._predictor = Predictor(starts, file, candidates=candidates, threads=threads)
        self._kinds = len(starts.drives)
        self.groups = groups_of(starts)
        self._noise = 1.0
        """Mean square of the residuals that a step cannot explain: the priors count relative to it."""

    def close(self) -> None:
        """End the threads."""
        self._predictor.close()

    def spec(self, point: Point) -> VehicleSpec:
        """The vehicle at a point. Raises `SpecError`."""
        return self.file.with_values(point.values)

    def residuals(self, points: Sequence[Point]) -> Floats:
        """Residuals of these points, shape (c, w, s, 4); the largest ones where a vehicle is not valid."""
        candidates, is_valid = [], []
        for point in points:
            try:
                candidates.append((self.spec(point), point.session))
                is_valid.append(True)
            except SpecError:
                candidates.append((self.file.spec, point.session))
                is_valid.append(False)
        residuals = residuals_of(self._predictor.errors(candidates), self.starts.instants)
        residuals[~np.array(is_valid)] = LARGEST
        return residuals

    def error(self, point: Point, residuals: Floats) -> float:
        """The error of a point: soft L1 norm of the mean residuals of each start, and of the priors."""
        per_start = (np.sqrt(1.0 + residuals**2) - 1.0).mean(axis=(1, 2))
        differences, inverse = self._prior(point)
        return float(per_start.sum() + 0.5 * (differences**2 * inverse).sum())

    def solve(self, point: Point, steps: int, title: str) -> tuple[Point, float]:
        """The point after at most so many steps, and its error."""
        residuals = self.residuals([point])[0]
        error = self.error(point, residuals)
        for step in range(steps):
            self._noise = min(1.0, max(LEAST_NOISE, 2.0 * float((np.sqrt(1.0 + residuals**2) - 1.0).mean())))
            error = self.error(point, residuals)
            equations = self.equations(point, residuals)
            weights = np.ones(len(self.groups))
            moves = [equations.solution(weights, damping) for damping in DAMPING]
            tried = [self.moved(point, move) for move in moves]
            after = self.residuals(tried)
            errors = [self.error(other, rest) for other, rest in zip(tried, after, strict=True)]
            chosen = int(np.argmin(errors))
            self._progress(f"{title}: step {step + 1}, error {min(error, errors[chosen]):.4g}")
            if not errors[chosen] < error:
                break
            is_last = errors[chosen] > (1.0 - ENOUGH) * error
            point, error, residuals = tried[chosen], errors[chosen], after[chosen]
            if is_last:
                break
        return point, error

    def equations(self, point: Point, residuals: Floats) -> NormalEquations:
        """Normal equations at a point with these residuals."""
        p, d = len(self.free), len(self.free) + len(self.session) * self._kinds
        shares = [parameter.share(point.values[parameter.path]) for parameter in self.free]
        signs = [STEP if share + STEP <= 1.0 else -STEP for share in shares]
        tried = [
            replace(point, values={**point.values, parameter.path: parameter.at(share + sign)})
            for parameter, share, sign in zip(self.free, shares, signs, strict=True)
        ]
        # a value of a drive changes only the starts of that drive: all drives are changed in one simulation
        for name in self.session:
            changed = getattr(point.session, name) + SESSION_PRIORS[name].step
            tried.append(replace(point, session=replace(point.session, **{name: changed})))
        steps = [*signs, *(SESSION_PRIORS[name].step for name in self.session)]
        w = len(self.starts.time)
        slopes = (self.residuals(tried) - residuals) / np.array(steps)[:, None, None, None]
        slopes = np.clip(slopes.reshape(len(tried), w, -1), -1e3, 1e3)
        flat = residuals.reshape(w, -1)
        count = flat.shape[1]
        weights = 1.0 / np.sqrt(1.0 + flat**2) / count
        curvatures, gradients = np.zeros((len(self.groups), d, d)), np.zeros((len(self.groups), d))
        for group, members in enumerate(self.groups):
            drive = int(self.starts.drive[members[0]])
            columns = [*range(p), *(p + i * self._kinds + drive for i in range(len(self.session)))]
            jacobian = slopes[:, members].reshape(len(tried), -1)
            weighted = jacobian * weights[members].ravel()
            curvatures[group][np.ix_(columns, columns)] += weighted @ jacobian.T
            gradients[group][columns] += weighted @ flat[members].ravel()
        differences, inverse = self._prior(point)
        total = gradients.sum(axis=0) + differences * inverse
        is_free = np.ones(d, np.bool_)
        for i, share in enumerate(shares):
            is_free[i] = not (share <= 1e-6 and total[i] > 0.0) and not (share >= 1.0 - 1e-6 and total[i] < 0.0)
            is_free[i] &= curvatures[:, i, i].sum() > 1e-12
        return NormalEquations(curvatures, gradients, inverse, differences * inverse, is_free, self._noise)

    def moved(self, point: Point, step: Floats) -> Point:
        """A point after a step, within the bounds."""
        values = dict(point.values)
        for parameter, change in zip(self.free, step.tolist(), strict=False):
            share = parameter.share(values[parameter.path]) + max(-0.3, min(0.3, change))
            values[parameter.path] = parameter.at(min(max(share, 0.0), 1.0))
        changes = {}
        for i, name in enumerate(self.session):
            first, prior = len(self.free) + i * self._kinds, SESSION_PRIORS[name]
            changes[name] = np.clip(
                getattr(point.session, name) + step[first : first + self._kinds], prior.low, prior.high
            )
        return Point(values, replace(point.session, **changes))

    def _prior(self, point: Point) -> tuple[Floats, Floats]:
        """Differences from the middles of the priors, and the weights of their squares, shape (d,)."""
        differences, inverse = [], []
        for parameter in self.free:
            deviation = self._priors.get(parameter.path, math.inf)
            middle = parameter.share(parameter.start)
            differences.append(parameter.share(point.values[parameter.path]) - middle)
            inverse.append(deviation**-2 if math.isfinite(deviation) else 1e-4)
        neutral = DriveValues.neutral(self._kinds)
        for name in self.session:
            differences += (getattr(point.session, name) - getattr(neutral, name)).tolist()
            inverse += [SESSION_PRIORS[name].deviation ** -2] * self._kinds
        return np.array(differences), self._noise * np.array(inverse)


def groups_of(starts: Starts) -> list[Integers]:
    """Groups of starts with independent noise: drives, or where there are few of them, parts of at most 20 s."""
    numbers = np.unique(starts.drive)
    total = sum(starts.drives[number].duration for number in numbers.tolist())
    block = min(BLOCK, total / LEAST_PARTS)
    part = np.zeros(len(starts.time)) if len(numbers) >= MIN_DRIVES else np.floor(starts.time / block)
    keys = starts.drive * 1_000_000 + part.astype(np.int64)
    return [np.flatnonzero(keys == key) for key in np.unique(keys)]


def resampled_steps(equations: NormalEquations, seed: int) -> Floats:
    """Steps to the least error of resampled groups (bootstrap), relative to that of all groups, shape (SAMPLES, d).

    Each sample draws as many groups as there are, with repetition (Efron, Annals of Statistics 7 (1979)), and the
    middle of each prior from the prior, so that a value that the drives do not show is as uncertain as its prior
    (Bardsley et al., SIAM Journal on Scientific Computing 36 (2014)). Its estimate is a single Gauss-Newton step from
    that of all groups.
    """
    rng = np.random.default_rng(seed)
    count = len(equations.slopes)
    whole = equations.solution(np.ones(count))
    samples = []
    for _ in range(SAMPLES):
        weights = np.bincount(rng.integers(count, size=count), minlength=count).astype(np.float64)
        prior_shift = rng.normal(size=len(whole))
        samples.append(equations.solution(weights, prior_shift=prior_shift) - whole)
    # the mean square of resampled means is (n - 1) / n of that of the mean; and the quantile of Student's distribution
    # at 95 % is about 1 + 0.92 / (n - 1) times that of the normal one
    left = max(1, count - 1)
    return np.array(samples) * math.sqrt(count / left) * (1.0 + 0.92 / left)
