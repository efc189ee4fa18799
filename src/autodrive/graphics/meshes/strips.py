"""Builds the strips on the ground of a map: its painted lines, and the shade at the feet of kerbs and solids."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from autodrive.graphics.assets.asset import STRIP, Strips

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats

MOST_MITRE = 2.2
"""A strip has two long sides; where it bends, its sides are at most this much farther apart than elsewhere."""
TOLERANCE = 2e-4
"""Largest distance of the middle of a strip from that of its polygon [m]."""
ENDLESS = 1e4
"""Half the length of a strip whose ends are not drawn [m]."""
OFF_AREA = 0.03
"""Largest difference between the area of a strip and that of its polygon, as a share."""
CORNER = 0.6
"""A polygon turns more than this at a corner, and less at the points of an arc [rad]."""
OFF_ROAD = 0.02
"""Share of a painted polygon that may lie beside the road."""


@dataclass(frozen=True, eq=False)
class StripLine:
    """The middle of a strip and what it shows."""

    right: Floats
    """Points of its right side, shape (n, 2)."""
    left: Floats
    """The points of its left side beside them."""
    width: float
    """[m]; at a bend the points are farther apart."""
    is_endless: bool
    right_amounts: tuple[float, float]
    """Amounts of paint and of shade at the right side, 0 to 1."""
    left_amounts: tuple[float, float]

    @functools.cached_property
    def vertices(self) -> NDArray[np.void]:
        """The vertices of the strip, right and left, shape (n, 2), dtype `STRIP`."""
        n, half = len(self.left), 0.5 * self.width
        across = (self.left - self.right) / self.width
        middle = 0.5 * (self.left + self.right)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1))])
        ends = np.zeros((n, 2))
        ends[0], ends[-1] = middle[0] - middle[1], middle[-1] - middle[-2]
        ends[[0, -1]] *= (not self.is_endless) / np.linalg.norm(ends[[0, -1]], axis=1)[:, None]
        own = np.zeros((n, 2), STRIP)
        for side, (points, sign, amounts) in enumerate(
            ((self.right, -1.0, self.right_amounts), (self.left, 1.0, self.left_amounts))
        ):
            own["place"][:, side], own["amounts"][:, side] = points, amounts
            own["outward"][:, side, :2], own["outward"][:, side, 2:] = sign * across, ends
            own["strip"][:, side, 0], own["strip"][:, side, 1] = sign * half, half
        own["strip"][..., 2] = (along - 0.5 * along[-1])[:, None]
        own["strip"][..., 3] = ENDLESS if self.is_endless else 0.5 * along[-1]
        return own


def painted_lines(polygons: Iterable[shapely.Polygon], road: BaseGeometry) -> list[StripLine | None]:
    """A strip for each polygon that is a line on that road, None for the others."""
    shapely.prepare(road)

    def is_on_road(polygon: shapely.Polygon) -> bool:
        return bool(shapely.covers(road, polygon)) or shapely.difference(polygon, road).area <= OFF_ROAD * polygon.area

    lines = ((polygon, _line(shapely.to_wkb(polygon))) for polygon in polygons)
    return [line if line is not None and is_on_road(polygon) else None for polygon, line in lines]


def shade_along(points: Floats, width: float, shade: float) -> StripLine:
    """Shade on the right side of a line: `shade` at the line and nothing at that distance.

    A closed line ends with its first point.
    """
    is_closed = bool(np.allclose(points[0], points[-1]))
    step = np.diff(points, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    before = np.vstack([step[-1:] if is_closed else step[:1], step])
    after = np.vstack([step, step[:1] if is_closed else step[-1:]])
    along = before + after
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    aside = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(np.sum(along * after, axis=1), 0.5)[:, None]
    return StripLine(points + width * aside, points, width, is_closed, (0.0, 0.0), (0.0, shade))


def strips(lines: Iterable[StripLine]) -> Strips | None:
    """All lines in one mesh; none if there are no lines."""
    vertices = [line.vertices for line in lines]
    if not vertices:
        return None
    is_last = np.zeros(sum(map(len, vertices)), bool)
    is_last[np.cumsum([len(own) for own in vertices]) - 1] = True
    triangles = 2 * np.flatnonzero(~is_last)[:, None] + np.array([0, 2, 3, 0, 3, 1])
    return Strips(np.concatenate(vertices).ravel(), triangles.reshape(-1, 3).astype(np.uint32))


@functools.lru_cache(maxsize=20_000)
def _line(wkb: bytes) -> StripLine | None:
    """The strip that a polygon (WKB) is, if it has two long sides beside each other; an edit changes few of them."""
    polygon: Any = shapely.from_wkb(wkb)
    ring = shapely.get_coordinates(shapely.get_exterior_ring(orient(polygon)))[:-1]
    if len(ring) < 4 or shapely.get_num_interior_rings(polygon):
        return None
    right, left = _sides_of_arc(ring) or _sides_of_bent_line(ring) or (ring[:2], ring[:2])
    apart = np.linalg.norm(left - right, axis=1)
    middle = 0.5 * (right + left)
    length = float(np.linalg.norm(np.diff(middle, axis=0), axis=1).sum())
    if apart.max() > MOST_MITRE * apart.min() or abs(apart.min() * length - polygon.area) > OFF_AREA * polygon.area:
        return None
    kept = shapely.get_coordinates(shapely.simplify(shapely.LineString(middle), TOLERANCE))
    is_kept = np.isin(middle.view(np.complex128)[:, 0], kept.view(np.complex128)[:, 0])
    return StripLine(right[is_kept], left[is_kept], float(apart.min()), False, (1.0, 0.0), (1.0, 0.0))


def _sides_of_arc(ring: Floats) -> tuple[Floats, Floats] | None:
    """The longer sides of a polygon with four corners, whose other points are on arcs, at points beside each other."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], np.sum(before * after, axis=1))
    corners = np.flatnonzero(turn > CORNER)
    if len(corners) != 4 or (turn < -CORNER).any():
        return None
    closed = np.vstack([ring, ring])
    sides = [
        closed[a : (b if b > a else b + len(ring)) + 1] for a, b in zip(corners, np.roll(corners, -1), strict=True)
    ]
    first = max((0, 1), key=lambda k: _length(sides[k])[-1] + _length(sides[k + 2])[-1])
    right, left = sides[first], sides[first + 2][::-1]
    shares = [_length(side) / _length(side)[-1] for side in (right, left)]
    at = np.union1d(*shares)
    at = at[np.concatenate([[True], np.diff(at) > 1e-9])]
    return _points_at(right, shares[0], at), _points_at(left, shares[1], at)


def _sides_of_bent_line(ring: Floats) -> tuple[Floats, Floats] | None:
    """The sides of a line with mitred bends, which have equally many points."""
    n, odd = divmod(len(ring), 2)
    if odd:
        return None
    splits = [np.roll(ring, -k, axis=0) for k in range(n)]
    pairs = ((split[:n], split[n:][::-1]) for split in splits)
    return min(pairs, key=lambda pair: np.linalg.norm(pair[0] - pair[1], axis=1).max())


def _length(side: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])


def _points_at(side: Floats, shares: Floats, at: Floats) -> Floats:
    return np.column_stack([np.interp(at, shares, side[:, axis]) for axis in range(2)])
