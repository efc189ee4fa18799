"""Arrays that the tick function writes besides the State: contacts of the vehicles, and its working memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.physics.model import Model, Table, columns

WHEEL_CONTACT = columns(
    is_airborne=np.bool_,  # no ground within reach of the suspension; the load and both velocities are 0
    shape=np.int64,  # index of the shape under the wheel, or -1 for the floor
    load=np.float64,  # [N]
    longitudinal_velocity=np.float64,  # of the wheel over the ground [m/s]
    lateral_velocity=np.float64,  # of the wheel over the ground [m/s]
    longitudinal_axis=(np.float64, 3),  # in the contact plane, map axes
    lateral_axis=(np.float64, 3),  # in the contact plane, map axes
    normal=(np.float64, 3),  # of the ground, map axes
    lever_arm=(np.float64, 3),  # from the vehicle frame's origin to the point where the force acts, map axes [m]
    point=(np.float64, 3),  # of the contact in the map [m]
    slip_angle=np.float64,  # [rad]
    coasting_spin=np.float64,  # spin at the end of the substep without drive and brake [rad/s]
    spin_gain=np.float64,  # what a torque adds to that spin [rad/s per N m]
)
"""Columns of `Scratch.wheel_contacts`."""


class VehicleContacts(NamedTuple):
    """What the vehicles touched during a tick. Filled by `advance`, read and cleared by the rule of collisions.

    Solid 0 is the floor, solid 1 + s the shape s of the Model.
    """

    solid_vehicle: Integers
    """Vehicle of each solid, or -1, shape (n_solid,)."""
    impulse: Floats
    """Impulse between a vehicle and a solid [N s], shape (n, n_solid)."""
    position: Floats
    """A point of that contact [m], shape (n, n_solid, 3)."""
    push: Floats
    """Impulse on the vehicle in map axes [N s], and the sum of the points of the contacts, each times the magnitude of
    its impulse [N s m]; only of the pairs, shape (n, n_solid, 6)."""
    pairs: Integers
    """The (vehicle, solid) pairs with an impulse, shape (n_max, 2)."""
    pair_count: Integers
    """Number of pairs, shape (1,)."""

    def clear(self) -> None:
        """Forget what was touched."""
        self.impulse[:] = 0.0
        self.pair_count[0] = 0


class Scratch(NamedTuple):
    """Working memory of `advance`. Nothing in it is read after the tick."""

    nearby: Integers
    """Shapes within reach of each vehicle, shape (n, n_shape)."""
    nearby_count: Integers
    """Shape (n,)."""
    horizon: Floats
    """How far each vehicle may move before `nearby` is outdated [m], shape (n,)."""
    clearance: Floats
    """How far each vehicle may move before it can touch something [m], shape (n,)."""
    applied: Floats
    """Force [N] on the origin of each movable body in map axes, torque [N m] in body axes, shape (6 n_body,)."""
    velocity: Floats
    """Velocity of each vehicle's origin before the substep, map axes [m/s], shape (n, 3)."""
    wheel_contacts: Table
    """Contacts of the wheels of one vehicle, columns `WHEEL_CONTACT`, shape (4,)."""
    contact_force: Floats
    """Force and torque of one contact of the engine, shape (6,)."""
    contact_position: Floats
    """Position of that contact [m], shape (3,)."""
    contact_frame: Floats
    """Axes of the contact in the map, the normal first, from the first to the second geom, shape (9,)."""
    contact_geoms: NDArray[np.int32]
    """The two geoms of that contact, shape (2,)."""
    contact_row: NDArray[np.int32]
    """The first row of that contact in the constraints of the engine, or -1, shape (1,)."""
    other_geoms: NDArray[np.int32]
    """The two geoms, the first row and the normal of another contact, shapes (2,), (1,) and (3,)."""
    other_row: NDArray[np.int32]
    other_normal: Floats


def vehicle_contacts(model: Model, pairs_max: int = 64) -> VehicleContacts:
    """No contacts yet, in arrays of the right shapes."""
    n, n_solid = len(model.vehicles), 1 + len(model.shapes.kind)
    return VehicleContacts(
        solid_vehicle=np.array([-1, *model.shapes.vehicle.tolist()], dtype=np.int64),
        impulse=np.zeros((n, n_solid)),
        position=np.zeros((n, n_solid, 3)),
        push=np.zeros((n, n_solid, 6)),
        pairs=np.zeros((pairs_max, 2), dtype=np.int64),
        pair_count=np.zeros(1, dtype=np.int64),
    )


def scratch(model: Model, n_body: int) -> Scratch:
    """Working memory for that model and so many movable bodies."""
    n, n_shape = len(model.vehicles), len(model.shapes.kind)
    return Scratch(
        nearby=np.zeros((n, n_shape), dtype=np.int64),
        nearby_count=np.zeros(n, dtype=np.int64),
        horizon=np.zeros(n),
        clearance=np.zeros(n),
        applied=np.zeros(6 * n_body),
        velocity=np.zeros((n, 3)),
        wheel_contacts=np.zeros(4, dtype=WHEEL_CONTACT),
        contact_force=np.zeros(6),
        contact_position=np.zeros(3),
        contact_frame=np.zeros(9),
        contact_geoms=np.zeros(2, dtype=np.int32),
        contact_row=np.zeros(1, dtype=np.int32),
        other_geoms=np.zeros(2, dtype=np.int32),
        other_row=np.zeros(1, dtype=np.int32),
        other_normal=np.zeros(3),
    )
