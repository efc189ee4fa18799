"""Draws signals of a recording over time, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray
from resvg_py import svg_to_bytes

from autodrive.cache import write_file
from autodrive.recording.errors import RecordingError
from autodrive.recording.recording import Recording

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b")
WIDTH, HEIGHT, LEFT, RIGHT, TOP = 900, 190, 80, 170, 26
"""Of a panel and its margins [pixels]."""
COLUMNS = 1600
"""Points of a curve at most; of more, the least and the greatest in each column are drawn."""


def plot(recording: Recording, signals: Sequence[str], path: Path) -> None:
    """Draw signals, such as 'V1/velocity', one above the other. Raises `RecordingError`."""
    if path.suffix.lower() not in {".svg", ".png"}:
        raise RecordingError(f"a plot must end in .png or .svg, not '{path.suffix}'")
    if not signals:
        raise RecordingError(f"name at least one signal, such as '{next(iter(recording.signals))}'")
    panels = [_panel(recording, name, i) for i, name in enumerate(signals)]
    height = HEIGHT * len(signals) + 24
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{height}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>{"".join(panels)}'
        f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{height - 8}" text-anchor="middle">time [s]</text></svg>'
    )
    write_file(path, svg if path.suffix.lower() == ".svg" else bytes(svg_to_bytes(svg_string=svg)))


def _panel(recording: Recording, name: str, number: int) -> str:
    values, times = recording[name].astype(np.float64), recording.signals.times(name)
    signal = recording.signals.described[name]
    if len(times) == 0:
        raise RecordingError(f"the recording has no values of '{name}'")
    rows = values.reshape(len(times), -1)
    names = list(signal.elements) or [signal.name]
    if signal.size:
        rows, names = np.min(rows, axis=1, keepdims=True), [f"least of {signal.name}"]
    finite = rows[np.isfinite(rows)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
    margin = 0.05 * (high - low) or 0.5
    low, high = low - margin, high + margin
    start, end = recording.start, max(recording.end, recording.start + 1e-9)
    top, bottom = number * HEIGHT + TOP, (number + 1) * HEIGHT - 18
    unit = f" [{signal.unit}]" if signal.unit else ""
    parts = [f'<text x="{LEFT}" y="{top - 8}" font-weight="bold">{escape(name + unit)}</text>']
    for share in (0.0, 0.5, 1.0):
        y = bottom + share * (top - bottom)
        x = LEFT + share * (WIDTH - RIGHT - LEFT)
        parts.append(
            f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
            f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{low + share * (high - low):.4g}</text>'
            f'<text x="{x:.1f}" y="{bottom + 14}" text-anchor="middle">{start + share * (end - start):.4g}</text>'
        )
    for i, (label, column) in enumerate(zip(names, rows.T, strict=False)):
        colour = COLOURS[i % len(COLOURS)]
        x = LEFT + (times - start) / (end - start) * (WIDTH - RIGHT - LEFT)
        y = bottom + (column - low) / (high - low) * (top - bottom)
        parts.append(f'<path d="{_path(x, y)}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 8}" y="{top + 12 + 15 * i}" fill="{colour}">{escape(label)}</text>')
    return "".join(parts)


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
