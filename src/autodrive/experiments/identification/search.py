"""The search: a global one with Optuna, then Gauss-Newton steps with a trust region, both on the same error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.installation import missing
from autodrive.experiments.identification.drive import IdentificationError
from autodrive.experiments.identification.parameters import Free, VehicleFile
from autodrive.experiments.identification.windows import Simulator, Windows
from autodrive.recording.drives import Drive

SIGNALS = ("path", "speed", "yaw rate")
FLOOR = 1e-4
"""Errors below this share of the magnitude of a signal do not count."""
WORST = 1e6
"""Error of a vehicle that is not valid or whose physics diverges."""
STEP = 0.01
"""Step of the differences from which the derivatives follow, as a share of the range of a parameter."""
DAMPING = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0)
"""Candidates for the next step: Marquardt's damping, relative to the curvature of each parameter."""
MIN_WINDOWS = 3
"""Fewest windows whose scatter shows a deviation."""
MAX_STEPS = 12
"""Most steps of Gauss-Newton."""
TOLERANCE = 1e-4
"""A step that changes each parameter by less than this share of its range is the last one, ..."""
SMALL = 0.1
"""... or by less than this share of its deviation."""
LEAST_EFFECT = 1e-6
"""A parameter that changes no signal by more than this share of its magnitude has no influence."""


@dataclass(frozen=True)
class Errors:
    """Errors of c candidates, one row for each."""

    residuals: tuple[Floats, Floats, Floats]
    """Residuals of path [m], speed [m/s] and yaw rate [rad/s]; shape (c, w, n), 0 where there is no sample."""
    squares: Floats
    """Mean squares of each window, shape (c, w, 3)."""
    rms: Floats
    """Root mean squares of all windows, shape (c, 3)."""


