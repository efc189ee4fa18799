"""The numbers of all worlds of a batch: one row for each world, in arrays that compiled code reads and writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.arrays import Floats, Integers
from autodrive.compile import Compiled
from autodrive.jit import inlined
from autodrive.model import Model, Table
from autodrive.physics.buffers import Scratch, VehicleContacts, scratch, vehicle_contacts
from autodrive.physics.engine import Engine, Views
from autodrive.state import State

SENSORS = ("encoders", "ips", "imu", "lidar", "range")
"""In the order of all arrays with an axis of sensors."""
ENCODERS, IPS, IMU, LIDAR, RANGE = range(len(SENSORS))

CHANNELS = {"encoders": slice(0, 2), "ips": slice(2, 5), "imu": slice(5, 14), "range": slice(14, 15)}
"""Channels of the noise of each sensor but the LIDAR."""

RECENT = 64
"""Contacts that are remembered for each world, to tell a new collision from an old one."""


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
    encoder_ticks: Integers
    """Shape (n, v, 2)."""
    encoder_angles: Floats
    """[rad], shape (n, v, 2)."""
    ips_position: Floats
    """[m], shape (n, v, 3)."""
    imu: Floats
    """Orientation (4), Euler angles (3), angular velocity (3) and linear acceleration (3), shape (n, v, 13)."""
    lidar_ranges: Floats
    """[m], shape (n, v, most rays of a LIDAR)."""
    range_distance: Floats
    """[m], shape (n, v, 1)."""
    sweep: Integers
    """Number of the scan in progress of a rolling LIDAR, and its next ray, shape (n, v, 2)."""
    sweep_ranges: Floats
    """Its inverse ranges [1/m], shape (n, v, most rays of a LIDAR); without a rolling LIDAR, shape (n, v, 0)."""


class Worlds(NamedTuple):
    """All numbers of n worlds with v vehicles."""

    state: State
    """Columns with n rows; without the poses of shapes, which follow from those of the bodies: shape (n, 0, ...)."""
    vehicles: Table
    """`Model.vehicles` of each world, shape (n, v)."""
    wheels: Table
    """`Model.wheels` of each world, shape (n, 4 v)."""
    tick: Integers
    """Ticks since the reset of each world, shape (n,)."""
    is_unstable: NDArray[np.bool_]
    """Whether the physics of a world has diverged, shape (n,)."""
    throttle: Floats
    """Commands in [-1, 1], shape (n, v)."""
    steering: Floats
    """Likewise."""
    # referee
    recent: Integers
    """Vehicle, other object and tick of the latest contacts, shape (n, RECENT, 3)."""
    recent_count: Integers
    """Shape (n,)."""
    collision_count: Integers
    """Since the reset, shape (n, v)."""
    has_collided: NDArray[np.bool_]
    """Whether there was a new collision in the last call, shape (n, v)."""
    is_off_road: NDArray[np.bool_]
    """Shape (n, v)."""
    noise: NoiseColumns
    readings: ReadingColumns


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
    inverse_range: Floats
    """[1/m], shape (most rays of a LIDAR,)."""
    values: Floats
    """Shape (9,)."""


class Thread(NamedTuple):
    """Working memory of one thread. Nothing in it is read after a world."""

    views: Views
    contacts: VehicleContacts
    scratch: Scratch
    shape_position: Floats
    """`State.shape_position`; the fixed shapes are always there."""
    shape_rotation: Floats
    """Likewise."""
    sensors: Working


def empty_worlds(compiled: Compiled, n: int, rays: int, rolling_rays: int) -> Worlds:
    """Worlds of zeros with the Model of the scenario; LIDARs, and rolling ones, have at most so many rays."""
    v, model = len(compiled.vehicles), compiled.model
    columns = State(*(np.zeros((n, *column.shape)) for column in compiled.state._replace(**_NO_SHAPES)))
    return Worlds(
        state=columns,
        vehicles=np.tile(model.vehicles, (n, 1)),
        wheels=np.tile(model.wheels, (n, 1)),
        tick=np.zeros(n, np.int64),
        is_unstable=np.zeros(n, np.bool_),
        throttle=np.zeros((n, v)),
        steering=np.zeros((n, v)),
        recent=np.zeros((n, RECENT, 3), np.int64),
        recent_count=np.zeros(n, np.int64),
        collision_count=np.zeros((n, v), np.int64),
        has_collided=np.zeros((n, v), np.bool_),
        is_off_road=np.zeros((n, v), np.bool_),
        noise=NoiseColumns(
            is_noisy=np.zeros((n, v, len(SENSORS)), np.bool_),
            stream=np.zeros((n, v, len(SENSORS), 3), np.uint64),
            channels=np.zeros((n, v, CHANNELS["range"].stop, 4)),
            bias=np.zeros((n, v, CHANNELS["range"].stop)),
            lidar=np.zeros((n, v, 5)),
        ),
        readings=ReadingColumns(
            time=np.full((n, v, len(SENSORS)), np.nan),
            encoder_ticks=np.zeros((n, v, 2), np.int64),
            encoder_angles=np.zeros((n, v, 2)),
            ips_position=np.zeros((n, v, 3)),
            imu=np.zeros((n, v, 13)),
            lidar_ranges=np.full((n, v, rays), np.nan),
            range_distance=np.full((n, v, 1), np.nan),
            sweep=np.zeros((n, v, 2), np.int64),
            sweep_ranges=np.zeros((n, v, rolling_rays)),
        ),
    )


_NO_SHAPES = {"shape_position": np.zeros((0, 3)), "shape_rotation": np.zeros((0, 9))}


def new_thread(compiled: Compiled, engine: Engine, rays: int) -> Thread:
    """Working memory with that engine, for LIDARs of at most so many rays."""
    shapes = compiled.model.shapes
    return Thread(
        views=engine.views(),
        contacts=vehicle_contacts(len(compiled.vehicles), compiled.contacts.geom_vehicle),
        scratch=scratch(compiled.model, engine.body_count),
        shape_position=shapes.position.copy(),
        shape_rotation=shapes.rotation.copy(),
        sensors=Working(
            before=Poses(
                position=np.zeros((len(compiled.vehicles), 3)),
                orientation=np.zeros((len(compiled.vehicles), 4)),
                shape_position=shapes.position.copy(),
                shape_rotation=shapes.rotation.copy(),
            ),
            near=np.zeros(len(shapes.kind), np.int64),
            inverse_range=np.zeros(rays),
            values=np.zeros(9),
        ),
    )


@inlined
def model_of(k: int, model: Model, worlds: Worlds) -> Model:
    """The Model of world k."""
    return Model(model.dt, model.gravity, worlds.vehicles[k], worlds.wheels[k], model.shapes)


@inlined
def state_of(k: int, worlds: Worlds, thread: Thread) -> State:
    """The State of world k; the poses of its shapes are those of the thread's last world."""
    s = worlds.state
    return State(
        qpos=s.qpos[k],
        qvel=s.qvel[k],
        qacc=s.qacc[k],
        asleep=s.asleep[k],
        vehicle_position=s.vehicle_position[k],
        vehicle_orientation=s.vehicle_orientation[k],
        vehicle_velocity=s.vehicle_velocity[k],
        vehicle_angular_velocity=s.vehicle_angular_velocity[k],
        vehicle_acceleration=s.vehicle_acceleration[k],
        vehicle_angular_acceleration=s.vehicle_angular_acceleration[k],
        throttle=s.throttle[k],
        drive_level=s.drive_level[k],
        steering_target=s.steering_target[k],
        steering_angle=s.steering_angle[k],
        throttle_queue=s.throttle_queue[k],
        steering_queue=s.steering_queue[k],
        wheel_angular_velocity=s.wheel_angular_velocity[k],
        wheel_rotation=s.wheel_rotation[k],
        wheel_steering_angle=s.wheel_steering_angle[k],
        wheel_compression=s.wheel_compression[k],
        wheel_normal_load=s.wheel_normal_load[k],
        wheel_slip_ratio=s.wheel_slip_ratio[k],
        wheel_slip_angle=s.wheel_slip_angle[k],
        wheel_force=s.wheel_force[k],
        wheel_lagged_slip=s.wheel_lagged_slip[k],
        wheel_hold=s.wheel_hold[k],
        shape_position=thread.shape_position,
        shape_rotation=thread.shape_rotation,
    )
