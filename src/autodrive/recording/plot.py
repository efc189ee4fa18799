"""Draws signals of a recording over time, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from resvg_py import svg_to_bytes

from autodrive.base.cache import write_file
from autodrive.base.svg_plot import HEIGHT, Curves, panel, panels_over_time
from autodrive.recording.errors import RecordingError
from autodrive.recording.recording import Recording


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
    """Write a plot whose last panels end at `height` [pixels]."""
    drawing = panels_over_time(panels, height)
    write_file(path, drawing if path.suffix.lower() == ".svg" else bytes(svg_to_bytes(svg_string=drawing)))


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