class Objective:
    """The error of candidates: shares of the ranges of the free parameters, shape (c, p).

    A window is compared in three signals. The speeds and the yaw rates at the same time are compared as they are. The
    simulated path is laid on the recorded one with the translation and the rotation that fit best, so that neither the
    noise of the pose at the start of a window nor the drift before it counts. The error is the mean logarithm of the
    mean squares of the windows, each with the median of all windows added, and the sum over the signals: a signal needs
    no weight, and a window that no candidate explains, such as one that starts in a spin, has little influence.
    """

    def __init__(
        self, drive: Drive, windows: Windows, file: VehicleFile, free: Sequence[Free], simulator: Simulator
    ) -> None:
        self._drive = drive
        self._windows = windows
        self._file = file
        self._free = free
        self._simulator = simulator
        self.simulations = 0
        """Number of simulations of all windows with a candidate."""
        rows, used = windows.rows, windows.is_used
        self._counts = np.maximum(used.sum(axis=1), 1)
        self._x, self._y = drive.x[rows], drive.y[rows]
        lengths = np.where(used, np.abs(drive.speed[rows]), 0.0).sum(axis=1) / np.maximum(used.sum(axis=1), 1)
        self.scales = np.array(
            [
                float(np.sqrt(np.mean((lengths * windows.ticks * drive.tick) ** 2))),
                float(np.sqrt(np.mean(drive.speed[rows][used] ** 2))),
                float(np.sqrt(np.mean(drive.yaw_rate[rows][used] ** 2))),
            ]
        )
        """Magnitudes of the signals."""
        if not self.scales[1] > 1e-3:
            raise IdentificationError(f"the car does not move in the drive  ({drive.source})")
        self.scales = np.maximum(self.scales, 1e-3)

    def values(self, shares: Floats) -> dict[str, float]:
        """The parameters of one candidate."""
        return {
            parameter.path: parameter.at(min(max(share, 0.0), 1.0))
            for parameter, share in zip(self._free, shares, strict=True)
        }

    def errors(self, candidates: Floats) -> Errors:
        """Errors of these candidates; not a number if a vehicle is not valid."""
        specs = []
        is_valid = np.ones(len(candidates), np.bool_)
        for i, shares in enumerate(candidates):
            try:
                specs.append(self._file.with_values(self.values(shares.tolist())))
            except SpecError:
                specs.append(self._file.spec)
                is_valid[i] = False
        motion = self._simulator.run(specs)
        self.simulations += len(candidates)
        used, rows = self._windows.is_used, self._windows.rows
        path = self._path_residuals(motion.x, motion.y)
        speed = np.where(used, motion.speed - np.abs(self._drive.speed[rows]), 0.0)
        rate = np.where(used, motion.yaw_rate - self._drive.yaw_rate[rows], 0.0)
        for residuals in (path, speed, rate):
            residuals[~is_valid] = np.nan
        sums = np.stack([(residuals**2).sum(axis=2) for residuals in (path, speed, rate)], axis=2)
        rms = np.sqrt(sums.sum(axis=1) / self._counts.sum())
        return Errors((path, speed, rate), sums / self._counts[:, None], rms)

    def medians(self, errors: Errors) -> Floats:
        """Medians of the mean squares of the windows of each candidate, shape (c, 3)."""
        return np.maximum(np.median(errors.squares, axis=1), (FLOOR * self.scales) ** 2)

    def totals(self, errors: Errors, medians: Floats | None = None) -> Floats:
        """The error of each candidate, shape (c,). `medians`: fixed ones, shape (3,); None: those of each candidate."""
        added = self.medians(errors)[:, None] if medians is None else medians
        totals = np.log((errors.squares + added) / self.scales**2).mean(axis=1).sum(axis=1)
        return np.where(np.isfinite(totals), totals, WORST)

    def _path_residuals(self, x: Floats, y: Floats) -> Floats:
        """Differences in x, then in y, of each path that is laid on the recorded one, shape (c, w, 2 s)."""
        used = self._windows.is_used

        def centred(values: Floats) -> Floats:
            kept = np.where(used, values, 0.0)
            return np.where(used, kept - (kept.sum(axis=-1) / self._counts)[..., None], 0.0)

        x, y, u, v = centred(x), centred(y), centred(self._x), centred(self._y)
        angle = np.arctan2((x * v - y * u).sum(axis=-1), (x * u + y * v).sum(axis=-1))[..., None]
        cos, sin = np.cos(angle), np.sin(angle)
        return np.concatenate((cos * x - sin * y - u, sin * x + cos * y - v), axis=-1)


def search(
    objective: Objective, free: Sequence[Free], trials: int, seed: int, *, population: int
) -> tuple[Floats, float]:
    """The best candidate of a global search by Optuna, and its error. The same seed gives the same result.

    CMA-ES, which starts at the values of the file; of a single parameter, the tree-structured Parzen estimator, because
    Optuna's CMA-ES needs two.
    """
    optuna = _optuna()
    start = {parameter.path: parameter.share(parameter.start) for parameter in free}
    if len(free) == 1:
        sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=min(10, trials))
    else:
        sampler = optuna.samplers.CmaEsSampler(seed=seed, popsize=population)
    study = optuna.create_study(sampler=sampler)
    study.enqueue_trial(start)
    done = 0
    while done < trials:
        asked = [study.ask() for _ in range(min(population, trials - done))]
        shares = np.array([[trial.suggest_float(parameter.path, 0.0, 1.0) for parameter in free] for trial in asked])
        totals = objective.totals(objective.errors(shares))
        for trial, total in zip(asked, totals.tolist(), strict=True):
            study.tell(trial, total)
        done += len(asked)
    return np.array([study.best_params[parameter.path] for parameter in free]), float(study.best_value)


