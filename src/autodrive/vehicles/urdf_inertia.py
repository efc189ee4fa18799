"""Mass and inertia of a vehicle's links, such that all together weigh and turn as the rigid body of the Spec does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.transforms import Vector
from autodrive.vehicles.spec import VehicleSpec

KNUCKLE_MASS, KNUCKLE_RADIUS = 0.001, 0.01
"""Of a ball [kg, m]: the Spec has no mass for it, but engines that read URDF drop a link that moves without one;
it is taken off the chassis."""


class Inertia(NamedTuple):
    """Of a link, in its axes."""

    mass: float
    """[kg]."""
    center: Vector
    """Of mass [m]."""
    moments: NDArray[np.float64]
    """About the centre of mass, shape (3, 3) [kg m^2]."""


def wheel(spec: VehicleSpec) -> Inertia:
    """A solid cylinder along y."""
    mass, radius, width = spec.wheels.mass, spec.wheels.radius, spec.wheels.width
    across = mass * (3.0 * radius**2 + width**2) / 12.0
    return Inertia(mass, (0.0, 0.0, 0.0), np.diag([across, 0.5 * mass * radius**2, across]))


def knuckle() -> Inertia:
    """A small ball."""
    return Inertia(KNUCKLE_MASS, (0.0, 0.0, 0.0), np.eye(3) * 0.4 * KNUCKLE_MASS * KNUCKLE_RADIUS**2)


def chassis(spec: VehicleSpec) -> Inertia:
    """What is left of the whole car without wheels and knuckles."""
    whole = Inertia(spec.body.mass, spec.body.center_of_mass, np.diag(spec.body.inertia))
    parts = [(wheel(spec), hub) for hub in spec.hubs] + [(knuckle(), hub) for hub in spec.hubs[:2]]
    mass = whole.mass - sum(part.mass for part, _ in parts)
    moment = whole.mass * np.array(whole.center) - sum(part.mass * np.array(hub) for part, hub in parts)
    center = moment / mass
    about_origin = _moved(whole, whole.center) - sum(_moved(part, hub) for part, hub in parts)
    x, y, z = map(float, center)
    return Inertia(mass, (x, y, z), about_origin - _steiner(mass, center))


def _moved(body: Inertia, place: Vector) -> NDArray[np.float64]:
    """Its moments about the origin, when its centre of mass is at that place [m]."""
    return body.moments + _steiner(body.mass, np.array(place))


def _steiner(mass: float, offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moments of a point mass about the origin (parallel axis theorem)."""
    return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
