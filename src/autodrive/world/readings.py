"""The rows of worlds as arrays: the state of all vehicles and the latest readings of their sensors."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers, read_only
from autodrive.physics.sensors.catalog import NUMBERS, VALUES
from autodrive.physics.sensors.imu import PARTS
from autodrive.world.columns import Worlds
from autodrive.world.rules.radio import CONTENT, LAMPS, TIME_TO_CHANGE


class Readings(NamedTuple):
    """Read-only arrays with a row for each of n worlds, v vehicles, o movable objects. The next call overwrites them.

    The values are those of the Frames of single worlds; axes, units and frames as in `VehicleFrame`.
    """

    time: Floats
    """Time since the reset of each world [s], shape (n,)."""
    tick: Integers
    """Ticks since the reset of each world, shape (n,)."""
    is_unstable: NDArray[np.bool_]
    """Whether the physics has diverged (`World.step` raises `EngineError`), shape (n,); such a world waits for its
    reset."""
    position: Floats
    """Centre of the rear axle in the map [m], shape (n, v, 3)."""
    orientation: Floats
    """Orientation of the vehicle, quaternion wxyz, map from vehicle, shape (n, v, 4)."""
    velocity: Floats
    """Velocity of the centre of the rear axle in vehicle axes [m/s], shape (n, v, 3)."""
    angular_velocity: Floats
    """Angular velocity of the vehicle in vehicle axes [rad/s], shape (n, v, 3)."""
    throttle: Floats
    """Throttle after the dead time of the drive [-1, 1], shape (n, v)."""
    steering: Floats
    """Steering angle at the middle of the steered axle, left positive [rad], shape (n, v)."""
    wheel_steering_angle: Floats
    """Steering angle of each wheel, left positive [rad], shape (n, v, 4), in the order of `WHEEL_NAMES`."""
    wheel_rotation_angle: Floats
    """Rotation of each wheel since the reset [rad], shape (n, v, 4)."""
    wheel_angular_velocity: Floats
    """Spin of each wheel [rad/s], shape (n, v, 4)."""
    wheel_compression: Floats
    """Compression of the suspension of each wheel [m], shape (n, v, 4)."""
    wheel_normal_load: Floats
    """Load of the ground on each wheel [N], shape (n, v, 4)."""
    wheel_slip_ratio: Floats
    """Longitudinal slip of each wheel, shape (n, v, 4)."""
    wheel_slip_angle: Floats
    """Slip angle of each wheel [rad], shape (n, v, 4)."""
    encoder_time: Floats
    """Time of the latest reading of the encoders [s], shape (n, v)."""
    encoder_ticks: Integers
    """Encoder counts of the left and the right rear wheel, shape (n, v, 2)."""
    encoder_angles: Floats
    """Angles of the left and the right rear wheel [rad], shape (n, v, 2)."""
    ips_time: Floats
    """Time of the latest reading of the IPS [s], shape (n, v)."""
    ips_position: Floats
    """Latest position of the IPS in the map [m], shape (n, v, 3)."""
    imu_time: Floats
    """Time of the latest reading of the IMU [s], shape (n, v)."""
    imu_orientation: Floats
    """Orientation that the IMU measured, quaternion wxyz, map from vehicle, shape (n, v, 4)."""
    imu_euler: Floats
    """Roll, pitch and yaw that the IMU measured [rad], shape (n, v, 3)."""
    imu_angular_velocity: Floats
    """Angular velocity that the IMU measured, in vehicle axes [rad/s], shape (n, v, 3)."""
    imu_linear_acceleration: Floats
    """Linear acceleration that the IMU measured, in vehicle axes [m/s^2], shape (n, v, 3)."""
    lidar_ranges: Floats
    """Ranges of the latest LIDAR scan [m], shape (n, v, most rays of a LIDAR); not a number where a vehicle has
    fewer rays or no LIDAR."""
    lidar_time: Floats
    """Time of the scan [s], shape (n, v); not a number without a LIDAR."""
    range_distance: Floats
    """Latest distance of the range sensor [m], shape (n, v); not a number without one."""
    range_time: Floats
    """Time of the latest reading of the range sensor [s], shape (n, v); not a number without one."""
    collision_count: Integers
    """Collisions since the reset, shape (n, v)."""
    has_collided: NDArray[np.bool_]
    """Whether there was a new collision in the last call of `step`, shape (n, v)."""
    is_off_road: NDArray[np.bool_]
    """Whether a wheel is outside the drivable area, shape (n, v)."""
    red_light_count: Integers
    """Events `RedLight` since the reset, shape (n, v)."""
    stop_sign_count: Integers
    """Events `StopSign` since the reset, shape (n, v)."""
    light_state: Integers
    """`TrafficLightState` of the l traffic lights of the map, as their programs say, shape (n, l)."""
    light_time_to_change: Floats
    """Time until the state of each traffic light changes [s], shape (n, l); not a number if it never changes."""
    heard_vehicles: Floats
    """The latest radio message that each vehicle heard of each other: times of sending and reception [s], position
    x, y, z [m], yaw [rad], speed [m/s], steering [rad], as in `HeardVehicle`, shape (n, v, v, 8). Not a number before
    the first one; without a channel shape (n, v, 0, 8)."""
    heard_lights: Floats
    """The latest radio message that each vehicle heard of each traffic light: times of sending and reception
    [s], place x, y of the light [m], `TrafficLightState`, time to change [s], shape (n, v, l, 6)."""
    object_pose: Floats
    """Position in the map [m] and quaternion wxyz of each movable object, shape (n, o, 7)."""
    sensor_times: Floats
    """Times of all sensors [s]; see `sensor`."""
    sensor_values: Floats
    """Values of all sensors; see `sensor`."""

    def __repr__(self) -> str:
        n, v = self.throttle.shape
        times = f"{self.time.min():.6g} to {self.time.max():.6g} s"
        return f"<Readings of {n} worlds at {times}: {v} vehicles, {self.object_pose.shape[1]} movable objects>"

    def sensor(self, name: str) -> tuple[Floats, Floats]:
        """Time [s], shape (n, v), and values, shape (n, v, n_value), of a sensor of the vehicles' files by its name."""
        return self.sensor_times[..., NUMBERS[name]], self.sensor_values[..., VALUES[name]]


