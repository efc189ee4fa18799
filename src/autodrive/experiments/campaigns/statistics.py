"""Summary of a campaign: rates with Wilson's interval, means with Student's t."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.experiments.campaigns.campaign import Campaign

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats
    from autodrive.experiments.campaigns.table import Columns

CONFIDENCE = 0.95
Z = 1.959963984540054
"""Quantile of the normal distribution for `CONFIDENCE`, two-sided."""
SEED_CHANGES_NOTHING = "no result depends on the seed: rates, means and intervals count each sample once"


def wilson(count: int, total: int) -> tuple[float, float]:
    """Confidence interval of a rate (Wilson 1927); (0, 1) without runs."""
    if total == 0:
        return 0.0, 1.0
    rate, z2 = count / total, Z * Z
    centre = (rate + z2 / (2 * total)) / (1 + z2 / total)
    half = Z / (1 + z2 / total) * math.sqrt(rate * (1 - rate) / total + z2 / (4 * total * total))
    return max(0.0, centre - half), min(1.0, centre + half)


def mean_interval(values: Floats) -> tuple[float, float]:
    """Confidence interval of a mean by Student's t; nan with fewer than two values."""
    from scipy.stats import t  # noqa: PLC0415  an extra

    n = len(values)
    if n < 2:
        return math.nan, math.nan
    half = float(t.ppf(0.5 + CONFIDENCE / 2, n - 1)) * float(np.std(values, ddof=1)) / math.sqrt(n)
    mean = float(np.mean(values))
    return mean - half, mean + half


def summary(campaign: Campaign, table: Columns) -> dict[str, Any]:
    """The numbers of a campaign; JSON."""
    counted = {status["values"]: status["counts"] for status in table["status"].value_counts().to_pylist()}
    counts = {name: counted[name] for name in ("pass", "fail", "done", "error") if name in counted}
    numbers: dict[str, Any] = {"campaign": campaign.name, "runs": len(campaign), "rows": len(table), "counts": counts}
    errors = np.flatnonzero(table.where("status", "error"))[:1]
    if len(errors):
        numbers["first_error"] = table["error"][int(errors[0])].as_py()
    independent = _independent(table)
    numbers["seed_changes_results"] = bool(independent.all())
    if campaign.criterion is not None:
        passed, failed = (int((table.where("status", name) & independent).sum()) for name in ("pass", "fail"))
        judged = passed + failed
        low, high = wilson(passed, judged)
        rate = passed / judged if judged else None
        numbers["pass"] = {"criterion": campaign.spec.pass_, "runs": judged, "rate": rate, "low": low, "high": high}
    numbers["metrics"] = {name: _metric(table.numbers(name)[independent]) for name in campaign.metric_names}
    return numbers


def _independent(table: Columns) -> NDArray[np.bool_]:
    """The rows that count as independent: all, or one of each sample if no result depends on the seed."""
    sample, digest, is_error = table["sample"].to_numpy(), table["digest"].to_numpy(), table.where("status", "error")
    independent = np.ones(len(sample), dtype=bool)
    is_repeated = (sample[1:] == sample[:-1]) & ~(is_error[1:] | is_error[:-1])  # rows are sorted by runs and samples
    if is_repeated.any() and (digest[1:] == digest[:-1])[is_repeated].all():
        independent[1:] = ~is_repeated
    return independent


def _metric(values: Floats) -> dict[str, Any]:
    values = values[np.isfinite(values)]
    if not len(values):
        return {"runs": 0}
    low, high = mean_interval(values)
    numbers = {"mean": np.mean(values), "low": low, "high": high, "min": values.min(), "max": values.max()}
    return {
        "runs": len(values),
        **{name: float(number) if math.isfinite(number) else None for name, number in numbers.items()},
    }
