"""Shapes of the YAML files of modules and maps (rectangle, sector, polygon, line, arc), and their polygons."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
import shapely
from pydantic import AfterValidator, Field, model_validator
from shapely.geometry.base import BaseGeometry

from autodrive.base.arrays import Floats
from autodrive.base.elementary import atan, cos, sin
from autodrive.base.specs import Coordinate, Degrees, Spec
from autodrive.base.units import DEGREE

Extent: TypeAlias = Annotated[float, Field(ge=1e-3, le=1e3)]
"""Length of a piece of a map, from 1 mm to 1 km [m]."""
Point: TypeAlias = tuple[Coordinate, Coordinate]
Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""

MAX_CORNERS = 10_000
"""Most corners of all shapes of a list; each dash has four."""
CHORD_ERROR = 1e-4
"""Largest distance between a polygon and its arc [m]: a hundredth of the width of a painted line."""


class _Angled(Spec):
    start_deg: Degrees
    end_deg: Degrees

    @model_validator(mode="after")
    def _has_ordered_angles(self) -> Self:
        if not 0.0 < self.end_deg - self.start_deg <= 360.0:
            raise ValueError(f"end_deg must be greater than start_deg ({self.start_deg}), by 360 at most")
        return self


class _Dashed(Spec):
    width: Extent
    dash: Extent | None = None
    gap: Extent | None = None

    @model_validator(mode="after")
    def _has_dash_and_gap(self) -> Self:
        if (self.dash is None) != (self.gap is None):
            raise ValueError("dash and gap must be given together")
        return self


class Rectangle(Spec):
    """A rectangle around its centre; `length` along x and `width` along y before its rotation."""

    shape: Literal["rectangle"]
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    yaw_deg: Degrees = 0.0
    length: Extent
    width: Extent

    def geometry(self) -> BaseGeometry:
        """The polygon [m]."""
        return rectangle((self.x, self.y, self.yaw_deg * DEGREE), self.length, self.width)


class Sector(_Angled):
    """A sector of a ring or disc around x, y, counter-clockwise from `start_deg` to `end_deg`."""

    shape: Literal["sector"]
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    inner_radius: float = Field(default=0.0, ge=0.0, le=1e3)
    outer_radius: Extent

    @model_validator(mode="after")
    def _is_ordered(self) -> Self:
        if self.inner_radius >= self.outer_radius:
            raise ValueError(f"outer_radius must be greater than inner_radius ({self.inner_radius} m)")
        return self

    def geometry(self) -> BaseGeometry:
        """The polygon [m]."""
        angles = (self.start_deg * DEGREE, self.end_deg * DEGREE)
        return _ring_piece((self.x, self.y), self.inner_radius, self.outer_radius, *angles)


class Polygon(Spec):
    """A polygon through points [m]; the last point connects to the first."""

    shape: Literal["polygon"]
    points: Annotated[tuple[Point, ...], Field(min_length=3)]

    @model_validator(mode="after")
    def _is_simple(self) -> Polygon:
        if not is_simple(self.points):
            raise ValueError("the sides of a polygon must not cross or touch each other")
        return self

    def geometry(self) -> BaseGeometry:
        """The polygon [m]."""
        return shapely.Polygon(self.points)


class Line(_Dashed):
    """A painted line through points [m]; dashed if `dash` is given."""

    shape: Literal["line"]
    points: Annotated[tuple[Point, ...], Field(min_length=2)]

    def geometry(self) -> BaseGeometry:
        """The polygon, or one polygon for each dash [m]."""
        line = shapely.LineString(self.points)
        pieces = [_piece(line, a, b) for a, b in _painted(line.length, self.dash, self.gap)]
        return shapely.union_all(shapely.buffer(pieces, self.width / 2.0, cap_style="flat", join_style="mitre"))


class Arc(_Dashed, _Angled):
    """A painted line along an arc around x, y; dashed if `dash` is given. `radius`: of the centre of the line."""

    shape: Literal["arc"]
    x: Coordinate = 0.0
    y: Coordinate = 0.0
    radius: Extent

    @model_validator(mode="after")
    def _is_narrow(self) -> Self:
        if self.width >= 2.0 * self.radius:
            raise ValueError(f"width must be less than twice the radius ({self.radius} m)")
        return self

    def geometry(self) -> BaseGeometry:
        """The polygon, or one polygon for each dash [m]."""
        start = self.start_deg * DEGREE
        length = self.radius * (self.end_deg - self.start_deg) * DEGREE
        inner, outer = self.radius - self.width / 2.0, self.radius + self.width / 2.0
        return shapely.union_all(
            [
                _ring_piece((self.x, self.y), inner, outer, start + a / self.radius, start + b / self.radius)
                for a, b in _painted(length, self.dash, self.gap)
            ]
        )


Shape: TypeAlias = Annotated[Rectangle | Sector | Polygon | Line | Arc, Field(discriminator="shape")]


def _limited(shapes: tuple[Shape, ...]) -> tuple[Shape, ...]:
    count = sum(map(_corners, shapes))
    if count > MAX_CORNERS:
        raise ValueError(f"these shapes have {count} corners; they must have at most {MAX_CORNERS}")
    return shapes


Shapes: TypeAlias = Annotated[tuple[Shape, ...], AfterValidator(_limited)]


def is_simple(points: tuple[Point, ...]) -> bool:
    """Whether the sides of the polygon through these points neither cross nor touch each other."""
    return len(set(points)) >= 3 and bool(shapely.is_valid(shapely.Polygon(points)))


def arc(centre: Point, radius: float, start: float, end: float) -> Floats:
    """Points of an arc between two angles [rad], shape (n, 2); chords deviate by at most `CHORD_ERROR`."""
    angles = np.linspace(start, end, max(2, math.ceil(abs(end - start) / _chord_angle(radius)) + 1)).tolist()
    return np.array([(centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)) for angle in angles])


def rectangle(pose: Pose, length: float, width: float) -> shapely.Polygon:
    """The rectangle centred on a pose, `length` along its x axis and `width` along its y axis."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * (length / 2.0, width / 2.0)
    return shapely.Polygon(moved(corners, pose))


