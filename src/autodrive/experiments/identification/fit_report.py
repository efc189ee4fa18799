"""The report of a staged fit: a folder with one HTML page of tables and plots, which needs nothing else, and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.cache import write_file
from autodrive.base.svg_plot import COLOURS, Scale, line, svg, text
from autodrive.base.version import __version__
from autodrive.experiments.campaigns.report import STYLE
from autodrive.experiments.identification.accuracy import REPORTED, Accuracy, SteadyCircles
from autodrive.experiments.identification.advice import advice
from autodrive.experiments.identification.staged import StagedFit

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 460, 260, 52, 130, 14, 36
"""Size of a plot and its margins [pixels]."""
WORST = 4
"""Predictions with the largest errors that are drawn."""
MAPPED = 4
"""Drives at most whose error is drawn along their path."""


def write_report(fit: StagedFit, folder: str | Path) -> Path:
    """Write `report.html` and `report.json` into a folder; returns the page."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    numbers = {
        "held out": None if fit.held is None else fit.held.as_numbers(),
        "used": fit.used.as_numbers(),
        "parameters": {
            value.path: {"value": value.value, "low": value.low, "high": value.high} for value in fit.fitted
        },
        "seconds": fit.seconds,
    }
    write_file(folder / "report.json", json.dumps(numbers, indent=1) + "\n")
    page = folder / "report.html"
    write_file(page, html(fit))
    return page


