"""Model: the constant parameters of a world, as tables of numbers that compiled code reads directly.

A table is a structured array: one row for each vehicle or wheel, one named column for each parameter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers

SPHERE, CYLINDER, BOX = 2, 5, 6
"""Kinds of shapes, numbered as in MuJoCo (mjtGeom)."""

CURVE_POINTS = 9
"""Most points of a curve of an actuator."""

COVER = 3
"""Number of small spheres that together cover the colliders of a vehicle."""

Table = NDArray[Any]


def columns(**types: Any) -> np.dtype[Any]:
    """The dtype of a table with these columns."""
    return np.dtype(list(types.items()), align=True)


VEHICLE = columns(
    qpos=np.int64,  # index of its position and quaternion in `State.qpos`
    dof=np.int64,  # index of its velocity in `State.qvel`
    body=np.int64,  # number of its body in the engine
    mass=np.float64,  # [kg]
    inertia=(np.float64, 3),  # about the centre of mass, vehicle axes [kg m^2]
    center_of_mass=(np.float64, 3),  # in the vehicle frame [m]
    drag=np.float64,  # [1/s]
    angular_drag=np.float64,  # [1/s]
    air_drag=np.float64,  # force per square of the speed [N s^2/m^2]
    angular_velocity_max=np.float64,  # [rad/s]
    sphere_centre=(np.float64, 3),  # of a sphere around all colliders, in the vehicle frame [m]
    sphere_radius=np.float64,  # [m]
    cover=(np.float64, (COVER, 4)),  # centre and radius of each sphere that covers a part of the colliders [m]
    reach=np.float64,  # of colliders and suspension rays, from that centre [m]
    chassis_low=(np.float64, 3),  # lowest corner of the box around the colliders that the floor stops [m]
    chassis_high=(np.float64, 3),  # its highest corner, both in the vehicle frame [m]
    wheelbase=np.float64,  # [m]
    steering_limit=np.float64,  # angle that the command 1 asks for [rad]
    command_limits=(np.float64, 2),  # of the steering, right and left
    steering_curve_points=np.int64,  # 0: the angle of the wheels is that of the servo
    steering_curve_servo=(np.float64, CURVE_POINTS),  # angle of the servo [rad]
    steering_curve_angle=(np.float64, CURVE_POINTS),  # angle of the wheels, with offset and trim [rad]
    steering_rate_limit=np.float64,  # [rad/s], or infinity
    steering_unwinds_at_once=np.bool_,
    steering_response=np.float64,  # 1 - exp(-dt / time constant)
    steering_delay=np.int64,  # [substeps]
    drive_is_speed_controlled=np.bool_,
    drive_is_voltage_controlled=np.bool_,
    drive_coasts=np.bool_,  # zero throttle does not brake
    drive_has_reverse=np.bool_,
    drive_speed_limit=np.float64,  # [rad/s]
    drive_speed_gain=np.float64,  # of the target speed
    drive_speed_offset=np.float64,  # of the target speed [rad/s]
    drive_torque_limit=np.float64,  # of each driven wheel [N m]
    torque_curve_points=np.int64,  # 0: the torque limit holds at any speed
    torque_curve_speed=(np.float64, CURVE_POINTS),  # of the wheels [rad/s]
    torque_curve_share=(np.float64, CURVE_POINTS),  # of the torque limit
    throttle_curve_points=np.int64,  # 0: the torque is proportional to the throttle
    throttle_curve_throttle=(np.float64, CURVE_POINTS),
    throttle_curve_share=(np.float64, CURVE_POINTS),  # of the torque limit
    has_differentials=np.bool_,  # any that is not open
    front_differential=(np.float64, 2),  # largest torque between its outputs: constant [N m], per drive torque
    centre_differential=(np.float64, 2),  # of the one between the axles: constant [N m], per drive torque
    rear_differential=(np.float64, 2),  # as front_differential
    drive_servo_gain=np.float64,  # [N m s/rad]
    drive_response=np.float64,  # 1 - exp(-dt / time constant)
    drive_rate_limit=np.float64,  # [1/s], or infinity
    drive_delay=np.int64,  # [substeps]
    brake_torque=np.float64,  # of each braked wheel [N m]
)
"""Columns of `Model.vehicles`."""

WHEEL = columns(
    hub=(np.float64, 3),  # wheel centre at the suspension's target position, in the vehicle frame [m]
    is_steered=np.bool_,
    is_driven=np.bool_,
    is_braked=np.bool_,  # at zero throttle
    radius=np.float64,  # [m]
    inertia=np.float64,  # about the axle [kg m^2]
    damping_rate=np.float64,  # [N m s/rad]
    rolling_resistance=np.float64,  # per load, besides the damping
    steering_resistance=np.float64,  # per load and angle of the wheel, besides that [1/rad]
    sprung_mass=np.float64,  # [kg]
    force_height=np.float64,  # of the point where the ground's force acts, above the base of the wheel [m]
    stiffness=np.float64,  # of the suspension [N/m]
    damping=np.float64,  # of the suspension [N s/m]
    compression_max=np.float64,  # [m]
    droop_max=np.float64,  # [m]
    bump_stiffness=np.float64,  # [N/m]
    look_ahead=np.float64,  # of the suspension [s]
    forward=(np.float64, 5),  # friction curve: extremum slip and value, asymptote slip and value, initial slope
    sideways=(np.float64, 5),  # friction curve, as forward
    is_magic=np.bool_,  # the tyre force follows the magic formula; of the friction curves only the peak value is used
    magic_forward=(np.float64, 5),  # peak friction, stiffness per load, shape C, curvature E, load sensitivity
    magic_sideways=(np.float64, 5),  # as magic_forward
    nominal_load=np.float64,  # [N]
    stiffness_degression=np.float64,  # of the cornering stiffness, see `wheel.cornering_stiffness`
    peak_slip=(np.float64, 2),  # forward, sideways: where the force has its peak
    relaxation_length=(np.float64, 2),  # forward, sideways [m]
    slip_damping=(np.float64, 2),  # forward, sideways, at rest: slip per slip velocity [s/m]
    active_slip_offset=np.float64,  # [m/s]
    passive_slip_minimum=np.float64,  # [m/s]
    slip_angle_offset=np.float64,  # [m/s]
    hold_speed=np.float64,  # [m/s]
    hold_stiffness=np.float64,  # [N/m]
    hold_damping=np.float64,  # [N s/m]
    effective_mass=np.float64,  # for a horizontal force at the contact point, per wheel [kg]
)
"""Columns of `Model.wheels`, four rows per vehicle in the order of `protocol.messages.WHEEL_NAMES`."""


class Grid(NamedTuple):
    """A uniform grid over the map, seen from above, with the fixed shapes in each cell; see `physics/grid.py`.

    A shape is a member of every cell that the rectangle around it overlaps.
    """

    x: float
    """Left edge of the first column [m]."""
    y: float
    """Lower edge of the first row [m]."""
    cells_per_metre: float
    rows: int
    columns: int
    starts: Integers
    """Where the members of a cell begin in `members`, cells row by row, shape (rows * columns + 1,)."""
    members: Integers
    """Numbers of shapes, cell after cell."""
    first_row: Integers
    """First row of each fixed shape, shape (n_fixed,)."""
    first_column: Integers
    """First column of each fixed shape, shape (n_fixed,)."""


class ShapeTable(NamedTuple):
    """Constant parameters of the collision shapes; their poses are `State.shape_position` and `.shape_rotation`.

    The floor (z = 0) is not one of them. The fixed shapes come first.
    """

    kind: Integers
    """SPHERE, CYLINDER or BOX, shape (n_shape,)."""
    size: Floats
    """Sphere: radius; cylinder: radius, half height (axis z); box: half sizes [m], shape (n_shape, 3)."""
    bounding_radius: Floats
    """[m], shape (n_shape,)."""
    position: Floats
    """Centre [m] in the frame of the shape's body, or in the map if it is fixed, shape (n_shape, 3)."""
    rotation: Floats
    """Rotation matrix in the frame of `position`, row-major, shape (n_shape, 9)."""
    vehicle: Integers
    """Index of the vehicle that the shape is part of, or -1, shape (n_shape,)."""
    dof: Integers
    """Index of the velocity of the shape's body in `State.qvel`, or -1 if it is fixed, shape (n_shape,)."""
    qpos: Integers
    """Index of the position of the shape's body in `State.qpos`, or -1 if it is fixed, shape (n_shape,)."""
    n_fixed: int
    """Number of fixed shapes."""
    grid: Grid
    """Grid of the fixed shapes."""


class Model(NamedTuple):
    """All constant parameters."""

    dt: float
    """Length of a substep [s]."""
    gravity: float
    """[m/s^2], downwards."""
    vehicles: Table
    """Columns `VEHICLE`, shape (n,)."""
    wheels: Table
    """Columns `WHEEL`, shape (4 n,)."""
    shapes: ShapeTable


def model_digest(model: Model) -> str:
    """SHA-256 of all parameters with their names, types and shapes, in hexadecimal.

    Two models have the same digest only if all their parameters have the same bits.
    """
    digest = hashlib.sha256()
    for name, column in _parameters("model", model):
        little = np.ascontiguousarray(column, column.dtype.newbyteorder("<"))
        digest.update(f"{name} {little.dtype.str} {little.shape}\n".encode())
        digest.update(little.tobytes())
    return digest.hexdigest()


def _parameters(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """Each column with its full name; the bytes between the columns of a table have no meaning."""
    if isinstance(value, tuple):
        for field in value._fields:  # pyright: ignore[reportAttributeAccessIssue]
            yield from _parameters(f"{name}.{field}", getattr(value, field))
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for column in value.dtype.names:
            yield f"{name}.{column}", value[column]
    else:
        yield name, np.asarray(value)
