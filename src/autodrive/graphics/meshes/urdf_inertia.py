"""Mass and inertia of the links of a vehicle; their sum equals the rigid body of the Spec."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.transforms import Vector
from autodrive.scenario.vehicles.spec import VehicleSpec

KNUCKLE_MASS, KNUCKLE_RADIUS = 0.001, 0.01
"""A ball [kg, m]. The Spec has no mass for a knuckle, but engines drop moving links without mass; it is subtracted from
the chassis."""


class Inertia(NamedTuple):
    """Mass properties of a link, in the link frame."""

    mass: float
    """Mass [kg]."""
    center: Vector
    """Centre of mass [m]."""
    moments: NDArray[np.float64]
    """Inertia about the centre of mass [kg m^2], shape (3, 3)."""


def wheel(spec: VehicleSpec) -> Inertia:
    """A solid cylinder along y."""
    mass, radius, width = spec.wheels.mass, spec.wheels.radius, spec.wheels.width
    across = mass * (3.0 * radius**2 + width**2) / 12.0
    return Inertia(mass, (0.0, 0.0, 0.0), np.diag([across, 0.5 * mass * radius**2, across]))


def knuckle() -> Inertia:
    """A small solid ball."""
    return Inertia(KNUCKLE_MASS, (0.0, 0.0, 0.0), np.eye(3) * 0.4 * KNUCKLE_MASS * KNUCKLE_RADIUS**2)


def chassis(spec: VehicleSpec) -> Inertia:
    """The whole vehicle minus wheels and knuckles."""
    whole = Inertia(spec.body.mass, spec.body.center_of_mass, np.diag(spec.body.inertia))
    parts = [(wheel(spec), hub) for hub in spec.hubs] + [(knuckle(), hub) for hub in spec.hubs[:2]]
    mass = whole.mass - sum(part.mass for part, _ in parts)
    moment = whole.mass * np.array(whole.center) - sum(part.mass * np.array(hub) for part, hub in parts)
    center = moment / mass
    about_origin = _moved(whole, whole.center) - sum(_moved(part, hub) for part, hub in parts)
    x, y, z = map(float, center)
    return Inertia(mass, (x, y, z), about_origin - _steiner(mass, center))


def _moved(body: Inertia, place: Vector) -> NDArray[np.float64]:
    """Inertia about the origin of a body with its centre of mass at that point [m]."""
    return body.moments + _steiner(body.mass, np.array(place))


def _steiner(mass: float, offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inertia of a point mass about the origin (parallel axis theorem)."""
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
