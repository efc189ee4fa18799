"""Draws the drawings of programs over a rendered image, with the depth of its pixels, so that things hide them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
import resvg_py
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.png import decode_png
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.base.units import DEGREE
from autodrive.graphics.cameras.viewpoints import Viewpoint
from autodrive.protocol.messages import Drawing

PIECE = 6.0
"""Lines are divided into pieces about so long [pixels], each of which is hidden or not."""
MOST_PIECES = 200
"""Of a line between two points."""
TOLERANCE = 0.02
"""What is so far behind a surface is still drawn [m], and this share of its distance: it may lie on the surface."""
LEAST = 2.0
"""Least width of a line and diameter of a point [pixels]."""


class _Projection(NamedTuple):
    view: Viewpoint
    depth: NDArray[np.float32]

    def seen(self, points: Floats) -> Floats:
        """Points of the map in the optical frame [m], shape (n, 3)."""
        map_from_camera = np.array(rotation_from_quaternion(self.view.orientation)).reshape(3, 3)
        return (points - self.view.position) @ map_from_camera

    def pixels(self, seen: Floats) -> Floats:
        """Places in the image, shape (n, 2)."""
        height, width = self.depth.shape
        return seen[:, :2] / seen[:, 2:] * self.scale(1.0) + (0.5 * width, 0.5 * height)

    def is_shown(self, seen: Floats) -> NDArray[np.bool_]:
        """Whether nothing is in front of each point; points outside the image are."""
        height, width = self.depth.shape
        column, row = np.clip(self.pixels(seen), 0.0, (width - 1, height - 1)).astype(int).T
        return seen[:, 2] <= self.depth[row, column] * (1.0 + TOLERANCE) + TOLERANCE

    def scale(self, distance: float) -> float:
        """Pixels of a metre at that distance [m]."""
        return 0.5 * self.depth.shape[0] / (math.tan(0.5 * self.view.field_of_view_deg * DEGREE) * distance)


def with_drawings(
    rgba: NDArray[np.uint8], depth: NDArray[np.float32], drawings: Sequence[Drawing], view: Viewpoint
) -> NDArray[np.uint8]:
    """The image with the drawings; `depth` [m], shape (height, width), along the optical axis of `view`.

    Texts need a font of the machine.
    """
    projection = _Projection(view, depth)
    parts = [part for one in drawings for part in _parts(one, projection)]
    if not parts:
        return rgba
    height, width = depth.shape
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}">{"".join(parts)}</svg>'
    has_text = any(one.kind == "text" for one in drawings)
    layer = decode_png(bytes(resvg_py.svg_to_bytes(svg_string=svg, skip_system_fonts=not has_text)))
    share = layer[..., 3:].astype(np.float32) / 255.0
    out = rgba.copy()
    out[..., :3] = (share * layer[..., :3] + (1.0 - share) * rgba[..., :3]).round()
    return out


def _parts(drawing: Drawing, projection: _Projection) -> Iterator[str]:
    """SVG elements."""
    red, green, blue, opacity = drawing.color
    color = f"rgb({round(255 * red)},{round(255 * green)},{round(255 * blue)})"
    points = projection.seen(np.array(drawing.points, np.float64))
    near = projection.view.near
    if drawing.kind in ("points", "text"):
        ahead = points[points[:, 2] > near]
        for seen in ahead[projection.is_shown(ahead)] if len(ahead) else ():
            ((x, y),) = projection.pixels(seen[None])
            size = projection.scale(seen[2]) * drawing.size
            if drawing.kind == "points":
                yield (
                    f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{0.5 * max(size, LEAST):.2f}" fill="{color}" '
                    f'fill-opacity="{opacity:.3f}"/>'
                )
            else:
                yield (
                    f'<text x="{x:.2f}" y="{y:.2f}" font-size="{0.8 * size:.2f}" font-family="monospace" '
                    f'font-weight="600" text-anchor="middle" dominant-baseline="central" fill="{color}" '
                    f'fill-opacity="{opacity:.3f}">{escape(drawing.text)}</text>'
                )
        return
    step = 1 if drawing.kind == "path" else 2
    stroke = f'stroke="{color}" stroke-opacity="{opacity:.3f}" stroke-linecap="round"'
    for begin, end in zip(points[:-1:step], points[1::step], strict=False):
        for (x0, y0), (x1, y1), distance in _pieces(begin, end, projection, near):
            width = max(projection.scale(distance) * drawing.size, LEAST)
            yield f'<path d="M{x0:.2f} {y0:.2f}L{x1:.2f} {y1:.2f}" stroke-width="{width:.2f}" {stroke}/>'


def _pieces(begin: Floats, end: Floats, projection: _Projection, near: float) -> Iterator[tuple[Floats, Floats, float]]:
    """The pieces of a line that nothing hides: both ends in the image, and the distance [m]."""
    if max(begin[2], end[2]) <= near:
        return
    for one, other in ((begin, end), (end, begin)):  # the part in front of the camera
        if one[2] < near:
            share = (near - one[2]) / (other[2] - one[2])
            clipped = one + share * (other - one)
            begin, end = (clipped, other) if one is begin else (other, clipped)
    length = float(np.linalg.norm(np.subtract(*projection.pixels(np.array((begin, end))))))
    count = int(min(max(np.ceil(length / PIECE), 1), MOST_PIECES))
    # equal parts of the line in the image: 1 / z is linear in it
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    share = share * begin[2] / (share * begin[2] + (1.0 - share) * end[2])
    places = begin + share * (end - begin)
    middles = 0.5 * (places[:-1] + places[1:])
    pixels = projection.pixels(places)
    shown = projection.is_shown(middles)
    k = 0
    while k < count:
        if not shown[k]:
            k += 1
            continue
        first = k
        # a run whose width changes little is one piece
        while k < count and shown[k] and abs(places[k + 1, 2] / places[first, 2] - 1.0) < 0.1:
            k += 1
        k = max(k, first + 1)
        yield pixels[first], pixels[k], float(middles[first, 2])
