"""The sensors of all vehicles of a batch but the cameras: their parameters as tables, noise at reset, and sampling."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from autodrive.arrays import Floats
from autodrive.batch.columns import (
    CHANNELS,
    ENCODERS,
    IMU,
    IPS,
    LIDAR,
    RANGE,
    SENSORS,
    NoiseColumns,
    ReadingColumns,
    Working,
)
from autodrive.compile import Compiled
from autodrive.elementary import cos, sin
from autodrive.jit import inlined, jit_uncounted
from autodrive.model import Shapes, Table
from autodrive.model import columns as table_columns
from autodrive.sensors.catalog import ALWAYS_READ
from autodrive.sensors.encoder import REAR_LEFT, EncoderSpec, count
from autodrive.sensors.fan import cast_fan
from autodrive.sensors.imu import ImuSpec, measure_motion, turn
from autodrive.sensors.ips import IpsSpec, measure_position
from autodrive.sensors.lidar import LidarSpec, measure
from autodrive.sensors.lidar_noise import classify, measure_with_noise
from autodrive.sensors.noise import NoiseSpec, corrupt
from autodrive.sensors.random_stream import new_stream, normal
from autodrive.sensors.range import RangeSpec, directions, nearest
from autodrive.sensors.sensor import Mount, Schedule, random_generator
from autodrive.sensors.settings import SensorSpecs, with_noise_factor
from autodrive.sensors.sweep import Timing, cast_sweep
from autodrive.state import State
from autodrive.transforms import Quaternion, Vector

VEHICLE_SENSORS = table_columns(
    samples=(np.int64, len(SENSORS)),  # `Schedule.samples` of each sensor; ABSENT: no such sensor
    substeps=(np.int64, len(SENSORS)),  # `Schedule.substeps`
    position=(np.float64, (len(SENSORS), 3)),  # of its mount [m]
    orientation=(np.float64, (len(SENSORS), 4)),  # of its mount, vehicle from sensor
    ticks_per_radian=np.float64,  # of the encoders
    gravity=np.float64,  # that the IMU adds [m/s^2]
    first_ray=np.int64,  # of the LIDAR, in `SensorTables.cosines`
    rays=np.int64,  # of the LIDAR
    is_clockwise=np.bool_,  # the index of its rays increases to the right
    is_rolling=np.bool_,  # it casts its rays one after another
    scan_rate=np.float64,  # [Hz]
    time_increment=np.float64,  # between its rays [s]
    fan_start=np.float64,  # bearing of its rightmost ray [rad]
    fan_increment=np.float64,  # [rad]
    range_min=(np.float64, len(SENSORS)),  # of the LIDAR and the range sensor [m]
    range_max=(np.float64, len(SENSORS)),  # likewise
    first_direction=np.int64,  # of the range sensor, in `SensorTables.directions`
    last_direction=np.int64,  # the one after its last
    sees_ground=np.bool_,  # whether the range sensor does
)
"""Columns of `SensorTables.vehicles`."""

ABSENT = -1


class SensorTables(NamedTuple):
    """Constant parameters of the sensors."""

    substep: tuple[int, int]
    """Numerator and denominator of its duration [s]."""
    vehicles: Table
    """Columns `VEHICLE_SENSORS`, shape (v,)."""
    cosines: Floats
    """Of the rays of all LIDARs, each from right to left; likewise the next one."""
    sines: Floats
    ray_cosines: Floats
    """Likewise, each in the order of its index."""
    ray_sines: Floats
    directions: Floats
    """Rays of all range sensors in their own axes, shape (n_ray, 3)."""


def sensor_tables(compiled: Compiled) -> SensorTables:
    """The tables of a scenario."""
    table = np.zeros(len(compiled.vehicles), VEHICLE_SENSORS)
    substep = Fraction(str(compiled.spec.substep))
    bearings: list[Floats] = [np.zeros(0)]
    cones: list[Floats] = [np.zeros((0, 3))]
    for row, sensors in zip(table, compiled.configured.values(), strict=True):
        row["samples"] = ABSENT
        for s, sensor in enumerate(SENSORS):
            if sensor not in sensors or not (sensors[sensor].is_on or sensor in ALWAYS_READ):
                continue
            spec = sensors[sensor].spec
            row["samples"][s], row["substeps"][s] = _schedule(spec, sensors[sensor].is_on, substep)
            mount = getattr(spec, "mount", Mount())
            row["position"][s], row["orientation"][s] = mount.position, mount.orientation
            match spec:
                case EncoderSpec():
                    row["ticks_per_radian"] = spec.ticks_per_radian
                case ImuSpec():
                    row["gravity"] = compiled.spec.gravity if spec.measures_specific_force else 0.0
                case LidarSpec():
                    row["is_rolling"], row["scan_rate"] = spec.is_rolling, spec.rate
                    row["time_increment"] = spec.time_increment
                    row["first_ray"], row["rays"] = sum(map(len, bearings)), spec.rays
                    row["is_clockwise"] = spec.angle_increment < 0.0
                    row["fan_increment"] = abs(spec.angle_increment)
                    fan: Floats = spec.angle_min + spec.angle_increment * np.arange(spec.rays, dtype=np.float64)
                    row["fan_start"] = fan.min()
                    bearings.append(fan)
                    row["range_min"][s], row["range_max"][s] = spec.range_min, spec.range_max
                case RangeSpec():
                    row["first_direction"] = sum(map(len, cones))
                    cones.append(directions(math.radians(spec.field_of_view_deg), spec.rings))
                    row["last_direction"] = sum(map(len, cones))
                    row["sees_ground"] = spec.sees_ground
                    row["range_min"][s], row["range_max"][s] = spec.range_min, spec.range_max
                case _:
                    pass
    fans = [fan if (np.diff(fan) >= 0.0).all() else fan[::-1] for fan in bearings]
    return SensorTables(
        substep=(substep.numerator, substep.denominator),
        vehicles=table,
        cosines=_each(cos, fans),
        sines=_each(sin, fans),
        ray_cosines=_each(cos, bearings),
        ray_sines=_each(sin, bearings),
        directions=np.concatenate(cones),
    )


def _each(function: Callable[[float], float], angles: Sequence[Floats]) -> Floats:
    return np.array([function(angle) for angle in np.concatenate(angles).tolist()])


def _schedule(spec: Any, is_on: bool, substep: Fraction) -> tuple[int, int]:
    """Samples per substep; one at the start of a sensor that is off, and one in each substep without a rate."""
    if not is_on:
        return 0, 1
    if spec.rate is None or getattr(spec, "is_rolling", False):
        return 1, 1
    schedule = Schedule.of(spec.rate, substep)
    return schedule.samples, schedule.substeps


def reset_noise(
    columns: NoiseColumns, k: int, i: int, name: str, specs: Mapping[str, SensorSpecs], factor: float, seed: int
) -> None:
    """Sets the noise of vehicle i of world k, which has this `name`, to its start; see `SensorSuite.reset`."""
    columns.is_noisy[k, i] = False
    for s, sensor in enumerate(SENSORS):
        if sensor not in specs:
            continue
        spec = with_noise_factor(specs[sensor], factor)
        rows: list[NoiseSpec] = []
        match spec:
            case LidarSpec():
                noise = spec.noise
                columns.is_noisy[k, i, s] = noise != type(noise)()
                columns.lidar[k, i, :4] = noise.sigma, noise.relative_sigma, noise.step, noise.dropout
            case ImuSpec():
                noise = spec.noise
                rows = [noise.orientation] * 3 + [noise.angular_velocity] * 3 + [noise.linear_acceleration] * 3
            case EncoderSpec() | IpsSpec() | RangeSpec():
                rows = [spec.noise] * (CHANNELS[sensor].stop - CHANNELS[sensor].start)
            case _:
                pass
        if rows:
            columns.is_noisy[k, i, s] = not all(one.is_silent for one in rows)
            columns.channels[k, i, CHANNELS[sensor]] = [(one.sigma, one.offset, one.walk, one.step) for one in rows]
        if not columns.is_noisy[k, i, s]:
            continue
        stream = columns.stream[k, i, s]
        stream[:] = new_stream(random_generator(seed, name, sensor))
        if isinstance(spec, LidarSpec):
            columns.lidar[k, i, 4] = 1.0 + spec.noise.scale * normal(stream)
        else:
            columns.bias[k, i, CHANNELS[sensor]] = [one.offset * normal(stream) for one in rows]


@jit_uncounted
def sample(
    k: int,
    now: int,
    substeps: int,
    state: State,
    shapes: Shapes,
    noise: NoiseColumns,
    readings: ReadingColumns,
    working: Working,
    sensors: SensorTables,
) -> None:
    """Samples the sensors of world k that are due at `now` [substeps]; a tick has so many `substeps`."""
    numerator, denominator = sensors.substep
    time = now * numerator / denominator
    for i in range(state.vehicle_position.shape[0]):
        row = sensors.vehicles[i]
        position, orientation = state.vehicle_position[i], state.vehicle_orientation[i]
        times = readings.time[k, i]
        if _is_due(row, ENCODERS, now, substeps):
            angles = readings.encoder_angles[k, i]
            for side in range(2):
                angles[side] = state.wheel_rotation[4 * i + REAR_LEFT + side]
            _add_noise(noise, k, i, ENCODERS, 0, 2, _elapsed(times, ENCODERS, time), angles)
            count(angles, row["ticks_per_radian"], readings.encoder_ticks[k, i])
        if _is_due(row, IPS, now, substeps):
            values = readings.ips_position[k, i]
            measure_position(position, orientation, _position(row, IPS), values)
            _add_noise(noise, k, i, IPS, 2, 5, _elapsed(times, IPS, time), values)
        if _is_due(row, IMU, now, substeps):
            out = readings.imu[k, i]
            measure_motion(
                orientation,
                state.vehicle_angular_velocity[i],
                state.vehicle_acceleration[i],
                state.vehicle_angular_acceleration[i],
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
                state,
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
                state.shape_position,
                state.shape_rotation,
                working.near,
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
                state.shape_position,
                state.shape_rotation,
                working.near,
            )
            distance = readings.range_distance[k, i]
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
    state: State,
    shapes: Shapes,
    noise: NoiseColumns,
    readings: ReadingColumns,
    working: Working,
    sensors: SensorTables,
) -> None:
    """Casts the rays of a LIDAR that are due since `time_before`; see `RollingLidar`."""
    first, rays = row["first_ray"], row["rays"]
    progress, inverse_range = readings.sweep[k, i], readings.sweep_ranges[k, i, :rays]
    before = working.before
    while True:
        progress[1] = cast_sweep(
            before.position[i],
            before.orientation[i],
            before.shape_position,
            before.shape_rotation,
            state.vehicle_position[i],
            state.vehicle_orientation[i],
            state.shape_position,
            state.shape_rotation,
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
    """See `Noise.add`; `first` to `last` - 1 are the channels of sensor s."""
    if noise.is_noisy[k, i, s]:
        corrupt(values, noise.channels[k, i, first:last], noise.bias[k, i, first:last], noise.stream[k, i, s], elapsed)