def moved(points: Floats, pose: Pose) -> Floats:
    """Transforms points from the frame of a pose to its parent frame, shape (n, 2)."""
    x, y, yaw = pose
    # right angles are exact, so that corners of adjacent modules are bit-identical
    c, s = round(cos(yaw), 15), round(sin(yaw), 15)
    return np.column_stack([x + c * points[:, 0] - s * points[:, 1], y + s * points[:, 0] + c * points[:, 1]])


def _ring_piece(centre: Point, inner: float, outer: float, start: float, end: float) -> shapely.Polygon:
    rim = arc(centre, outer, start, end)
    if inner == 0.0:
        return shapely.Polygon(np.vstack([rim, [centre]]))
    return shapely.Polygon(np.vstack([rim, arc(centre, inner, end, start)]))


def _corners(shape: Shape) -> int:
    """Number of corners of the polygons of a shape, at most 10 % too large."""
    match shape:
        case Rectangle():
            return 4
        case Polygon(points=points):
            return len(points)
        case Sector():
            return 2 * _chords(shape.outer_radius, shape.end_deg - shape.start_deg) + 3
        case Line(points=points):
            length = sum(map(math.dist, points, points[1:]))
            return 2 * len(points) + 4 * _dashes(length, shape.dash, shape.gap)
        case Arc():
            sweep = shape.end_deg - shape.start_deg
            length = shape.radius * sweep * DEGREE
            return 2 * _chords(shape.radius, sweep) + 4 * _dashes(length, shape.dash, shape.gap)


def _chords(radius: float, sweep_deg: float) -> int:
    return math.ceil(sweep_deg * DEGREE / _chord_angle(radius))


def _chord_angle(radius: float) -> float:
    """Angle [rad] of an arc from which its chord deviates by `CHORD_ERROR`: cos(angle / 2) = 1 - error / radius."""
    error = min(CHORD_ERROR / radius, 1.0)
    return 4.0 * atan(math.sqrt(error / (2.0 - error)))


def _dashes(length: float, dash: float | None, gap: float | None) -> int:
    """Number of painted parts along a line."""
    return 1 if dash is None or gap is None else max(1, round(length / (dash + gap)))


def _painted(length: float, dash: float | None, gap: float | None) -> list[tuple[float, float]]:
    """Start and end of each painted part along a line [m]: the whole line, or its dashes.

    The period is adjusted to a whole number of periods with half a gap at each end, so that the pattern continues
    across modules.
    """
    if dash is None or gap is None:
        return [(0.0, length)]
    periods = _dashes(length, dash, gap)
    period = length / periods
    painted = period * dash / (dash + gap)
    return [((i + 0.5) * period - painted / 2.0, (i + 0.5) * period + painted / 2.0) for i in range(periods)]


def _piece(line: shapely.LineString, start: float, end: float) -> shapely.LineString:
    """The part of a line between two distances along it."""
    corners = shapely.get_coordinates(line)
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    distances = np.concatenate([[start], at[(at > start) & (at < end)], [end]])
    return shapely.LineString(np.column_stack([np.interp(distances, at, corners[:, i]) for i in (0, 1)]))