def refine(objective: Objective, shares: Floats) -> tuple[Floats, Floats]:
    """The best candidate near that one by Gauss-Newton steps, and the covariance of its shares, shape (p, p)."""
    best = shares.copy()
    covariance = np.full((len(best), len(best)), np.nan)
    for _ in range(MAX_STEPS):
        steps = np.where(best > 0.5, -STEP, STEP)  # inside the bounds
        tried = np.concatenate((best[None], best + np.diag(steps), np.clip(best - np.diag(steps), 0.0, 1.0)))
        errors = objective.errors(tried)
        medians = objective.medians(errors)[0]  # fixed in a step, so that its slopes are those of the error
        total = float(objective.totals(errors, medians)[0])
        spans = np.diagonal(tried[1 : 1 + len(best)] - tried[1 + len(best) :])
        residuals, jacobian = _scaled(errors, medians, spans)
        if not np.isfinite(jacobian).all():
            break
        curvature = np.einsum("wnp,wnq->pq", jacobian, jacobian)
        slopes = np.einsum("wnp,wn->wp", jacobian, residuals)
        covariance = _covariance(curvature, slopes)
        scale = np.diag(np.diagonal(curvature))
        moves = [-np.linalg.pinv(curvature + damping * scale) @ slopes.sum(axis=0) for damping in DAMPING]
        candidates = np.clip(best + np.array(moves), 0.0, 1.0)
        totals = objective.totals(objective.errors(candidates), medians)
        chosen = int(np.argmin(totals))
        if not totals[chosen] < total:
            break
        change = np.abs(candidates[chosen] - best)
        best = candidates[chosen]
        if (change < np.maximum(TOLERANCE, SMALL * np.sqrt(np.nan_to_num(np.diagonal(covariance))))).all():
            break
    return best, covariance


def _scaled(errors: Errors, medians: Floats, spans: Floats) -> tuple[Floats, Floats]:
    """Residuals of the first candidate, shape (w, n), and their derivatives, shape (w, n, p), per deviation."""
    p = len(spans)
    deviations = np.sqrt(errors.squares[0] + medians)
    parts = [residuals / deviations[:, i, None] for i, residuals in enumerate(errors.residuals)]
    stacked = np.concatenate(parts, axis=-1)
    jacobian = (stacked[1 : 1 + p] - stacked[1 + p :]) / spans[:, None, None]
    return stacked[0], np.moveaxis(jacobian, 0, -1)


def _covariance(curvature: Floats, slopes: Floats) -> Floats:
    """Covariance of the estimate, from the scatter of the gradients of the windows, which have independent noise.

    Neighbouring samples of a window do not have independent noise, so that the inverse of the curvature alone would be
    too small (White, Econometrica 50 (1982), theorem 3.2).
    """
    w = len(slopes)
    if w < MIN_WINDOWS:
        return np.full_like(curvature, np.nan)
    inverse = np.linalg.pinv(curvature)
    centred = slopes - slopes.mean(axis=0)
    scatter = centred.T @ centred * (w / (w - 1))
    return inverse @ scatter @ inverse


def without_influence(objective: Objective, free: Sequence[Free]) -> list[str]:
    """The parameters that change no signal between their bounds."""
    start = np.array([parameter.share(parameter.start) for parameter in free])
    tried = [start]
    for i in range(len(free)):
        for share in (0.0, 1.0):
            tried.append(np.where(np.arange(len(free)) == i, share, start))
    changed = objective.errors(np.array(tried)).residuals
    names: list[str] = []
    for i, parameter in enumerate(free):
        effect = 0.0
        for residuals, scale in zip(changed, objective.scales.tolist(), strict=True):
            for other in (residuals[1 + 2 * i], residuals[2 + 2 * i]):
                change = float(np.abs(other - residuals[0]).max()) / scale
                effect = max(effect, change if math.isfinite(change) else math.inf)
        if effect < LEAST_EFFECT:
            names.append(parameter.path)
    return names


def _optuna() -> Any:
    try:
        import cmaes  # noqa: F401, PLC0415
        import optuna  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise IdentificationError(missing(error.name or "optuna", "search")) from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    return optuna