def readings_of(worlds: Worlds, time: Floats, n_object: int) -> Readings:
    """Views of the arrays of `worlds`; `time` [s] is kept by the caller."""
    s, r = worlds.state, worlds.readings
    orientation, euler, angular_velocity, linear_acceleration = (r.values[..., VALUES["imu"]][..., p] for p in PARTS)
    n, v = worlds.throttle.shape
    wheels = {
        "wheel_steering_angle": s.wheel_steering_angle,
        "wheel_rotation_angle": s.wheel_rotation,
        "wheel_angular_velocity": s.wheel_angular_velocity,
        "wheel_compression": s.wheel_compression,
        "wheel_normal_load": s.wheel_normal_load,
        "wheel_slip_ratio": s.wheel_slip_ratio,
        "wheel_slip_angle": s.wheel_slip_angle,
    }
    objects = s.qpos[:, : 7 * n_object].reshape(n, n_object, 7)  # the objects come before the vehicles
    readings = Readings(
        time=time,
        tick=worlds.tick,
        is_unstable=worlds.is_unstable,
        position=s.vehicle_position,
        orientation=s.vehicle_orientation,
        velocity=s.vehicle_velocity,
        angular_velocity=s.vehicle_angular_velocity,
        throttle=s.throttle,
        steering=s.steering_angle,
        **{name: column.reshape(n, v, 4) for name, column in wheels.items()},
        encoder_time=r.time[..., NUMBERS["encoders"]],
        encoder_ticks=r.encoder_ticks,
        encoder_angles=r.values[..., VALUES["encoders"]],
        ips_time=r.time[..., NUMBERS["ips"]],
        ips_position=r.values[..., VALUES["ips"]],
        imu_time=r.time[..., NUMBERS["imu"]],
        imu_orientation=orientation,
        imu_euler=euler,
        imu_angular_velocity=angular_velocity,
        imu_linear_acceleration=linear_acceleration,
        lidar_ranges=r.lidar_ranges,
        lidar_time=r.time[..., NUMBERS["lidar"]],
        range_distance=r.values[..., VALUES["range"].start],
        range_time=r.time[..., NUMBERS["range"]],
        collision_count=worlds.rules.collisions.total,
        has_collided=worlds.rules.collisions.has_collided,
        is_off_road=worlds.rules.road.is_off_road,
        red_light_count=worlds.rules.stop_lines.red_light_count,
        stop_sign_count=worlds.rules.stop_lines.stop_sign_count,
        light_state=worlds.rules.lights.state,
        light_time_to_change=worlds.rules.lights.time_to_change,
        heard_vehicles=worlds.rules.radio.heard[:, :, :v, : CONTENT + LAMPS],
        heard_lights=worlds.rules.radio.heard[:, :, v:, : CONTENT + TIME_TO_CHANGE + 1],
        object_pose=objects,
        sensor_times=r.time,
        sensor_values=r.values,
    )
    return Readings(*map(_read_only_view, readings))


def _read_only_view(array: NDArray[Any]) -> NDArray[Any]:
    return read_only(array.view())
