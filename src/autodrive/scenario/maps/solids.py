"""Solid objects of a map: static walls and blocks, and boxes that can be pushed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from pydantic import Field

from autodrive.base.elementary import atan2, cos, sin
from autodrive.base.specs import Coordinate, Degrees, Length, Name, Spec
from autodrive.base.transforms import (
    Quaternion,
    compose,
    quaternion_from_euler,
    quaternion_from_yaw,
    rotation_from_quaternion,
)
from autodrive.base.units import DEGREE
from autodrive.physics.grid import fixed_grid
from autodrive.physics.model import BOX, ShapeTable
from autodrive.scenario.maps.shapes import Point, is_simple, rectangle


class WallSpec(Spec):
    """A wall along a line through points [m]."""

    name: Name = "wall"
    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    """Centre line of the wall."""
    is_closed: bool = False
    """True: the wall continues from the last point to the first."""
    thickness: Length = 0.1
    height: Length

    @property
    def enclosed(self) -> shapely.Polygon:
        """The ground inside a closed wall; empty if the wall is open or crosses itself."""
        return shapely.Polygon(self.points if self.is_closed and is_simple(self.points) else None)


class BlockSpec(Spec):
    """A static box on the ground, such as a building; x, y [m] is its centre."""

    name: Name = ""
    x: Coordinate
    y: Coordinate
    yaw_deg: Degrees = 0.0
    length: Length
    width: Length
    height: Length


@dataclass(frozen=True)
class StaticShape:
    """A solid shape that never moves."""

    name: str
    object: str
    """Name of the wall, block, sign or light of the file of which it is a part."""
    kind: int
    """`BOX` or `CYLINDER` of `autodrive.physics.model`."""
    size: tuple[float, float, float]
    """Box: half sizes; cylinder: radius, half height, 0 [m]; as in `model.ShapeTable`."""
    position: tuple[float, float, float]
    """Centre in the map frame [m]."""
    yaw: float
    """[rad]."""
    material: str
    """'wall', 'duct', 'block', 'post', 'plate' or 'housing'."""
    tilt: float = 0.0
    """Angle by which a box is turned about its x axis [rad], before its yaw."""

    @property
    def orientation(self) -> Quaternion:
        """Map from shape."""
        return compose(quaternion_from_yaw(self.yaw), quaternion_from_euler(self.tilt, 0.0, 0.0))

    @property
    def plan(self) -> shapely.Polygon:
        """The outline seen from above; for a cylinder the square around it."""
        length, width, _ = self._half_extents
        return rectangle((*self.position[:2], self.yaw), 2.0 * length, 2.0 * width)

    @property
    def span(self) -> tuple[float, float]:
        """Heights of the bottom and of the top [m]."""
        half = self._half_extents[2]
        return self.position[2] - half, self.position[2] + half

    @property
    def _half_extents(self) -> tuple[float, float, float]:
        """Along x and y of its pose and along z [m]."""
        length, width, height = self.size
        if self.kind != BOX:
            return length, length, width
        c, s = abs(cos(self.tilt)), abs(sin(self.tilt))
        return length, c * width + s * height, s * width + c * height


@dataclass(frozen=True)
class BoxPlacement:
    """A box that can be pushed."""

    name: str
    size: tuple[float, float, float]
    """Length, width, height [m] (full sizes)."""
    mass: float
    """[kg]."""
    position: tuple[float, float, float]
    """Centre [m]."""
    yaw: float
    """[rad]."""

    @property
    def plan(self) -> shapely.Polygon:
        """The outline seen from above."""
        return rectangle((*self.position[:2], self.yaw), *self.size[:2])

    @property
    def span(self) -> tuple[float, float]:
        """Heights of the bottom and of the top [m]."""
        return self.position[2] - self.size[2] / 2.0, self.position[2] + self.size[2] / 2.0

    def standing(self, x: float, y: float, yaw: float) -> tuple[float, ...]:
        """Pose of the box on the ground at x, y [m] with heading yaw [rad]: position, quaternion wxyz."""
        return (x, y, self.size[2] / 2.0, *quaternion_from_yaw(yaw))


def fixed_shapes(statics: Sequence[StaticShape]) -> ShapeTable:
    """The part of `Model.shapes` that never moves."""
    n = len(statics)
    none = np.full(n, -1)
    kind = np.array([shape.kind for shape in statics], dtype=np.int64)
    size = np.array([shape.size for shape in statics], dtype=np.float64).reshape(n, 3)
    position = np.array([shape.position for shape in statics], dtype=np.float64).reshape(n, 3)
    rotations = [rotation_from_quaternion(shape.orientation) for shape in statics]
    rotation = np.array(rotations, dtype=np.float64).reshape(n, 9)
    return ShapeTable(
        kind=kind,
        size=size,
        bounding_radius=np.sqrt((size * size).sum(axis=1)),
        position=position,
        rotation=rotation,
        vehicle=none,
        dof=none,
        qpos=none,
        n_fixed=n,
        grid=fixed_grid(kind, size, position, rotation),
    )


def wall_shapes(wall: WallSpec) -> Iterator[StaticShape]:
    """A box for each segment, longer by the thickness of the wall so that corners are closed."""
    points = [*wall.points, wall.points[0]] if wall.is_closed else wall.points
    for i, ((x0, y0), (x1, y1)) in enumerate(itertools.pairwise(points), 1):
        half = ((math.hypot(x1 - x0, y1 - y0) + wall.thickness) / 2.0, wall.thickness / 2.0, wall.height / 2.0)
        centre = ((x0 + x1) / 2.0, (y0 + y1) / 2.0, wall.height / 2.0)
        yield StaticShape(f"{wall.name}_{i}", wall.name, BOX, half, centre, atan2(y1 - y0, x1 - x0), "wall")


def block_shape(block: BlockSpec, name: str) -> StaticShape:
    """The static shape of a block."""
    half = (block.length / 2.0, block.width / 2.0, block.height / 2.0)
    return StaticShape(name, name, BOX, half, (block.x, block.y, block.height / 2.0), block.yaw_deg * DEGREE, "block")
