"""Draws plots as SVG: scales with ticks, lines, texts, and panels of curves over time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b")
MARK = "#888"
"""Colour of the lines that mark times."""
WIDTH, HEIGHT, LEFT, RIGHT, TOP = 900, 190, 80, 170, 26
"""Size of a panel, and its margins [pixels]."""
COLUMNS = 1600
"""Points of a curve at most; of more, the least and the greatest in each column are drawn."""


class Scale(NamedTuple):
    """An axis: values from `low` to `high` are drawn from `start` to `end` [pixels]."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: Any) -> Any:
        """The place of a value, or of each value of an array [pixels]."""
        return self.start + (value - self.low) / ((self.high - self.low) or 1.0) * (self.end - self.start)

    @property
    def ticks(self) -> list[float]:
        """Values that are written beside the axis: both ends and the middle."""
        return [self.low, (self.low + self.high) / 2, self.high] if self.high > self.low else [self.low]


def scale(values: NDArray[np.float64] | Sequence[float], start: float, end: float) -> Scale:
    """An axis on which these values fit."""
    return Scale(float(np.min(values)), float(np.max(values)), start, end)


def svg(width: float, height: float, *content: str, box: Sequence[float] = (), font: str = "") -> str:
    """A drawing of that size [pixels]; `box`: left, top, width and height of what it shows. `font`: of all texts."""
    view = f' viewBox="{" ".join(f"{bound:.3f}" for bound in box)}"' if box else ""
    inside = "".join(content)
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}"{view}{font}>{inside}</svg>'


def text(x: float, y: float, content: str, anchor: str = "start", more: str = "") -> str:
    """A text; `anchor`: which part of it is at x: 'start', 'middle' or 'end'. `more`: other attributes."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(content)}</text>'


def line(points: Iterable[Sequence[float]], *, is_closed: bool = False) -> str:
    """The commands of a path through points [pixels]."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + "Z" * is_closed


class Curves(NamedTuple):
    """A panel of a plot: curves over time."""

    title: str
    """Title of the panel, with the unit of the curves."""
    times: NDArray[np.float64]
    """[s], shape (n,)."""
    columns: Sequence[NDArray[np.float64]]
    """Values of each curve, shape (n,); what is not finite is not drawn."""
    names: Sequence[str]
    """Name of each curve."""
    marks: Sequence[float] = ()
    """Times that a vertical line marks [s]."""


def panels_over_time(panels: Sequence[str], height: float) -> str:
    """The drawing of panels that have a common axis of time; the last ones end at `height` [pixels]."""
    background = '<rect width="100%" height="100%" fill="white"/>'
    label = text((LEFT + WIDTH - RIGHT) / 2, height + 16, "time [s]", "middle")
    return svg(WIDTH, height + 24, background, *panels, label, font=' font-family="sans-serif" font-size="12"')


def panel(curves: Curves, above: float, start: float, end: float) -> str:
    """The SVG of a panel from a time to another [s], `above` [pixels] below the upper edge of the plot."""
    finite = np.concatenate([column[np.isfinite(column)] for column in curves.columns])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.05 * (high - low) or 0.5
    top, bottom = above + TOP, above + HEIGHT - 18
    x = Scale(start, max(end, start + 1e-9), LEFT, WIDTH - RIGHT)
    y = Scale(low - margin, high + margin, bottom, top)
    parts = [text(LEFT, top - 8, curves.title, more='font-weight="bold"')]
    for time, value in zip(x.ticks, y.ticks, strict=True):
        parts.append(f'<path d="M{LEFT} {y(value):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(text(LEFT - 6, y(value) + 4, f"{value:.4g}", "end"))
        parts.append(text(x(time), bottom + 14, f"{time:.4g}", "middle"))
    parts += [
        f'<path d="M{x(mark):.1f} {top}V{bottom}" stroke="{MARK}" stroke-dasharray="3 3"/>'
        for mark in curves.marks
        if start <= mark <= end
    ]
    for i, (label, column) in enumerate(zip(curves.names, curves.columns, strict=False)):
        parts += (curve(x(curves.times), y(column), i), legend(label, top, i))
    return "".join(parts)


def curve(x: NDArray[np.float64], y: NDArray[np.float64], number: int) -> str:
    """The SVG of a curve through places [pixels]; a value that is not finite interrupts it."""
    return f'<path d="{_path(x, y)}" fill="none" stroke="{COLOURS[number % len(COLOURS)]}" stroke-width="1.3"/>'


def legend(name: str, top: float, number: int) -> str:
    """The name of a curve beside a panel, in its colour."""
    colour = COLOURS[number % len(COLOURS)]
    return text(WIDTH - RIGHT + 8, top + 12 + 15 * number, name, more=f'fill="{colour}"')


def _path(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    if len(x) > COLUMNS:
        edges = np.linspace(0, len(x), COLUMNS // 2 + 1).astype(int)
        chosen = [place for a, b in pairwise(edges) for place in _extremes(y, a, b)]
        x, y = x[chosen], y[chosen]
    is_finite = np.isfinite(y)
    pieces = np.split(np.column_stack([x, y]), np.flatnonzero(~is_finite))
    lines = (piece[np.isfinite(piece[:, 1])].tolist() for piece in pieces)
    return "".join(line(points) for points in lines if points) or "M0 0"


def _extremes(y: NDArray[np.float64], start: int, end: int) -> list[int]:
    """Places of the least and the greatest value of a part, in order."""
    part = np.where(np.isfinite(y[start:end]), y[start:end], 0.0)
    return sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
