"""The parity report: one HTML page with tables and plots that needs nothing else, and its summary as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np

from autodrive.base.arrays import Integers
from autodrive.base.svg_plot import HEIGHT, Curves, panel, panels_over_time
from autodrive.base.units import DEGREE
from autodrive.base.version import __version__
from autodrive.experiments.campaigns.report import STYLE
from autodrive.experiments.deployment.parity import Parity

MOMENTS = 0.5, 1.0, 2.0
"""Times after a place of the log that the table lists [s]."""
EXCERPT = 20.0
"""Length of the plots of commands [s]: from the middle of the longest part of the drive."""
LIGHT = "figure { background: white; overflow-x: auto; display: block } p { max-width: 50rem }"


class TableRow(NamedTuple):
    """A line of a table: a name, and values as texts."""

    name: str
    values: Sequence[str]


def page(parity: Parity, title: str) -> str:
    """The HTML text."""
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{STYLE}{LIGHT}</style></head><body><h1>{escape(title)}</h1>",
    ]
    for heading, text, rows, plots in sections(parity):
        head, *lines = rows
        table = "".join(_cells(line, "td") for line in lines)
        parts.append(f"<h2>{escape(heading)}</h2><p>{escape(text)}</p><table>{_cells(head, 'th')}{table}</table>")
        if plots:
            panels = [panel(curves, k * HEIGHT, curves.times[0], curves.times[-1]) for k, curves in enumerate(plots)]
            parts.append(f"<figure>{panels_over_time(panels, len(panels) * HEIGHT)}</figure>")
    return "\n".join([*parts, f"<p>AutoDRIVE Simulator {__version__}</p></body></html>\n"])


def summary(parity: Parity) -> str:
    """The tables as text."""
    lines: list[str] = []
    for heading, _, rows, _ in sections(parity):
        lines += ["", heading, *(f"  {row.name:44}{''.join(f'{value:>14}' for value in row.values)}" for row in rows)]
    return "\n".join(lines[1:])


def sections(parity: Parity) -> list[tuple[str, str, list[TableRow], list[Curves]]]:
    """Heading, text, table (its first row is the head), and plots of each section."""
    return [
        _drive(parity),
        *([_scan(parity)] if parity.residuals is not None else []),
        _commands(parity),
        *([_motion(parity)] if parity.places is not None else []),
        _latency(parity),
    ]


def _drive(parity: Parity) -> tuple[str, str, list[TableRow], list[Curves]]:
    log = parity.log
    stops = [stop for stop, before in zip(log.stops, ("", *log.stops), strict=False) if stop and stop != before]
    speed = log.columns["wheel_speed"][parity.used]
    way = float(np.abs(log.columns["wheel_speed"][1:] * np.diff(log.time)).sum())
    rows = [
        TableRow("", ["value"]),
        TableRow("time [s]", [f"{log.time[-1] - log.time[0]:.1f}"]),
        TableRow("rows in which the car drove", [f"{len(parity.used)} of {len(log.time)}"]),
        TableRow("distance [m]", [f"{way:.1f}"]),
        TableRow("speed: median, greatest [m/s]", [f"{np.median(speed):.2f}", f"{speed.max():.2f}"]),
        *(TableRow(f"stops: {reason}", [str(stops.count(reason))]) for reason in sorted(set(stops))),
    ]
    return "The drive", "What the log of the car contains.", rows, []


def _scan(parity: Parity) -> tuple[str, str, list[TableRow], list[Curves]]:
    assert parity.residuals is not None
    residuals, settings = parity.residuals, parity.settings
    known = residuals[np.isfinite(residuals)]
    rows = [TableRow("", ["residual [m]"])]
    text = (
        "The range of each sector in the log, less the range from the same pose in the map, without noise. The "
        "shortest of several ranges with noise is less than their mean, by about two standard deviations. Another "
        "median that is not zero in all directions is an error of the map or of the scanner; one that changes its "
        "sign from the left to the right is an error of the pose or of the mount of the scanner."
    )
    if len(known):
        low, median, high = np.percentile(known, [5, 50, 95])
        rows += [
            TableRow("median", [f"{median:+.3f}"]),
            TableRow("5 % and 95 %", [f"{low:+.3f}", f"{high:+.3f}"]),
            TableRow("sectors within 5 cm", [f"{100 * np.mean(abs(known) < 0.05):.1f} %"]),
        ]
    thirds = np.array_split(np.arange(settings.sectors), 6)
    for sectors in thirds:
        values = residuals[:, sectors]
        values = values[np.isfinite(values)]
        first, last = (settings.first_degree + settings.sector_degrees * k for k in (sectors[0], sectors[-1] + 1))
        middle = f"{np.median(values):+.3f}" if len(values) else "-"
        rows.append(TableRow(f"median from {first:.0f} to {last:.0f} degrees", [middle]))
    place = _middle(parity)
    shown = np.full(len(place), np.nan)
    typical = np.abs(residuals[place])
    seen = np.isfinite(typical).any(axis=1)
    shown[seen] = np.nanmedian(typical[seen], axis=1)
    curves = Curves(
        "median of the magnitude over the sectors [m]", parity.log.time[parity.used[place]], [shown], ["residual"]
    )
    return "The scan against the map", text, rows, [curves]


def _middle(parity: Parity) -> Integers:
    """Numbers of the used rows that plots show."""
    time = parity.log.time[parity.used]
    breaks = np.flatnonzero(np.diff(time) > 3.0 * parity.settings.period) + 1
    longest = max(np.split(np.arange(len(time)), breaks), key=len)
    middle = 0.5 * (time[longest[0]] + time[longest[-1]])
    return longest[np.abs(time[longest] - middle) <= 0.5 * EXCERPT]


def _commands(parity: Parity) -> tuple[str, str, list[TableRow], list[Curves]]:
    columns, used, settings = parity.log.columns, parity.used, parity.settings
    limit = settings.steering_limit
    car = np.column_stack([
        np.minimum(columns["policy_throttle"][used] * settings.full_speed, columns["speed_cap"][used]),
        np.clip(columns["policy_steering"][used] * settings.full_angle, -limit, limit),
    ])  # fmt: skip
    told = np.column_stack([columns["command_speed"][used], columns["command_angle"][used]])
    others = {"with the car's scan": parity.on_scan, "after the safety layer": told}
    if parity.on_map is not None:
        others["with the scan of the map"] = parity.on_map
    rows = [TableRow("difference from the policy on the car: rms", ["speed [m/s]", "steering [deg]"])]
    for name, commands in others.items():
        rms = np.sqrt(np.mean((commands - car) ** 2, axis=0))
        rows.append(TableRow(name, [f"{rms[0]:.4f}", f"{rms[1] / DEGREE:.3f}"]))
    place = _middle(parity)
    time = parity.log.time[used[place]]
    plots = [
        Curves(
            title,
            time,
            [factor * values[place, k] for values in (car, *others.values())],
            ["policy on the car", *others],
        )
        for k, (title, factor) in enumerate((("speed [m/s]", 1.0), ("steering [deg]", 1.0 / DEGREE)))
    ]
    text = (
        "What the policy commanded on the car, beside what it commands with the same readings here, and with the scan "
        "of the map instead of that of the car. The first difference must be zero but for rounding if it is the same "
        "policy; the last one is what the difference of the scans does."
    )
    return "The commands", text, rows, plots


def _motion(parity: Parity) -> tuple[str, str, list[TableRow], list[Curves]]:
    places = parity.places
    assert places is not None
    real = parity.log.columns["wheel_speed"][places.rows]
    faster = places.speed - real
    rows = [
        TableRow(
            "after", ["line: median", "95 %", "speed: median", "median size", "95 %"]
        )
    ]  # fmt: skip
    for moment in MOMENTS:
        step = min(round(moment / parity.settings.period), places.speed.shape[1] - 1)
        line, speed = np.abs(places.across[:, step]), faster[:, step]
        numbers = [np.median(line), np.percentile(line, 95), np.median(speed)]
        numbers += [np.median(abs(speed)), np.percentile(abs(speed), 95)]
        texts = [f"{100 * numbers[0]:.1f} cm", f"{100 * numbers[1]:.1f} cm", *(f"{n:+.2f} m/s" for n in numbers[2:])]
        rows.append(TableRow(f"{moment:g} s", texts))
    rows.append(TableRow("places of the log; touched a wall", [str(len(places.rows)), str(places.touched)]))
    seconds = parity.settings.period * np.arange(places.speed.shape[1])
    low, middle, high = np.percentile(100.0 * places.across, [5, 50, 95], axis=0)
    slow, same, fast = np.percentile(faster, [5, 50, 95], axis=0)
    names = ["5 %", "median", "95 %"]
    plots = [
        Curves("simulated car to the left of the path of the real one [cm]", seconds, [low, middle, high], names),
        Curves("simulated car faster than the real one [m/s]", seconds, [slow, same, fast], names),
    ]
    text = (
        "Policy and vehicle drive in the simulator from places of the log, one second apart, with the speed and the "
        "yaw rate of the car there, without the safety layer. The line is the distance from the path of the real car."
    )
    return "The motion", text, rows, plots


def _latency(parity: Parity) -> tuple[str, str, list[TableRow], list[Curves]]:
    columns, used = parity.log.columns, parity.used
    rows = [TableRow("time [ms]", ["median", "95 %", "greatest"])]
    for name, column in (("from the stamp of a scan to the command", "scan_age"), ("of computing", "compute")):
        values = columns[column][used]
        values = values[np.isfinite(values)]
        rows.append(TableRow(name, [f"{1e3 * number:.1f}" for number in np.percentile(values, [50, 95, 100])]))
    for name, delay in parity.delays.items():
        shown = "-" if math.isnan(delay) else f"{1e3 * delay:.0f}"
        rows.append(TableRow(f"from a steering command to the yaw rate, {name}", [shown]))
    text = (
        "The time from a command to the yaw rate is that with the greatest correlation; it has the dead time of the "
        "car, its servo and its yaw. If it is longer for the car than for the simulated vehicle, the vehicle needs "
        "that dead time."
    )
    return "Latency", text, rows, []


def _cells(row: TableRow, kind: str) -> str:
    cells = "".join(f"<{kind}>{escape(value)}</{kind}>" for value in row.values)
    return f'<tr><{kind} class="text">{escape(row.name)}</{kind}>{cells}</tr>'
