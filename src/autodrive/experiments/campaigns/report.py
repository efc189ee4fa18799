"""The report of a campaign: one HTML file with tables, plots and the worst cases; it needs nothing else."""

from __future__ import annotations

import math
import shlex
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from autodrive.base.svg_plot import scale, text
from autodrive.base.version import __version__
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.statistics import SEED_CHANGES_NOTHING, wilson

if TYPE_CHECKING:
    from autodrive.base.arrays import Floats
    from autodrive.experiments.campaigns.table import Columns

WORST = 25
"""Runs in the table of the worst cases."""
FEW = 12
"""Parameters with at most so many values are crossed in tables."""
POINTS = 2000
"""Points of a plot at most, at equal distances in the table."""
BINS = 10
WIDTH, HEIGHT, LEFT, RIGHT, BOTTOM, TOP = 340, 200, 54, 24, 34, 10
"""Size of a plot and its margins [pixels]."""
COLOURS = {"pass": "#2a8a4a", "fail": "#c8372d", "done": "#2b6cb0", "error": "#777"}

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 1100px; padding: 0 1rem; color: #222 }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2rem }
table { border-collapse: collapse } .wide { overflow-x: auto }
td, th { padding: .25rem .6rem; border-bottom: 1px solid #ddd; text-align: right; white-space: nowrap }
th { background: #f4f4f4 } td.text, th.text { text-align: left }
code { background: #f4f4f4; padding: .1rem .3rem } figure { display: inline-block; margin: .4rem }
svg text { font: 11px system-ui, sans-serif; fill: #444 }
.pass { color: #2a8a4a } .fail { color: #c8372d } .error { color: #777 }
@media (prefers-color-scheme: dark) {
  body { background: #181818; color: #ddd } th, code { background: #262626 } td, th { border-color: #3a3a3a }
  svg text { fill: #bbb }
}
"""


def report(campaign: Campaign, table: Columns, numbers: dict[str, Any]) -> str:
    """The HTML text."""
    title = campaign.spec.title or campaign.name
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{STYLE}</style></head><body><h1>{escape(title)}</h1>",
        _overview(campaign, numbers),
        _metrics(campaign, numbers),
        _worst(campaign, table),
        _plots(campaign, table),
        f"<p>AutoDRIVE Simulator {__version__}</p></body></html>\n",
    ]
    return "\n".join(parts)


def replay_command(campaign: Campaign, run: int) -> str:
    """The command that runs one run again and shows it."""
    return f"autodrive campaign {shlex.quote(str(campaign.path or campaign.name + '.yaml'))} --replay {run}"


def _overview(campaign: Campaign, numbers: dict[str, Any]) -> str:
    spec, counts = campaign.spec, numbers["counts"]
    rows = [("scenario", spec.scenario), ("driver", spec.driver)]
    size = f"{len(campaign.design)} samples ({spec.samples.method}), {len(spec.seed_list)} seeds"
    rows += [("runs", f"{numbers['rows']} of {numbers['runs']}: {size}")]
    if not numbers["seed_changes_results"]:
        rows += [("seeds", SEED_CHANGES_NOTHING)]
    rows += [("ends", ", ".join([f"after {spec.stop.time:g} s", *spec.stop.events]))]
    rows += [(name, str(count)) for name, count in counts.items()]
    if judged := numbers.get("pass"):
        rows.append(("criterion", judged["criterion"]))
        if judged["rate"] is not None:
            interval = f"{100 * judged['low']:.1f} to {100 * judged['high']:.1f} %"
            rows.append(("pass rate", f"{100 * judged['rate']:.1f} %, 95 % confidence {interval} (Wilson)"))
    cells = "".join(
        f'<tr><th class="text">{escape(name)}</th><td class="text">{escape(text)}</td></tr>' for name, text in rows
    )
    return f"<table>{cells}</table>"


def _metrics(campaign: Campaign, numbers: dict[str, Any]) -> str:
    head = (
        "<tr><th class=text>metric</th><th>runs</th><th>mean</th><th>95 % confidence</th><th>min</th><th>max</th></tr>"
    )
    rows = []
    for name in campaign.metric_names:
        metric = numbers["metrics"][name]
        cells = f"<td class=text>{escape(name)}</td><td>{metric['runs']}</td>"
        if metric["runs"]:
            interval = "" if metric["low"] is None else f"{metric['low']:.4g} to {metric['high']:.4g}"
            cells += f"<td>{metric['mean']:.4g}</td><td>{interval}</td>"
            cells += f"<td>{metric['min']:.4g}</td><td>{metric['max']:.4g}</td>"
        rows.append(f"<tr>{cells}</tr>")
    return f"<h2>Metrics</h2><table>{head}{''.join(rows)}</table>"


def worst(table: Columns, count: int = WORST) -> list[dict[str, Any]]:
    """Rows of the runs that are farthest from the criterion, then those with errors; none without a criterion."""
    margins = table.numbers("margin")
    failed = np.flatnonzero(table.where("status", "fail"))
    failed = failed[np.argsort(margins[failed], kind="stable")]
    places = np.concatenate([failed, np.flatnonzero(table.where("status", "error"))])[:count]
    return table.rows(table["run"].take(places).to_pylist())


def _worst(campaign: Campaign, table: Columns) -> str:
    rows = worst(table)
    if not rows:
        return "<h2>Worst cases</h2><p>No run failed.</p>"
    names = [*campaign.spec.parameters, *campaign.metric_names]
    head = "".join(f"<th>{escape(name)}</th>" for name in ("seed", *names))
    lines = []
    for row in rows:
        cells = "".join(f"<td>{_text(row[name])}</td>" for name in ("seed", *names))
        reason = row["error"] or row["end"]
        lines.append(
            f'<tr><td class="text {row["status"]}">{row["status"]}</td><td class="text">{escape(reason)}</td>'
            f'<td class="text"><code>{escape(replay_command(campaign, row["run"]))}</code></td>{cells}</tr>'
        )
    return (
        f'<h2>Worst cases</h2><div class="wide"><table><tr><th class="text">status</th>'
        f'<th class="text">end</th><th class="text">run it again and record it</th>{head}</tr>'
        f"{''.join(lines)}</table></div>"
    )


def _plots(campaign: Campaign, table: Columns) -> str:
    parts = ["<h2>Distributions</h2>", *(_histogram(name, table.numbers(name)) for name in campaign.metric_names)]
    varied = [path for path in campaign.spec.parameters if table.varies(path)]
    numeric = [path for path in varied if str(table[path].type) in ("double", "int64")]
    if campaign.criterion is not None and len(table):
        parts.append("<h2>Pass rate by parameter</h2>")
        is_passed = table.where("status", "pass")
        is_judged = is_passed | table.where("status", "fail")
        for path in varied:
            if path in numeric:
                parts.append(_rates(path, table.numbers(path)[is_judged], is_passed[is_judged]))
            else:
                options = sorted(table[path].unique().to_pylist())
                places = np.select([table.where(path, option) for option in options], np.arange(float(len(options))))
                parts.append(
                    _rates(path, places[is_judged], is_passed[is_judged], [_text(option) for option in options])
                )
        few = [path for path in varied if len(table[path].unique()) <= FEW]
        parts += [_crossed(table, few[0], other, is_passed, is_judged) for other in few[1:]]
    step = max(1, math.ceil(len(table) / POINTS))
    shown = table["status"].take(np.arange(0, len(table), step)).to_pylist()
    parts.append("<h2>Metrics by parameter</h2>")
    for path in numeric:
        for name in campaign.metric_names:
            x, y = table.numbers(path)[::step], table.numbers(name)[::step]
            parts.append(_scatter(path, name, x, y, shown))
    return "\n".join(parts)


def _histogram(name: str, values: Floats) -> str:
    values = values[np.isfinite(values)]
    if not len(values):
        return ""
    counts, edges = np.histogram(values, bins=30)
    x, y = scale(edges, LEFT, WIDTH - RIGHT), scale(np.array([0.0, max(1, counts.max())]), HEIGHT - BOTTOM, TOP)
    bars = "".join(
        f'<rect x="{x(a):.1f}" y="{y(n):.1f}" width="{max(0.5, x(b) - x(a) - 0.5):.1f}" '
        f'height="{y(0) - y(n):.1f}" fill="{COLOURS["done"]}"/>'
        for a, b, n in zip(edges[:-1].tolist(), edges[1:].tolist(), counts.tolist(), strict=True)
    )
    return _figure(name, "runs", edges, np.array([0.0, float(counts.max())]), bars)


def _rates(path: str, values: Floats, passed: Any, options: list[str] | None = None) -> str:
    """Pass rates with their intervals in bins of a parameter."""
    if not len(values):
        return ""
    distinct = np.unique(values)
    if len(distinct) <= BINS:
        groups = [(float(value), passed[values == value]) for value in distinct]
    else:
        edges = np.linspace(distinct[0], distinct[-1], BINS + 1)
        places = np.clip(np.digitize(values, edges) - 1, 0, BINS - 1)
        groups = [(float(edges[i] + edges[i + 1]) / 2, passed[places == i]) for i in range(BINS)]
    x, y = scale(values, LEFT + 8, WIDTH - RIGHT - 8), scale(np.array([0.0, 1.0]), HEIGHT - BOTTOM, TOP)
    marks = []
    for at, passes in groups:
        if len(passes):
            low, high = wilson(int(passes.sum()), len(passes))
            marks.append(
                f'<line x1="{x(at):.1f}" x2="{x(at):.1f}" y1="{y(low):.1f}" y2="{y(high):.1f}" stroke="#888"/>'
                f'<circle cx="{x(at):.1f}" cy="{y(float(passes.mean())):.1f}" r="3.5" fill="{COLOURS["pass"]}">'
                f"<title>{int(passes.sum())} of {len(passes)}</title></circle>"
            )
    return _figure(path, "pass rate", values, np.array([0.0, 1.0]), "".join(marks), options, inset=8)


def _crossed(table: Columns, down: str, across: str, passed: Any, judged: Any) -> str:
    """A table of the runs that passed, of all that were judged, for each pair of values of two parameters."""
    rows, columns = ([*dict.fromkeys(table[path].to_pylist())] for path in (down, across))
    lines = []
    for row in rows:
        cells = ""
        for column in columns:
            here = judged & table.where(down, row) & table.where(across, column)
            cells += f"<td>{int((passed & here).sum())} of {int(here.sum())}</td>"
        lines.append(f'<tr><td class="text">{_text(row)}</td>{cells}</tr>')
    head = "".join(f"<th>{escape(across)} {_text(column)}</th>" for column in columns)
    return f'<div class="wide"><table><tr><th class="text">{escape(down)}</th>{head}</tr>{"".join(lines)}</table></div>'


def _scatter(path: str, name: str, xs: Floats, ys: Floats, status: list[str]) -> str:
    is_finite = np.isfinite(xs) & np.isfinite(ys)
    if not is_finite.any():
        return ""
    x, y = scale(xs[is_finite], LEFT + 8, WIDTH - RIGHT - 8), scale(ys[is_finite], HEIGHT - BOTTOM, TOP)
    points = "".join(
        f'<circle cx="{x(a):.1f}" cy="{y(b):.1f}" r="2" fill="{COLOURS[status_of_run]}" fill-opacity="0.6"/>'
        for a, b, status_of_run, ok in zip(xs.tolist(), ys.tolist(), status, is_finite.tolist(), strict=True)
        if ok
    )
    return _figure(path, name, xs[is_finite], ys[is_finite], points, inset=8)


def _figure(
    label: str, vertical: str, xs: Floats, ys: Floats, content: str, options: list[str] | None = None, *, inset: int = 0
) -> str:
    """A plot with its axes."""
    x = scale(xs, LEFT + inset, WIDTH - RIGHT - inset)
    y = scale(ys, HEIGHT - BOTTOM, TOP)
    floor = HEIGHT - BOTTOM
    marks = [
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{floor}" y2="{floor}" stroke="#999"/>'
        f'<line x1="{LEFT}" x2="{LEFT}" y1="{TOP}" y2="{floor}" stroke="#999"/>'
    ]
    places = enumerate(options) if options else ((value, _label(value)) for value in x.ticks)
    marks += [text(x(float(place)), floor + 14, name, "middle") for place, name in places]
    marks += [text(LEFT - 4, y(value) + 4, _label(value), "end") for value in y.ticks]
    marks.append(text((LEFT + WIDTH) / 2, HEIGHT - 4, label, "middle"))
    name = escape(f"{vertical} by {label}")
    return (
        f'<figure><figcaption>{escape(vertical)}</figcaption><svg role="img" aria-label="{name}" width="{WIDTH}" '
        f'height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}">{content}{"".join(marks)}</svg></figure>'
    )


def _label(value: float) -> str:
    """Label of a tick of an axis: short, also where three digits would need an exponent."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def _text(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))
