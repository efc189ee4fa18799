"""The numbers of the sensors of n worlds, without cameras: arrays that compiled code reads and writes.

There are s sensors, c channels of noise and m values in each vehicle, in the order of `catalog.SENSORS`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.jit import inlined
from autodrive.base.transforms import Quaternion, Vector
from autodrive.physics.model import ShapeTable, Table
from autodrive.physics.sensors.noise import corrupt
from autodrive.physics.state import State


class NoiseColumns(NamedTuple):
    """Noise of the sensors of n worlds with v vehicles."""

    is_noisy: NDArray[np.bool_]
    """Shape (n, v, s)."""
    stream: NDArray[np.uint64]
    """`random_stream.Stream` of each sensor, then that of the weather of the LIDAR, shape (n, v, s + 1, 3)."""
    channels: Floats
    """sigma, offset, walk and step of each channel, shape (n, v, c, 4)."""
    bias: Floats
    """Bias of each channel, shape (n, v, c)."""
    lidar: Floats
    """sigma, relative_sigma, step, dropout, scale, the drawn factor of all ranges, and the figures of the weather (see
    `lidar.weather`; zeros: nothing), shape (n, v, 6 + figures)."""


class ReadingColumns(NamedTuple):
    """The latest readings of the sensors of n worlds with v vehicles."""

    time: Floats
    """Time of each reading [s]; not a number without such a sensor, shape (n, v, s)."""
    values: Floats
    """Values of all sensors but the LIDAR, shape (n, v, m); not a number before the first reading."""
    encoder_ticks: Integers
    """Shape (n, v, 2)."""
    lidar_ranges: Floats
    """[m], shape (n, v, most rays of a LIDAR)."""
    sweep: Integers
    """Number of the scan in progress of a rolling LIDAR, and its next ray, shape (n, v, 2)."""
    sweep_ranges: Floats
    """Inverse ranges of the scan in progress [1/m], shape (n, v, most rays of a LIDAR); without a rolling LIDAR,  shape
    (n, v, 0)."""
    sweep_hits: Integers
    """Shapes that the rays of the scan in progress hit in weather, with the shape of `sweep_ranges`."""


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


class StatePoses(NamedTuple):
    """Poses of the vehicles and shapes of one world, as in its State."""

    position: Floats
    """Shape (v, 3)."""
    orientation: Floats
    """Shape (v, 4)."""
    shape_position: Floats
    """Shape (n_shape, 3)."""
    shape_rotation: Floats
    """Shape (n_shape, 9)."""


@inlined
def poses_of(motion: Motion) -> StatePoses:
    """Views of the present poses."""
    return StatePoses(motion.vehicle_position, motion.vehicle_orientation, motion.shape_position, motion.shape_rotation)


class Working(NamedTuple):
    """Working memory of the sensors."""

    before: StatePoses
    """Poses at the start of the tick; only with a rolling LIDAR."""
    near: Integers
    """Shapes near a sensor, shape (n_shape,)."""
    views: Floats
    """Outlines of these shapes, shape (n_shape, 10); without a LIDAR, shape (0, 10)."""
    inverse_range: Floats
    """[1/m], shape (most rays of a LIDAR,)."""
    hits: Integers
    """Number of the shape that each ray hits, -1 for the ground, shape (most rays of a LIDAR,); only in weather."""
    values: Floats
    """Shape (9,)."""


class SensorTables(NamedTuple):
    """Constant parameters of the sensors."""

    substep: tuple[int, int]
    """Numerator and denominator of its duration [s]."""
    vehicles: Table
    """Columns `tables.VEHICLE_SENSORS`, shape (v,)."""
    rays: Floats
    """Constants of the rays of all sensors, which each sensor defines (`Sampled.ray_constants`), shape (4, n_ray)."""
    targets: Integers
    """What each shape is for a LIDAR, a number of `weather.TARGETS`, shape (n_shape,)."""


class Memory(NamedTuple):
    """All that a sensor reads and writes."""

    motion: Motion
    shapes: ShapeTable
    noise: NoiseColumns
    readings: ReadingColumns
    working: Working
    sensors: SensorTables


class Due(NamedTuple):
    """A sample that is due."""

    k: int
    """Number of the world."""
    i: int
    """Number of the vehicle."""
    s: int
    """Number of the sensor, in the order of `catalog.SENSORS`."""
    now: int
    """[substeps]."""
    substeps: int
    """Length of a tick [substeps]."""
    time: float
    """[s]."""
    channel: int
    """The first channel of its noise."""
    channel_end: int
    """The one after its last."""


@inlined
def mount_position(due: Due, row: Any) -> Vector:
    """Position of the sensor in the vehicle frame [m]."""
    p = row["position"][due.s]
    return p[0], p[1], p[2]


@inlined
def mount_orientation(due: Due, row: Any) -> Quaternion:
    """Vehicle from sensor."""
    q = row["orientation"][due.s]
    return q[0], q[1], q[2], q[3]


@inlined
def add_noise(due: Due, memory: Memory, values: Floats) -> None:
    """Note the time of the reading, and add the noise of the sensor's channels to `values`, shape (n_channel,)."""
    noise, times = memory.noise, memory.readings.time[due.k, due.i]
    before = times[due.s]
    times[due.s] = due.time
    if noise.is_noisy[due.k, due.i, due.s]:
        elapsed = max(due.time - before, 0.0) if due.time > 0.0 else 0.0
        channels = noise.channels[due.k, due.i, due.channel : due.channel_end]
        bias = noise.bias[due.k, due.i, due.channel : due.channel_end]
        corrupt(values, channels, bias, noise.stream[due.k, due.i, due.s], elapsed)


def working_memory(shapes: ShapeTable, v: int, rays: int) -> Working:
    """Working memory for v vehicles and LIDARs of at most so many rays."""
    return Working(
        before=StatePoses(
            position=np.zeros((v, 3)),
            orientation=np.zeros((v, 4)),
            shape_position=shapes.position.copy(),
            shape_rotation=shapes.rotation.copy(),
        ),
        near=np.zeros(len(shapes.kind), np.int64),
        views=np.zeros((len(shapes.kind) if rays else 0, 10)),
        inverse_range=np.zeros(rays),
        hits=np.zeros(rays, np.int64),
        values=np.zeros(9),
    )
