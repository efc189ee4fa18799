"""Parameters of the sensors of all vehicles but the cameras, as tables of numbers, and their noise at reset."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.physics.model import Table
from autodrive.physics.model import columns as table_columns
from autodrive.physics.sensors.catalog import ALWAYS_READ
from autodrive.physics.sensors.columns import CHANNELS, SENSORS, NoiseColumns
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar import LidarSpec
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.random_stream import new_stream, normal
from autodrive.physics.sensors.range import RangeSpec, directions
from autodrive.physics.sensors.sensor import Mount, Schedule, random_generator
from autodrive.physics.sensors.settings import ConfiguredSensor, SensorSpecs, with_noise_factor

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


def sensor_tables(
    vehicles: Sequence[Mapping[str, ConfiguredSensor]], substep: Fraction, gravity: float
) -> SensorTables:
    """The tables of the sensors of each vehicle by name; `substep` [s] is the unit of simulated time.

    `gravity` [m/s^2], positive downward, is that of an IMU that measures the specific force.
    """
    table = np.zeros(len(vehicles), VEHICLE_SENSORS)
    bearings: list[Floats] = [np.zeros(0)]
    cones: list[Floats] = [np.zeros((0, 3))]
    for row, sensors in zip(table, vehicles, strict=True):
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
                    row["gravity"] = gravity if spec.measures_specific_force else 0.0
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


def starting_only(tables: SensorTables, starting: Sequence[tuple[int, int]]) -> SensorTables:
    """Tables for one call of `sample` that samples only these sensors: numbers of the vehicle and of the sensor."""
    vehicles = tables.vehicles.copy()
    vehicles["samples"], vehicles["is_rolling"] = ABSENT, False
    for i, s in starting:
        vehicles[i]["samples"][s] = vehicles[i]["substeps"][s] = 1
    return tables._replace(vehicles=vehicles)


def most_rays(tables: SensorTables) -> tuple[int, int]:
    """Of a LIDAR, and of a rolling one."""
    table = tables.vehicles
    return int(table["rays"].max(initial=0)), int((table["rays"] * table["is_rolling"]).max(initial=0))


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
    """Sets the noise of vehicle i of world k, which has this `name`, to its start.

    Each sensor has a random stream, which depends on `seed`, `name` and the name of the sensor.
    """
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
