"""Shapes and States for tests of sensors, without an engine; columns that a sensor must not read are NaN."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from autodrive.base.arrays import Floats
from autodrive.physics.grid import fixed_grid
from autodrive.physics.model import BOX, CYLINDER, SPHERE, ShapeTable
from autodrive.physics.state import State


def state_of(vehicles: int = 1, **columns: ArrayLike) -> State:
    """A State at rest at the origin of the map, with the given columns; columns without a meaning here are NaN."""
    rest: dict[str, Any] = dict.fromkeys(State._fields, np.full(0, np.nan))
    rest |= {
        "vehicle_position": np.zeros((vehicles, 3)),
        "vehicle_orientation": np.tile([1.0, 0.0, 0.0, 0.0], (vehicles, 1)),
        "vehicle_angular_velocity": np.zeros((vehicles, 3)),
        "vehicle_acceleration": np.zeros((vehicles, 3)),
        "vehicle_angular_acceleration": np.zeros((vehicles, 3)),
        "wheel_rotation": np.zeros(4 * vehicles),
        "shape_position": np.zeros((0, 3)),
        "shape_rotation": np.zeros((0, 9)),
    }
    return State(**(rest | {name: np.atleast_1d(np.array(value, float)) for name, value in columns.items()}))


class Solid:
    """One shape: kind, size, position [m], rotation matrix, and the index of its vehicle or -1."""

    def __init__(
        self, kind: int, size: ArrayLike, position: ArrayLike, rotation: ArrayLike | None = None, vehicle: int = -1
    ) -> None:
        sizes = np.array(size, float)
        self.kind = kind
        self.size: Floats = sizes if kind == BOX else np.resize(np.array([*sizes, 0.0, 0.0]), 3)
        self.position: Floats = np.array(position, float)
        self.rotation: Floats = np.eye(3) if rotation is None else np.array(rotation, float).reshape(3, 3)
        self.vehicle = vehicle

    @property
    def bounding_radius(self) -> float:
        used = {SPHERE: 1, CYLINDER: 2, BOX: 3}[self.kind]
        return float(np.linalg.norm(self.size[:used]))


class SensorScene(NamedTuple):
    """The first two arguments of `Sensor.sample`."""

    shapes: ShapeTable
    state: State


def shapes_of(solids: list[Solid], n_fixed: int = 0) -> ShapeTable:
    """The first `n_fixed` solids are in the grid."""
    unread: dict[str, Any] = dict.fromkeys(ShapeTable._fields, np.full(len(solids), -1, np.int64))
    known: dict[str, Any] = {
        "kind": np.array([solid.kind for solid in solids], np.int64),
        "size": np.array([solid.size for solid in solids]).reshape(-1, 3),
        "bounding_radius": np.array([solid.bounding_radius for solid in solids], float),
        "vehicle": np.array([solid.vehicle for solid in solids], np.int64),
        "position": np.array([solid.position for solid in solids]).reshape(-1, 3),
        "rotation": np.array([solid.rotation.ravel() for solid in solids]).reshape(-1, 9),
    }
    fixed = (known[name][:n_fixed] for name in ("kind", "size", "position", "rotation"))
    known |= {"n_fixed": n_fixed, "grid": fixed_grid(*fixed)}
    return ShapeTable(**(unread | known))


def scene(solids: list[Solid], vehicles: int = 1, n_fixed: int = 0, **columns: ArrayLike) -> SensorScene:
    """Shapes and State with these solids, `n_fixed` of them in the grid; the rest as in `state_of`."""
    state = state_of(
        vehicles,
        shape_position=np.array([solid.position for solid in solids]).reshape(-1, 3),
        shape_rotation=np.array([solid.rotation.ravel() for solid in solids]).reshape(-1, 9),
        **columns,
    )
    return SensorScene(shapes_of(solids, n_fixed), state)
