"""The points of a campaign: which values its parameters have in each sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from statistics import NormalDist
from typing import Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats
from autodrive.base.errors import AutodriveError
from autodrive.base.installation import missing
from autodrive.base.specs import Spec

Value: TypeAlias = bool | int | float | str
Pair: TypeAlias = tuple[float, float]
Method: TypeAlias = Literal["grid", "list", "random", "latin_hypercube", "sobol"]
MAX_COUNT = 10**7
"""Samples that a campaign draws, at most."""


class ParameterRange(Spec):
    """Values of one parameter; exactly one key."""

    uniform: Pair | None = None
    """Least and greatest value; all between are equally probable."""
    log_uniform: Pair | None = None
    """Lowest and highest value; the logarithm is distributed uniformly."""
    normal: Pair | None = None
    """Mean and standard deviation."""
    choice: tuple[Value, ...] | None = Field(default=None, min_length=1)
    """Values of which one is drawn, equally probable; a list is the same."""
    grid: tuple[Value, ...] | None = Field(default=None, min_length=1)
    """Values that are all used, each with each sample of the other parameters."""

    @model_validator(mode="after")
    def _is_one(self) -> ParameterRange:
        keys = {key: value for key, value in self if value is not None}
        if len(keys) != 1:
            raise ValueError("give one of uniform, log_uniform, normal, choice and grid")
        (kind, value), *_ = keys.items()
        if kind in ("uniform", "log_uniform") and not value[0] < value[1]:
            raise ValueError(f"{kind}: the first number must be less than the second")
        if kind == "log_uniform" and value[0] <= 0.0:
            raise ValueError("log_uniform: the numbers must be greater than 0")
        if kind == "normal" and value[1] <= 0.0:
            raise ValueError("normal: the standard deviation must be greater than 0")
        return self

    @property
    def values(self) -> tuple[Value, ...]:
        """The values of a choice or a grid; of others, two typical ones."""
        if self.choice or self.grid:
            return self.choice or self.grid or ()
        return tuple(self.at(u) for u in (0.0005, 0.9995))

    @property
    def is_continuous(self) -> bool:
        """Whether it is drawn from an interval."""
        return not (self.choice or self.grid)

    def at(self, u: float) -> Value:
        """The value at the quantile `u` in [0, 1)."""
        if self.uniform:
            low, high = self.uniform
            return low + (high - low) * u
        if self.log_uniform:
            low, high = map(math.log, self.log_uniform)
            return math.exp(low + (high - low) * u)
        if self.normal:
            return NormalDist(*self.normal).inv_cdf(min(max(u, 2.0**-53), 1.0 - 2.0**-53))
        options = self.values
        return options[min(int(u * len(options)), len(options) - 1)]


class Sampling(Spec):
    """How the values are drawn."""

    method: Method = "grid"
    """'grid': all combinations of the lists. 'list': the points of `points`. The others draw `count` samples."""
    count: int | None = Field(default=None, ge=1, le=MAX_COUNT)
    """Samples that are drawn; each is run with each combination of the parameters with 'grid'."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of the draws."""
    points: tuple[dict[str, Value], ...] = Field(default=(), max_length=100_000)
    """Values by parameter of each sample, for the method 'list'."""


class Design:
    """A sequence of points; a point has the value of each parameter by its path."""

    def __init__(self, parameters: Mapping[str, ParameterRange], sampling: Sampling) -> None:
        self._parameters = dict(parameters)
        self._sampling = sampling
        is_grid = sampling.method == "grid"
        self._crossed = {name: range_ for name, range_ in self._parameters.items() if range_.grid or is_grid}
        self._drawn = {name: range_ for name, range_ in self._parameters.items() if name not in self._crossed}
        self._sizes = [len(range_.values) for range_ in self._crossed.values()]
        self._draws = len(sampling.points) if sampling.method == "list" else (sampling.count or 1)

    @property
    def size(self) -> int:
        """Number of points, which may be more than `len` can return."""
        return self._draws * math.prod(self._sizes)

    def __len__(self) -> int:
        return self.size

    def __iter__(self) -> Iterator[dict[str, Value]]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> dict[str, Value]:
        draw, cell = divmod(i, math.prod(self._sizes))
        crossed: dict[str, Value] = {}
        for (name, range_), size in zip(reversed(self._crossed.items()), reversed(self._sizes), strict=True):
            cell, k = divmod(cell, size)
            crossed[name] = range_.values[k]
        if self._sampling.method == "list":
            return crossed | self._sampling.points[draw]
        row = self._quantiles[draw].tolist() if self._drawn else []
        drawn = {name: range_.at(u) for (name, range_), u in zip(self._drawn.items(), row, strict=True)}
        return {name: {**crossed, **drawn}[name] for name in self._parameters}

    @cached_property
    def _quantiles(self) -> Floats:
        """Quantiles of the draws in [0, 1), shape (draws, parameters)."""
        count, width, method = self._draws, len(self._drawn), self._sampling.method
        rng = np.random.default_rng(self._sampling.seed)
        if method == "random":
            return rng.random((count, width))
        try:
            from scipy.stats import qmc  # noqa: PLC0415  an extra
        except ModuleNotFoundError:
            raise AutodriveError(missing("scipy", "campaigns")) from None
        if method == "latin_hypercube":
            return qmc.LatinHypercube(width, rng=rng).random(count)
        # The length of the whole sequence is a power of 2; its beginning is taken.
        return qmc.Sobol(width, rng=rng).random_base2(max(0, math.ceil(math.log2(count))))[:count]
