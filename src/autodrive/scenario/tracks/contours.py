"""Contours of a grey image (marching squares), and the areas inside of them."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError

MAX_BORDER, MAX_LINES = 300_000, 10_000
"""Most pixels at borders, and most lines, of an image. With more, it is noise or a pattern, and would take minutes."""


def contours(values: Floats, level: float) -> list[Floats]:
    """Closed lines between the pixels above a level and the others, in pixels, shape (n, 2) each.

    The centre of the lower left pixel is (0.5, 0.5); y points up. Outside of the image everything is above the level.
    The pixels that are not above the level are on the left of a line. Raises `SpecError` if they are too many.
    """
    outside = max(2.0 * level, float(values.max())) + 1e-9
    high = np.pad(values > level, 1, constant_values=True)
    # each square has its corners at the centres of four pixels: upper left, upper right, lower right, lower left
    corners = high.view(np.uint8)
    code = corners[:-1, :-1] * 8 + corners[:-1, 1:] * 4 + corners[1:, 1:] * 2 + corners[1:, :-1]
    rows, columns = np.nonzero((code > 0) & (code < 15))
    _check(len(rows), MAX_BORDER, "pixels at borders between free and occupied areas")
    following: dict[tuple[int, int, int], tuple[int, int, int]] = {}
    for row, column, kind in zip(rows.tolist(), columns.tolist(), code[rows, columns].tolist(), strict=True):
        # the sides of a square, as (row, column, 0 for horizontal or 1 for vertical) of their upper left corner
        sides = ((row, column, 0), (row, column + 1, 1), (row + 1, column, 0), (row, column, 1))
        for start, end in _LINES[kind]:
            following[sides[start]] = sides[end]
    lines: list[list[tuple[int, int, int]]] = []
    for first in list(following):  # each time the first of what is left would look at all that is gone
        line, at = [], first
        while at in following:
            line.append(at)
            at = following.pop(at)
        if line:
            lines.append(line)
    _check(len(lines), MAX_LINES, "separate free or occupied areas")
    return [_crossings(values, outside, level, np.array(line)) for line in lines]


def _check(count: int, most: int, plural: str) -> None:
    if count > most:
        text = f"the image has {count} {plural}; the map of a track has at most {most}: remove the noise from the image"
        raise SpecError([text])


_TOP, _RIGHT, _BOTTOM, _LEFT = range(4)
_LINES: dict[int, tuple[tuple[int, int], ...]] = {
    1: ((_LEFT, _BOTTOM),),
    2: ((_BOTTOM, _RIGHT),),
    3: ((_LEFT, _RIGHT),),
    4: ((_RIGHT, _TOP),),
    5: ((_LEFT, _TOP), (_RIGHT, _BOTTOM)),
    6: ((_BOTTOM, _TOP),),
    7: ((_LEFT, _TOP),),
    8: ((_TOP, _LEFT),),
    9: ((_TOP, _BOTTOM),),
    10: ((_TOP, _RIGHT), (_BOTTOM, _LEFT)),
    11: ((_TOP, _RIGHT),),
    12: ((_RIGHT, _LEFT),),
    13: ((_RIGHT, _BOTTOM),),
    14: ((_BOTTOM, _LEFT),),
}
"""Lines from side to side of a square, by the set of its high corners; high corners that touch diagonally are
joined."""


def _crossings(values: Floats, outside: float, level: float, sides: NDArray[np.int64]) -> Floats:
    """Where sides of squares have the level, in pixels, shape (n, 2); y points up. `outside`: beyond the image."""
    height, width = values.shape
    rows, columns, is_vertical = sides.T

    def at(i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
        is_inside = (i > 0) & (i <= height) & (j > 0) & (j <= width)
        at_corner = values[np.clip(i, 1, height) - 1, np.clip(j, 1, width) - 1]
        return np.where(is_inside, at_corner.astype(np.float64), outside)

    a, b = at(rows, columns), at(rows + is_vertical, columns + 1 - is_vertical)
    share = np.clip((level - a) / (b - a), 0.05, 0.95)
    x, y = columns - 0.5, rows - 0.5
    return np.stack([x + np.where(is_vertical, 0.0, share), height - (y + np.where(is_vertical, share, 0.0))], axis=1)


def areas_of(lines: list[Floats]) -> list[shapely.Polygon]:
    """The areas between contours: each outer line with the inner lines that are directly inside of it."""
    outer = sorted((line for line in lines if _area(line) > 0.0), key=_area)
    inner = [line for line in lines if _area(line) < 0.0]
    tree = shapely.STRtree([shapely.Polygon(line) for line in outer])
    places = shapely.points(np.array([line[0] for line in inner]).reshape(-1, 2))
    owners: dict[int, int] = {}
    for hole, owner in tree.query(places, predicate="within").T.tolist():
        owners[hole] = min(owner, owners.get(hole, owner))  # the smallest area
    holes: list[list[Floats]] = [[] for _ in outer]
    for hole, owner in sorted(owners.items()):
        holes[owner].append(inner[hole])
    return [shapely.Polygon(line, own) for line, own in zip(outer, holes, strict=True)]


def _area(line: Floats) -> float:
    """Area inside a closed line, positive if it is counter-clockwise."""
    x, y = line[:, 0], line[:, 1]
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) / 2.0