def html(fit: StagedFit) -> str:
    """The page."""
    judged = fit.held or fit.used
    title = f"Fit of {Path(fit.file.name).stem}"
    where = f"On {fit.held_name}" if fit.held else "On the driving of the fit"
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{STYLE} .grid {{ stroke: #8884 }} .axis {{ stroke: #888 }}</style>",
        f"</head><body><h1>{escape(title)}</h1><p>{escape(where)} this vehicle is {escape(judged.statement())}.</p>",
        "<h2>Error of the prediction</h2>",
        "<p>The simulation starts in the measured motion and gets the recorded commands. The position is that of the "
        "centre of the rear axle.</p>",
        _errors(judged),
        growth(judged),
        "<h2>Steady circles</h2>",
        _circles(judged.circles),
        "<h2>Where the error comes from</h2>",
        _rows("by speed and lateral acceleration", judged.by_motion()),
        _rows("by drive", judged.by_drive()),
        _maps(judged),
        "<h2>Largest errors</h2>",
        _worst(judged),
        "<h2>Parameters</h2>",
        _parameters(fit),
        _pairs(fit),
        _session(fit),
        f"<p>{fit.seconds:.0f} s, AutoDRIVE Simulator {__version__}</p></body></html>\n",
    ]
    return "\n".join(parts)


def _errors(accuracy: Accuracy) -> str:
    head = "<tr><th class=text>after</th><th class=text>prediction</th>" + "".join(
        f"<th>{name}</th><th>95 %</th>" for name in ("position [cm]", "heading [deg]", "speed [cm/s]")
    )
    rows = []
    for time in REPORTED:
        if time > accuracy.vehicle.instants[-1] + 1e-9:
            continue
        for errors in (accuracy.vehicle, *accuracy.others):
            p, p95, h, h95, v, v95 = errors.at(time)
            numbers = (100 * p, 100 * p95, math.degrees(h), math.degrees(h95), 100 * v, 100 * v95)
            cells = "".join(f"<td>{number:.1f}</td>" for number in numbers)
            rows.append(f'<tr><td class="text">{time:g} s</td><td class="text">{escape(errors.title)}</td>{cells}</tr>')
    return f'<div class="wide"><table>{head}</tr>{"".join(rows)}</table></div>'


def growth(accuracy: Accuracy) -> str:
    """The plot of the median error of the position over time."""
    curves = [
        (errors.title, errors.instants, 100 * np.median(errors.position, axis=0))
        for errors in (accuracy.vehicle, *accuracy.others)
    ]
    return _plot("time [s]", "position error, median [cm]", curves, is_logarithmic=True)


def _circles(circles: SteadyCircles) -> str:
    if not len(circles.radius):
        return "<p>The driving has no steady circles.</p>"
    rows = [
        ("measured", circles.speed, np.abs(circles.radius)),
        ("this vehicle", circles.speed, np.abs(circles.predicted)),
    ]
    errors = circles.errors
    sentence = (
        f"{len(errors)} circles: error of the radius {100 * float(np.median(errors)):.1f} % (median), "
        f"{100 * float(errors.max()):.1f} % (largest)."
    )
    return f"<p>{sentence}</p>" + _plot("speed [m/s]", "radius [m]", rows, has_lines=False)


def _rows(title: str, rows: Sequence[str]) -> str:
    return f'<h3>{escape(title)}</h3><div class="wide"><pre>{escape(chr(10).join(rows))}</pre></div>'


def _maps(accuracy: Accuracy) -> str:
    """Paths of drives; the colour is the error of the position after 1 s."""
    parts = []
    starts = accuracy.starts
    at = int(np.argmin(np.abs(accuracy.vehicle.instants - 1.0)))
    limit = float(np.percentile(accuracy.vehicle.position[:, at], 90)) or 1.0
    counts = [int((starts.drive == i).sum()) for i in range(len(starts.drives))]
    for i in np.argsort(counts)[::-1][:MAPPED].tolist():
        mask = starts.drive == i
        if not mask.any():
            continue
        x, y = starts.pose[mask, 0], starts.pose[mask, 1]
        values = np.clip(accuracy.vehicle.position[mask, at] / limit, 0.0, 1.0)
        size = max(float(np.ptp(x)), float(np.ptp(y)), 0.5)
        plot_x = Scale(float(x.min()), float(x.min()) + size, 16, 300)
        plot_y = Scale(float(y.min()), float(y.min()) + size, 300, 16)
        dots = "".join(
            f'<circle cx="{plot_x(a):.1f}" cy="{plot_y(b):.1f}" r="3.5" fill="hsl({120 * (1 - share):.0f} 70% 45%)"/>'
            for a, b, share in zip(x.tolist(), y.tolist(), values.tolist(), strict=True)
        )
        name = starts.drives[i].source.rpartition("/")[2][-43:]
        label = text(16, 326, f"{size:.1f} m; red: {100 * limit:.0f} cm or more after 1 s")
        parts.append(f"<figure>{svg(320, 336, dots, label)}<figcaption>{escape(name)}</figcaption></figure>")
    return "".join(parts)


def _worst(accuracy: Accuracy) -> str:
    """Measured and predicted paths of the starts with the largest errors."""
    starts, parts = accuracy.starts, []
    for i in np.argsort(accuracy.vehicle.position[:, -1])[::-1][:WORST].tolist():
        measured = starts.measured[i, :, :2]
        predicted = measured + accuracy.signed[i, :, :2]
        if not np.isfinite(predicted).all():
            continue
        paths = [np.vstack(([0.0, 0.0], path)) for path in (measured, predicted)]
        both = np.concatenate(paths)
        size = max(float(np.ptp(both, axis=0).max()), 0.2)
        x = Scale(float(both[:, 0].min()), float(both[:, 0].min()) + size, 20, 260)
        y = Scale(float(both[:, 1].min()), float(both[:, 1].min()) + size, 260, 20)
        drawn = [_line([(x(a), y(b)) for a, b in path.tolist()], COLOURS[k]) for k, path in enumerate(paths)]
        error = 100 * float(accuracy.vehicle.position[i, -1])
        name = starts.drives[int(starts.drive[i])].source.rpartition("/")[2][-30:]
        caption = f"{name}, from {starts.time[i]:.1f} s: {error:.0f} cm after {starts.instants[-1]:g} s"
        names = text(20, 280, "measured", more=f'fill="{COLOURS[0]}"') + text(
            110, 280, "predicted", more=f'fill="{COLOURS[1]}"'
        )
        parts.append(f"<figure>{svg(290, 290, *drawn, names)}<figcaption>{escape(caption)}</figcaption></figure>")
    return "".join(parts)


def _parameters(fit: StagedFit) -> str:
    rows = []
    for value in fit.fitted:
        before = "none" if value.before is None else f"{value.before:.5g}"
        note = "at its bound" if value.is_at_bound else "" if value.is_seen else "not seen in the drives"
        rows.append(
            f'<tr><td class="text">{escape(value.path)}</td><td>{before}</td><td>{value.value:.5g}</td>'
            f'<td>{value.low:.5g} to {value.high:.5g}</td><td class="text">{note}</td></tr>'
        )
    head = "<tr><th class=text>parameter</th><th>before</th><th>after</th><th>90 % interval</th><th></th></tr>"
    return f'<div class="wide"><table>{head}{"".join(rows)}</table></div>'


def _pairs(fit: StagedFit) -> str:
    rows = [
        f"<li>{escape(first)} and {escape(second)} ({correlation:.2f}): {escape(advice(first, second))}</li>"
        for first, second, correlation in fit.pairs
    ]
    title = "Pairs that these drives cannot tell apart (correlation of their errors), and what would:"
    return f"<p>{title}</p><ul>{''.join(rows)}</ul>" if rows else ""


def _session(fit: StagedFit) -> str:
    if not fit.session_names:
        return ""
    head = "".join(f"<th>{escape(name)}</th>" for name in fit.session_names)
    rows = []
    for i, drive in enumerate(fit.drives):
        cells = "".join(f"<td>{float(getattr(fit.session, name)[i]):.4f}</td>" for name in fit.session_names)
        rows.append(f'<tr><td class="text">{escape(drive.source.rpartition("/")[2])}</td>{cells}</tr>')
    table = f'<table><tr><th class="text">drive</th>{head}</tr>{"".join(rows)}</table>'
    return f'<h2>Values of the drives</h2><div class="wide">{table}</div>'


def _line(points: Sequence[tuple[float, float]], colour: str) -> str:
    return f'<path d="{line(points)}" fill="none" stroke="{colour}" stroke-width="2"/>'


def _plot(
    x_title: str,
    y_title: str,
    curves: Sequence[tuple[str, Floats, Floats]],
    *,
    is_logarithmic: bool = False,
    has_lines: bool = True,
) -> str:
    """A plot of curves or of points, with a legend; colours are readable on a light and on a dark page."""

    def shown(values: Floats) -> Floats:
        return np.log10(np.maximum(values, 1e-3)) if is_logarithmic else values

    xs = np.concatenate([x for _, x, _ in curves])
    ys = np.concatenate([shown(y) for _, _, y in curves])
    ys = ys[np.isfinite(ys)]
    x_scale = Scale(float(xs.min()), float(xs.max()), LEFT, WIDTH - RIGHT)
    y_scale = Scale(float(ys.min()), float(ys.max()), HEIGHT - BOTTOM, TOP)
    parts = [text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, x_title, "middle"), text(4, TOP - 3, y_title)]
    for tick in x_scale.ticks:
        parts.append(text(x_scale(tick), HEIGHT - BOTTOM + 14, f"{tick:.3g}", "middle"))
    for tick in y_scale.ticks:
        parts.append(f'<path class="grid" d="M{LEFT} {y_scale(tick):.1f}H{WIDTH - RIGHT}"/>')
        parts.append(text(LEFT - 5, y_scale(tick) + 4, f"{10**tick if is_logarithmic else tick:.3g}", "end"))
    for i, (name, x, y) in enumerate(curves):
        colour, values = COLOURS[i % len(COLOURS)], shown(y)
        points = [
            (x_scale(a), y_scale(b)) for a, b in zip(x.tolist(), values.tolist(), strict=True) if math.isfinite(b)
        ]
        if has_lines and points:
            parts.append(f'<path d="{line(points)}" fill="none" stroke="{colour}" stroke-width="2"/>')
        else:
            parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="2.5" fill="{colour}"/>' for a, b in points]
        parts.append(text(WIDTH - RIGHT + 8, TOP + 12 + 16 * i, name, more=f'style="fill:{colour}"'))
    return f"<figure>{svg(WIDTH, HEIGHT, *parts)}</figure>"
