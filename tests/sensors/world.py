"""States and shapes to measure in, without an engine. What a sensor must not read is NaN."""

import numpy as np

from autodrive.model import BOX, CYLINDER, SPHERE, Shapes
from autodrive.state import State


def state_of(vehicles=1, **columns):
    """A State at rest at the map's origin, with the given columns; everything without meaning here is NaN."""
    rest = dict.fromkeys(State._fields, np.full(0, np.nan))
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


class Thing:
    """One shape: kind, size, where it is, how it is turned."""

    def __init__(self, kind, size, position, rotation=None, vehicle=-1):
        self.kind = kind
        self.size = np.resize(np.array([*size, 0.0, 0.0]), 3) if kind != BOX else np.array(size)
        self.position = np.array(position, float)
        self.rotation = np.eye(3) if rotation is None else np.array(rotation, float).reshape(3, 3)
        self.vehicle = vehicle

    @property
    def bounding_radius(self):
        used = {SPHERE: 1, CYLINDER: 2, BOX: 3}[self.kind]
        return float(np.linalg.norm(self.size[:used]))


def shapes_of(things):
    unread = dict.fromkeys(Shapes._fields, np.full(len(things), -1, np.int64))
    known = {
        "kind": np.array([t.kind for t in things], np.int64),
        "size": np.array([t.size for t in things]).reshape(-1, 3),
        "bounding_radius": np.array([t.bounding_radius for t in things], float),
        "vehicle": np.array([t.vehicle for t in things], np.int64),
    }
    return Shapes(**(unread | known))


def scene(things, **columns):
    """Shapes and State of a scene."""
    return shapes_of(things), state_of(
        shape_position=np.array([t.position for t in things]).reshape(-1, 3),
        shape_rotation=np.array([t.rotation.ravel() for t in things]).reshape(-1, 9),
        **columns,
    )
