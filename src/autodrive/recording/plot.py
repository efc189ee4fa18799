"""Draws signals of a recording over time, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from resvg_py import svg_to_bytes

from autodrive.base.cache import write_file
from autodrive.recording.errors import RecordingError
from autodrive.recording.recording import Recording

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b")
WIDTH, HEIGHT, LEFT, RIGHT, TOP = 900, 190, 80, 170, 26
"""Of a panel and its margins [pixels]."""
COLUMNS = 1600
"""Points of a curve at most; of more, the least and the greatest in each column are drawn."""


class Curves(NamedTuple):
    """A panel of a plot: curves over time."""

    title: str
    """With the unit."""
    times: NDArray[np.float64]
    """[s], shape (n,)."""
    columns: Sequence[NDArray[np.float64]]
    """Values of each curve, shape (n,); what is not finite is not drawn."""
    names: Sequence[str]
    """Name of each curve."""


def plot(recording: Recording, signals: Sequence[str], path: Path) -> None:
    """Draw signals, such as 'V1/velocity', one above the other. Raises `RecordingError`."""
    check_suffix(path)
    if not signals:
        raise RecordingError(f"name at least one signal, such as '{next(iter(recording.signals))}'")
    drawn = [
        panel(_curves(recording, name), i * HEIGHT, recording.start, recording.end) for i, name in enumerate(signals)
    ]
    write_panels(path, drawn, HEIGHT * len(signals))


def check_suffix(path: Path) -> None:
    """Raises `RecordingError` if the name of a plot does not end in .png or .svg."""
    if path.suffix.lower() not in {".svg", ".png"}:
        raise RecordingError(f"a plot must end in .png or .svg, not '{path.suffix}'")


def write_panels(path: Path, panels: Sequence[str], height: float) -> None:
    """Write a plot whose last panels end at `height` [pixels] and have a common axis of time."""
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height + 24}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>{"".join(panels)}'
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{height + 16}" text-anchor="middle">time [s]</text></svg>'
    )
    write_file(path, svg if path.suffix.lower() == ".svg" else bytes(svg_to_bytes(svg_string=svg)))


def panel(curves: Curves, above: float, start: float, end: float) -> str:
    """The SVG of a panel from a time to another [s], `above` [pixels] below the upper edge of the plot."""
    finite = np.concatenate([column[np.isfinite(column)] for column in curves.columns])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.05 * (high - low) or 0.5
    low, high = low - margin, high + margin
    end = max(end, start + 1e-9)
    top, bottom = above + TOP, above + HEIGHT - 18
    parts = [f'<text x="{LEFT}" y="{top - 8}" font-weight="bold">{escape(curves.title)}</text>']
    for share in (0.0, 0.5, 1.0):
        y = bottom + share * (top - bottom)
        x = LEFT + share * (WIDTH - RIGHT - LEFT)
        parts.append(
            f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
            f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{low + share * (high - low):.4g}</text>'
            f'<text x="{x:.1f}" y="{bottom + 14}" text-anchor="middle">{start + share * (end - start):.4g}</text>'
        )
    x = LEFT + (curves.times - start) / (end - start) * (WIDTH - RIGHT - LEFT)
    for i, (label, column) in enumerate(zip(curves.names, curves.columns, strict=False)):
        parts.append(curve(x, bottom + (column - low) / (high - low) * (top - bottom), i))
        parts.append(legend(label, top, i))
    return "".join(parts)


def curve(x: NDArray[np.float64], y: NDArray[np.float64], number: int) -> str:
    """The SVG of a curve through places [pixels]."""
    return f'<path d="{_path(x, y)}" fill="none" stroke="{COLOURS[number % len(COLOURS)]}" stroke-width="1.3"/>'


def legend(text: str, top: float, number: int) -> str:
    """The name of a curve beside a panel, in its colour."""
    colour = COLOURS[number % len(COLOURS)]
    return f'<text x="{WIDTH - RIGHT + 8}" y="{top + 12 + 15 * number}" fill="{colour}">{escape(text)}</text>'


def _curves(recording: Recording, name: str) -> Curves:
    values, times = recording[name].astype(np.float64), recording.signals.times(name)
    signal = recording.signals.described[name]
    if len(times) == 0:
        raise RecordingError(f"the recording has no values of '{name}'")
    rows = values.reshape(len(times), -1)
    names = list(signal.elements) or [signal.name]
    if signal.size:
        rows, names = np.min(rows, axis=1, keepdims=True), [f"least of {signal.name}"]
    return Curves(f"{name} [{signal.unit}]" if signal.unit else name, times, rows.T, names)


def _path(x: NDArray[np.float64], y: NDArray[np.float64]) -> str:
    """The commands of a path; a value that is not finite interrupts it."""
    if len(x) > COLUMNS:
        edges = np.linspace(0, len(x), COLUMNS // 2 + 1).astype(int)
        chosen = [place for a, b in pairwise(edges) for place in _extremes(y, a, b)]
        x, y = x[chosen], y[chosen]
    parts: list[str] = []
    is_down = False
    for one, other in zip(x.tolist(), y.tolist(), strict=True):
        if np.isfinite(other):
            parts.append(f"{'L' if is_down else 'M'}{one:.1f} {other:.1f}")
        is_down = bool(np.isfinite(other))
    return "".join(parts) or "M0 0"


def _extremes(y: NDArray[np.float64], start: int, end: int) -> list[int]:
    """Places of the least and the greatest value of a part, in order."""
    part = np.where(np.isfinite(y[start:end]), y[start:end], 0.0)
    return sorted({start + int(np.argmin(part)), start + int(np.argmax(part))})
