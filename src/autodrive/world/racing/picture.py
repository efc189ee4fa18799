"""A picture of a track with the lines that vehicles have driven, coloured by speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import resvg_py

from autodrive.base.arrays import Floats
from autodrive.base.svg_plot import line, svg, text
from autodrive.scenario.tracks import Track

WIDTH = 1600.0
"""Width of the picture [pixels]."""
BAR = 90.0
"""Height of the scale of colours below the track [pixels]."""
LEVELS = 24
"""Number of colours."""
COLOURS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])
"""Colours (RGB, 0 to 255) from slow to fast: viridis, which colour-blind people can read."""
JUMP = 1.0
"""A longer step is not a drive: the vehicle was placed elsewhere [m]."""


def driven_lines(track: Track, driven: Mapping[str, Floats]) -> bytes:
    """A PNG; `driven`: x, y [m] and speed [m/s] along the way of each vehicle, shape (n, 3)."""
    return bytes(resvg_py.svg_to_bytes(svg_string=driven_lines_svg(track, driven)))


def driven_lines_svg(track: Track, driven: Mapping[str, Floats]) -> str:
    """An SVG; `driven`: x, y [m] and speed [m/s] along the way of each vehicle, shape (n, 3)."""
    right, left = track.edges
    points = np.vstack([*track.walls, right, left])
    (x0, y0), (x1, y1) = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    scale = WIDTH / (x1 - x0)
    height = (y1 - y0) * scale

    def pixels(rows: Floats) -> Floats:
        return np.column_stack([(rows[:, 0] - x0) * scale, (y1 - rows[:, 1]) * scale])

    speeds = np.concatenate([np.zeros(1), *(rows[:, 2] for rows in driven.values())])
    fastest = max(1.0, float(np.ceil(speeds.max())))
    start = np.vstack([right[:1], left[:1]])
    edge, other_edge, *walls = (line(pixels(rows), is_closed=True) for rows in (right, left, *track.walls))
    size = WIDTH, round(height + BAR)
    return svg(
        *size,
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        f'<path d="{edge}{other_edge}" fill="#d9d9d6" fill-rule="evenodd"/>',
        *(f'<path d="{wall}" fill="none" stroke="#333" stroke-width="3"/>' for wall in walls),
        f'<path d="{line(pixels(start))}" stroke="#d00" stroke-width="4"/>',
        *(part for rows in driven.values() if len(rows) > 1 for part in _line(pixels(rows), rows, fastest)),
        *_scale(height, fastest),
        box=(0.0, 0.0, *size),
    )


def _line(pixels: Floats, rows: Floats, fastest: float) -> Iterator[str]:
    """The steps of each level of speed as one path."""
    speed = 0.5 * (rows[1:, 2] + rows[:-1, 2])
    level = np.minimum((LEVELS * speed / fastest).astype(int), LEVELS - 1)
    is_driven = np.hypot(*(rows[1:, :2] - rows[:-1, :2]).T) < JUMP
    for number in range(LEVELS):
        steps = np.flatnonzero(is_driven & (level == number))
        if len(steps):
            d = "".join(line(pixels[i : i + 2]) for i in steps)
            yield f'<path d="{d}" fill="none" stroke="{_colour(number)}" stroke-width="3" stroke-linecap="round"/>'


def _scale(top: float, fastest: float) -> Iterator[str]:
    """A bar of all colours, with the speeds at its ends and in its middle."""
    left, width = 0.25 * WIDTH, 0.5 * WIDTH
    for number in range(LEVELS):
        x = left + width * number / LEVELS
        box = f'x="{x:.1f}" y="{top + 10:.0f}" width="{width / LEVELS + 1:.1f}" height="22"'
        yield f'<rect {box} fill="{_colour(number)}"/>'
    for share in (0.0, 0.5, 1.0):
        font = 'font-size="26" font-family="sans-serif" fill="#222"'
        yield text(left + share * width, top + 62, f"{share * fastest:g} m/s", "middle", font)


def _colour(level: int) -> str:
    at = level / (LEVELS - 1) * (len(COLOURS) - 1)
    rgb = [np.interp(at, range(len(COLOURS)), COLOURS[:, channel]) for channel in range(3)]
    return "#" + "".join(f"{round(float(value)):02x}" for value in rgb)
