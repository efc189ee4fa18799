"""Samples the sensors of all vehicles of a world but the cameras: compiled code for single worlds and for batches."""

from __future__ import annotations

import math
from typing import Any

from autodrive.base.arrays import Floats
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.base.transforms import Quaternion, Vector
from autodrive.physics.model import Shapes
from autodrive.physics.sensors.columns import (
    ENCODERS,
    IMU,
    IPS,
    LIDAR,
    RANGE,
    Motion,
    NoiseColumns,
    ReadingColumns,
    Working,
)
from autodrive.physics.sensors.encoder import REAR_LEFT, count
from autodrive.physics.sensors.fan import cast_fan
from autodrive.physics.sensors.imu import measure_motion, turn
from autodrive.physics.sensors.ips import measure_position
from autodrive.physics.sensors.lidar import measure
from autodrive.physics.sensors.lidar_noise import classify, measure_with_noise
from autodrive.physics.sensors.noise import corrupt
from autodrive.physics.sensors.range import nearest
from autodrive.physics.sensors.sweep import Timing, cast_sweep
from autodrive.physics.sensors.tables import ABSENT, SensorTables


@jit_uncounted
def sample(
    k: int,
    now: int,
    substeps: int,
    motion: Motion,
    shapes: Shapes,
    noise: NoiseColumns,
    readings: ReadingColumns,
    working: Working,
    sensors: SensorTables,
) -> None:
    """Samples the sensors of world k that are due at `now` [substeps]; a tick has so many `substeps`."""
    numerator, denominator = sensors.substep
    time = now * numerator / denominator
    for i in range(motion.vehicle_position.shape[0]):
        row = sensors.vehicles[i]
        position, orientation = motion.vehicle_position[i], motion.vehicle_orientation[i]
        times, values = readings.time[k, i], readings.values[k, i]
        if _is_due(row, ENCODERS, now, substeps):
            angles = values[0:2]
            for side in range(2):
                angles[side] = motion.wheel_rotation[4 * i + REAR_LEFT + side]
            _add_noise(noise, k, i, ENCODERS, 0, 2, _elapsed(times, ENCODERS, time), angles)
            count(angles, row["ticks_per_radian"], readings.encoder_ticks[k, i])
        if _is_due(row, IPS, now, substeps):
            place = values[2:5]
            measure_position(position, orientation, _position(row, IPS), place)
            _add_noise(noise, k, i, IPS, 2, 5, _elapsed(times, IPS, time), place)
        if _is_due(row, IMU, now, substeps):
            out = values[5:18]
            measure_motion(
                orientation,
                motion.vehicle_angular_velocity[i],
                motion.vehicle_acceleration[i],
                motion.vehicle_angular_acceleration[i],
                _position(row, IMU),
                _orientation(row, IMU),
                row["gravity"],
                out,
            )
            elapsed = _elapsed(times, IMU, time)
            if noise.is_noisy[k, i, IMU]:
                errors = working.values
                for c in range(3):
                    errors[c] = 0.0
                for c in range(6):
                    errors[3 + c] = out[7 + c]
                _add_noise(noise, k, i, IMU, 5, 14, elapsed, errors)
                for c in range(6):
                    out[7 + c] = errors[3 + c]
                turn(out, errors)
        if row["is_rolling"] and now > 0:
            _sweep(
                k,
                i,
                time,
                (now - substeps) * numerator / denominator,
                row,
                motion,
                shapes,
                noise,
                readings,
                working,
                sensors,
            )
        elif _is_due(row, LIDAR, now, substeps):
            times[LIDAR] = time
            first, rays = row["first_ray"], row["rays"]
            inverse_range, ranges = working.inverse_range[:rays], readings.lidar_ranges[k, i, :rays]
            cast_fan(
                position,
                orientation,
                _position(row, LIDAR),
                _orientation(row, LIDAR),
                sensors.cosines[first : first + rays],
                sensors.sines[first : first + rays],
                row["fan_start"],
                row["fan_increment"],
                row["range_max"][LIDAR],
                i,
                shapes,
                motion.shape_position,
                motion.shape_rotation,
                working.near,
                working.views,
                inverse_range,
            )
            if row["is_clockwise"]:
                for a in range(rays // 2):
                    b = rays - 1 - a
                    inverse_range[a], inverse_range[b] = inverse_range[b], inverse_range[a]
            _measure_ranges(k, i, row, noise, inverse_range, ranges)
            if row["is_rolling"]:
                readings.sweep[k, i, 0], readings.sweep[k, i, 1] = 1, 0
        if _is_due(row, RANGE, now, substeps):
            inverse = nearest(
                position,
                orientation,
                _position(row, RANGE),
                _orientation(row, RANGE),
                sensors.directions[row["first_direction"] : row["last_direction"]],
                row["sees_ground"],
                row["range_max"][RANGE],
                i,
                shapes,
                motion.shape_position,
                motion.shape_rotation,
                working.near,
            )
            distance = values[18:19]
            distance[0] = math.inf if inverse == 0.0 else 1.0 / inverse
            _add_noise(noise, k, i, RANGE, 14, 15, _elapsed(times, RANGE, time), distance)
            distance[0] = classify(distance[0], row["range_min"][RANGE], row["range_max"][RANGE])


@inlined
def _sweep(
    k: int,
    i: int,
    time: float,
    time_before: float,
    row: Any,
    motion: Motion,
    shapes: Shapes,
    noise: NoiseColumns,
    readings: ReadingColumns,
    working: Working,
    sensors: SensorTables,
) -> None:
    """Casts the rays of a rolling LIDAR that are due since `time_before`; `working.before` has the poses then.

    The last ray of scan n is cast at n / rate, each earlier ray `time_increment` before the next. Scan 0 is complete at
    the start: the vehicle stood still before it, so all its rays are cast there.
    """
    first, rays = row["first_ray"], row["rays"]
    progress, inverse_range = readings.sweep[k, i], readings.sweep_ranges[k, i, :rays]
    before = working.before
    while True:
        progress[1] = cast_sweep(
            before.position[i],
            before.orientation[i],
            before.shape_position,
            before.shape_rotation,
            motion.vehicle_position[i],
            motion.vehicle_orientation[i],
            motion.shape_position,
            motion.shape_rotation,
            _position(row, LIDAR),
            _orientation(row, LIDAR),
            sensors.ray_cosines[first : first + rays],
            sensors.ray_sines[first : first + rays],
            Timing(row["scan_rate"], row["time_increment"]),
            progress[0],
            progress[1],
            time_before,
            time,
            row["range_max"][LIDAR],
            i,
            shapes,
            working.near,
            inverse_range,
        )
        if progress[1] < rays:
            return
        readings.time[k, i, LIDAR] = progress[0] / row["scan_rate"]
        _measure_ranges(k, i, row, noise, inverse_range, readings.lidar_ranges[k, i, :rays])
        progress[0] += 1
        progress[1] = 0


@inlined
def _measure_ranges(k: int, i: int, row: Any, noise: NoiseColumns, inverse_range: Floats, ranges: Floats) -> None:
    low, high = row["range_min"][LIDAR], row["range_max"][LIDAR]
    if noise.is_noisy[k, i, LIDAR]:
        f, stream = noise.lidar[k, i], noise.stream[k, i, LIDAR]
        measure_with_noise(inverse_range, f[4], stream, (f[0], f[1], f[2], f[3]), low, high, ranges)
    else:
        measure(inverse_range, low, high, ranges)


@inlined
def _is_due(row: Any, s: int, now: int, substeps: int) -> bool:
    """`Schedule.is_due` in the tick that ends `now`; at 0, all sensors are due."""
    samples, per = row["samples"][s], row["substeps"][s]
    return samples != ABSENT and (now == 0 or now * samples // per > (now - substeps) * samples // per)


@inlined
def _position(row: Any, s: int) -> Vector:
    p = row["position"][s]
    return p[0], p[1], p[2]


@inlined
def _orientation(row: Any, s: int) -> Quaternion:
    q = row["orientation"][s]
    return q[0], q[1], q[2], q[3]


@inlined
def _elapsed(times: Floats, s: int, time: float) -> float:
    """Time since the last reading of sensor s [s]; that of the present one is noted."""
    before = times[s]
    times[s] = time
    return max(time - before, 0.0) if time > 0.0 else 0.0


@inlined
def _add_noise(
    noise: NoiseColumns, k: int, i: int, s: int, first: int, last: int, elapsed: float, values: Floats
) -> None:
    """See `corrupt`; `first` to `last` - 1 are the channels of sensor s."""
    if noise.is_noisy[k, i, s]:
        corrupt(values, noise.channels[k, i, first:last], noise.bias[k, i, first:last], noise.stream[k, i, s], elapsed)
