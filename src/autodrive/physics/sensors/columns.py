"""The numbers of the sensors of n worlds, without cameras: arrays that compiled code reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined
from autodrive.physics.model import Shapes
from autodrive.physics.state import State

SENSORS = ("encoders", "ips", "imu", "lidar", "range")
"""In the order of all arrays with an axis of sensors."""
ENCODERS, IPS, IMU, LIDAR, RANGE = range(len(SENSORS))

CHANNELS = {"encoders": slice(0, 2), "ips": slice(2, 5), "imu": slice(5, 14), "range": slice(14, 15)}
"""Channels of the noise of each sensor but the LIDAR."""

ANGLES = slice(0, 2)
"""Places of the encoder angles [rad] in `ReadingColumns.values`."""
POSITION = slice(2, 5)
"""Likewise, of the IPS [m]."""
MOTION = (slice(5, 9), slice(9, 12), slice(12, 15), slice(15, 18))
"""Likewise, of the IMU: orientation, Euler angles, angular velocity, linear acceleration."""
DISTANCE = 18
"""Likewise, of the range sensor [m]."""


class NoiseColumns(NamedTuple):
    """Noise of the sensors of n worlds with v vehicles."""

    is_noisy: NDArray[np.bool_]
    """Shape (n, v, 5)."""
    stream: NDArray[np.uint64]
    """`random_stream.Stream` of each sensor, shape (n, v, 5, 3)."""
    channels: Floats
    """sigma, offset, walk and step of each channel, shape (n, v, 15, 4)."""
    bias: Floats
    """Of each channel, shape (n, v, 15)."""
    lidar: Floats
    """sigma, relative_sigma, step, dropout, and the scale of all ranges, shape (n, v, 5)."""


class ReadingColumns(NamedTuple):
    """The latest readings of the sensors of n worlds with v vehicles."""

    time: Floats
    """Of each reading [s]; not a number without such a sensor, shape (n, v, 5)."""
    values: Floats
    """Of all sensors but the LIDAR, shape (n, v, 19); see `ANGLES` and the next names."""
    encoder_ticks: Integers
    """Shape (n, v, 2)."""
    lidar_ranges: Floats
    """[m], shape (n, v, most rays of a LIDAR)."""
    sweep: Integers
    """Number of the scan in progress of a rolling LIDAR, and its next ray, shape (n, v, 2)."""
    sweep_ranges: Floats
    """Its inverse ranges [1/m], shape (n, v, most rays of a LIDAR); without a rolling LIDAR, shape (n, v, 0)."""


class Motion(NamedTuple):
    """What the sensors read of a State: its columns with the same names."""

    vehicle_position: Floats
    vehicle_orientation: Floats
    vehicle_angular_velocity: Floats
    vehicle_acceleration: Floats
    vehicle_angular_acceleration: Floats
    wheel_rotation: Floats
    shape_position: Floats
    shape_rotation: Floats


@inlined
def motion_of(state: State) -> Motion:
    """Views of a State."""
    return Motion(
        state.vehicle_position,
        state.vehicle_orientation,
        state.vehicle_angular_velocity,
        state.vehicle_acceleration,
        state.vehicle_angular_acceleration,
        state.wheel_rotation,
        state.shape_position,
        state.shape_rotation,
    )


class Poses(NamedTuple):
    """Poses of the vehicles and shapes of one world, as in its State."""

    position: Floats
    """Shape (v, 3)."""
    orientation: Floats
    """Shape (v, 4)."""
    shape_position: Floats
    """Shape (n_shape, 3)."""
    shape_rotation: Floats
    """Shape (n_shape, 9)."""


class Working(NamedTuple):
    """Working memory of the sensors."""

    before: Poses
    """At the start of the tick; only with a rolling LIDAR."""
    near: Integers
    """Shapes near a sensor, shape (n_shape,)."""
    views: Floats
    """Outlines of these shapes, shape (n_shape, 10); without a LIDAR, shape (0, 10)."""
    inverse_range: Floats
    """[1/m], shape (most rays of a LIDAR,)."""
    values: Floats
    """Shape (9,)."""


def noise_columns(n: int, v: int) -> NoiseColumns:
    """No noise yet; see `tables.reset_noise`."""
    channels = CHANNELS["range"].stop
    return NoiseColumns(
        is_noisy=np.zeros((n, v, len(SENSORS)), np.bool_),
        stream=np.zeros((n, v, len(SENSORS), 3), np.uint64),
        channels=np.zeros((n, v, channels, 4)),
        bias=np.zeros((n, v, channels)),
        lidar=np.zeros((n, v, 5)),
    )


def reading_columns(n: int, v: int, rays: int, rolling_rays: int) -> ReadingColumns:
    """No readings yet, for LIDARs, and rolling ones, of at most so many rays."""
    values = np.zeros((n, v, DISTANCE + 1))
    values[..., DISTANCE] = np.nan
    return ReadingColumns(
        time=np.full((n, v, len(SENSORS)), np.nan),
        values=values,
        encoder_ticks=np.zeros((n, v, 2), np.int64),
        lidar_ranges=np.full((n, v, rays), np.nan),
        sweep=np.zeros((n, v, 2), np.int64),
        sweep_ranges=np.zeros((n, v, rolling_rays)),
    )


def working_memory(shapes: Shapes, v: int, rays: int) -> Working:
    """For LIDARs of at most so many rays."""
    return Working(
        before=Poses(
            position=np.zeros((v, 3)),
            orientation=np.zeros((v, 4)),
            shape_position=shapes.position.copy(),
            shape_rotation=shapes.rotation.copy(),
        ),
        near=np.zeros(len(shapes.kind), np.int64),
        views=np.zeros((len(shapes.kind) if rays else 0, 10)),
        inverse_range=np.zeros(rays),
        values=np.zeros(9),
    )
