"""State: what each tick changes, as a NamedTuple of flat float64 arrays that Numba takes as they are.

Between ticks all of it is of the same instant. `n` counts vehicles, `n_wheel` wheels (four a vehicle, in the order
front left, front right, rear left, rear right), `n_shape` collision shapes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class State(NamedTuple):
    """Columns of numbers; each row is a vehicle, a wheel, or a shape."""

    # vehicles: the vehicle frame is the centre of the rear axle at wheel-centre height
    vehicle_position: Floats
    """Vehicle frame in the map [m], shape (n, 3)."""
    vehicle_orientation: Floats
    """Quaternion wxyz, map from vehicle, shape (n, 4)."""
    vehicle_velocity: Floats
    """Velocity of the vehicle frame's origin in vehicle axes [m/s], shape (n, 3)."""
    vehicle_angular_velocity: Floats
    """In vehicle axes [rad/s], shape (n, 3)."""
    vehicle_acceleration: Floats
    """Of the origin, mean over the tick, gravity not included, vehicle axes [m/s^2], shape (n, 3)."""
    vehicle_angular_acceleration: Floats
    """Mean over the tick, vehicle axes [rad/s^2], shape (n, 3)."""
    # actuators
    throttle: Floats
    """Command that has reached the drive actuators [-1, 1], shape (n,)."""
    drive_level: Floats
    """The drive's lagged response to that command [-1, 1], shape (n,)."""
    steering_target: Floats
    """Command that has reached the steering actuator, as an angle [rad], shape (n,)."""
    steering_angle: Floats
    """Angle of the steering actuator, left positive [rad], shape (n,)."""
    throttle_queue: Floats
    """Commands on their way to the drive actuators, a ring over substeps, shape (n, longest delay + 1)."""
    steering_queue: Floats
    """Likewise to the steering actuators, as angles [rad]."""
    # wheels
    wheel_angular_velocity: Floats
    """Spin, forward positive [rad/s], shape (n_wheel,)."""
    wheel_rotation: Floats
    """Angle turned since reset, never wrapped [rad], shape (n_wheel,)."""
    wheel_steering_angle: Floats
    """Left positive [rad], shape (n_wheel,)."""
    wheel_compression: Floats
    """Suspension travel from the target position, compression positive [m], shape (n_wheel,)."""
    wheel_normal_load: Floats
    """Force of the ground along its normal [N], shape (n_wheel,)."""
    wheel_slip_ratio: Floats
    """Shape (n_wheel,)."""
    wheel_slip_angle: Floats
    """[rad], shape (n_wheel,)."""
    wheel_force: Floats
    """Longitudinal and lateral force of the ground on the chassis [N], shape (n_wheel, 2)."""
    wheel_hold: Floats
    """Longitudinal and lateral deflection of a standing, braked wheel [m], shape (n_wheel, 2)."""
    # collision shapes: what a LIDAR ray, a wheel or another body can hit
    shape_position: Floats
    """Centre in the map [m], shape (n_shape, 3)."""
    shape_rotation: Floats
    """Rotation matrix, map from shape, row-major, shape (n_shape, 9)."""
