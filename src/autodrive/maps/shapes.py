"""The few shapes in which modules and maps are described, and the polygons that they stand for."""

from __future__ import annotations

import math
from typing import Annotated, Literal, TypeAlias, TypeVar

import numpy as np
import shapely
from pydantic import Field, model_validator
from shapely.geometry.base import BaseGeometry

from autodrive.descriptions import Spec
from autodrive.state import Floats
from autodrive.units import DEGREE

Positive: TypeAlias = Annotated[float, Field(gt=0.0)]
NotNegative: TypeAlias = Annotated[float, Field(ge=0.0)]
Point: TypeAlias = tuple[float, float]
Pose: TypeAlias = tuple[float, float, float]
"""x [m], y [m], yaw [rad]."""

CHORD_ERROR = 1e-4
"""How far a polygon may be from the arc that it stands for [m]: a hundredth of the width of a painted line."""


class Rectangle(Spec):
    """A rectangle around its centre; `length` along x and `width` along y before it turns."""

    shape: Literal["rectangle"] = "rectangle"
    x: float = 0.0
    y: float = 0.0
    yaw_deg: float = 0.0
    length: Positive
    width: Positive

    def geometry(self) -> BaseGeometry:
        """The polygon, shapely, in metres."""
        return rectangle((self.x, self.y, self.yaw_deg * DEGREE), self.length, self.width)


class Sector(Spec):
    """A piece of a ring (or of a disc) around x, y, from one angle to a greater one, left turning."""

    shape: Literal["sector"]
    x: float = 0.0
    y: float = 0.0
    inner_radius: NotNegative = 0.0
    outer_radius: Positive
    start_deg: float
    end_deg: float

    @model_validator(mode="after")
    def _is_ordered(self) -> Sector:
        if self.inner_radius >= self.outer_radius:
            raise ValueError(f"outer_radius must be greater than inner_radius ({self.inner_radius} m)")
        return _with_ordered_angles(self)

    def geometry(self) -> BaseGeometry:
        """The polygon, shapely, in metres."""
        angles = (self.start_deg * DEGREE, self.end_deg * DEGREE)
        return _ring_piece((self.x, self.y), self.inner_radius, self.outer_radius, *angles)


class Polygon(Spec):
    """A polygon through points [m]; the last is joined to the first."""

    shape: Literal["polygon"]
    points: Annotated[tuple[Point, ...], Field(min_length=3)]

    @model_validator(mode="after")
    def _is_simple(self) -> Polygon:
        if not shapely.Polygon(self.points).is_valid:
            raise ValueError("the sides of a polygon must not cross or touch each other")
        return self

    def geometry(self) -> BaseGeometry:
        """The polygon, shapely, in metres."""
        return shapely.Polygon(self.points)


class Line(Spec):
    """A painted line of some width through points [m]; dashed when `dash` is given."""

    shape: Literal["line"]
    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    width: Positive
    dash: Positive | None = None
    gap: Positive | None = None

    @model_validator(mode="after")
    def _has_both(self) -> Line:
        return _with_dash_and_gap(self)

    def geometry(self) -> BaseGeometry:
        """The polygon, or one for each dash, shapely, in metres."""
        line = shapely.LineString(self.points)
        pieces = [_piece(line, a, b) for a, b in _painted(line.length, self.dash, self.gap)]
        return shapely.union_all(shapely.buffer(pieces, self.width / 2.0, cap_style="flat", join_style="mitre"))


class Arc(Spec):
    """A painted line along an arc around x, y; dashed when `dash` is given. `radius` is that of the line's middle."""

    shape: Literal["arc"]
    x: float = 0.0
    y: float = 0.0
    radius: Positive
    start_deg: float
    end_deg: float
    width: Positive
    dash: Positive | None = None
    gap: Positive | None = None

    @model_validator(mode="after")
    def _is_ordered(self) -> Arc:
        if self.width >= 2.0 * self.radius:
            raise ValueError(f"width must be less than twice the radius ({self.radius} m)")
        return _with_dash_and_gap(_with_ordered_angles(self))

    def geometry(self) -> BaseGeometry:
        """The polygon, or one for each dash, shapely, in metres."""
        start = self.start_deg * DEGREE
        length = self.radius * (self.end_deg - self.start_deg) * DEGREE
        inner, outer = self.radius - self.width / 2.0, self.radius + self.width / 2.0
        return shapely.union_all(
            [
                _ring_piece((self.x, self.y), inner, outer, start + a / self.radius, start + b / self.radius)
                for a, b in _painted(length, self.dash, self.gap)
            ]
        )


_Angled = TypeVar("_Angled", Sector, Arc)
_Dashed = TypeVar("_Dashed", Line, Arc)
Shape: TypeAlias = Annotated[Rectangle | Sector | Polygon | Line | Arc, Field(discriminator="shape")]


def arc(centre: Point, radius: float, start: float, end: float) -> Floats:
    """Points of an arc between two angles [rad], no chord further than `CHORD_ERROR` from it, shape (n, 2)."""
    step = 2.0 * math.acos(1.0 - min(CHORD_ERROR / radius, 1.0))
    angle = np.linspace(start, end, max(2, math.ceil(abs(end - start) / step) + 1))
    return np.column_stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)])


def rectangle(pose: Pose, length: float, width: float) -> shapely.Polygon:
    """The rectangle around that pose, `length` along its x and `width` along its y."""
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * (length / 2.0, width / 2.0)
    return shapely.Polygon(moved(corners, pose))


def moved(points: Floats, pose: Pose) -> Floats:
    """Points given in the axes of a pose, in the axes in which that pose is given; shape (n, 2)."""
    x, y, yaw = pose
    # right angles are exact, so that modules that touch share their corners to the last bit
    c, s = round(math.cos(yaw), 15), round(math.sin(yaw), 15)
    return np.column_stack([x + c * points[:, 0] - s * points[:, 1], y + s * points[:, 0] + c * points[:, 1]])


def _ring_piece(centre: Point, inner: float, outer: float, start: float, end: float) -> shapely.Polygon:
    rim = arc(centre, outer, start, end)
    if inner == 0.0:
        return shapely.Polygon(np.vstack([rim, [centre]]))
    return shapely.Polygon(np.vstack([rim, arc(centre, inner, end, start)]))


def _painted(length: float, dash: float | None, gap: float | None) -> list[tuple[float, float]]:
    """From where to where a line is painted [m]: all of it, or dashes.

    Dashes are stretched to a whole number of periods with half a gap at each end, so that lines of modules that meet
    go on as one.
    """
    if dash is None or gap is None:
        return [(0.0, length)]
    periods = max(1, round(length / (dash + gap)))
    period = length / periods
    painted = period * dash / (dash + gap)
    return [((i + 0.5) * period - painted / 2.0, (i + 0.5) * period + painted / 2.0) for i in range(periods)]


def _piece(line: shapely.LineString, start: float, end: float) -> shapely.LineString:
    """The part of a line between two distances along it."""
    corners = shapely.get_coordinates(line)
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    distances = np.concatenate([[start], at[(at > start) & (at < end)], [end]])
    return shapely.LineString(np.column_stack([np.interp(distances, at, corners[:, i]) for i in (0, 1)]))


def _with_ordered_angles(shape: _Angled) -> _Angled:
    if not 0.0 < shape.end_deg - shape.start_deg <= 360.0:
        raise ValueError(f"end_deg must be greater than start_deg ({shape.start_deg}), by 360 at most")
    return shape


def _with_dash_and_gap(shape: _Dashed) -> _Dashed:
    if (shape.dash is None) != (shape.gap is None):
        raise ValueError("dash and gap come together")
    return shape
