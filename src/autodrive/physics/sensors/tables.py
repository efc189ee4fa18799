"""Parameters of the sensors of all vehicles but the cameras, as tables of numbers, and their noise at reset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from autodrive.base.arrays import Integers
from autodrive.physics.model import columns as table_columns
from autodrive.physics.sensors.catalog import ALWAYS_READ, KINDS, NOISY_VALUES, NUMBERS, SENSORS, VALUES
from autodrive.physics.sensors.columns import NoiseColumns, ReadingColumns, SensorTables
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.lidar.weather import WEATHER, WIDTH
from autodrive.physics.sensors.random_stream import new_stream, normal
from autodrive.physics.sensors.sensor import Mount, Schedule, random_generator
from autodrive.physics.sensors.settings import ConfiguredSensor

VEHICLE_SENSORS = table_columns(
    samples=(np.int64, len(SENSORS)),  # `Schedule.samples` of each sensor; ABSENT: no such sensor
    substeps=(np.int64, len(SENSORS)),  # `Schedule.substeps`
    position=(np.float64, (len(SENSORS), 3)),  # of its mount [m]
    orientation=(np.float64, (len(SENSORS), 4)),  # of its mount, vehicle from sensor
    first=(np.int64, len(SENSORS)),  # of its rays in `SensorTables.rays`
    last=(np.int64, len(SENSORS)),  # the one after its last ray
    **{name: type_ for kind in KINDS.values() for name, type_ in kind.COLUMNS.items()},
)
"""Columns of `SensorTables.vehicles`."""

ABSENT = -1


def sensor_tables(
    vehicles: Sequence[Mapping[str, ConfiguredSensor]], substep: Fraction, gravity: float, targets: Integers
) -> SensorTables:
    """The tables of the sensors of each vehicle by name; `substep` [s] is the unit of simulated time.

    `gravity` [m/s^2], positive downward, is that of an IMU that measures the specific force. `targets`: see
    `SensorTables`.
    """
    table = np.zeros(len(vehicles), VEHICLE_SENSORS)
    rays = [np.zeros((4, 0))]
    for row, sensors in zip(table, vehicles, strict=True):
        row["samples"] = ABSENT
        for s, sensor in enumerate(SENSORS):
            if sensor not in sensors or not (sensors[sensor].is_on or sensor in ALWAYS_READ):
                continue
            spec = sensors[sensor].spec
            row["samples"][s], row["substeps"][s] = _schedule(spec, sensors[sensor].is_on, substep)
            mount = getattr(spec, "mount", Mount())
            row["position"][s], row["orientation"][s] = mount.position, mount.orientation
            row["first"][s] = sum(fan.shape[1] for fan in rays)
            rays.append(spec.ray_constants())
            row["last"][s] = sum(fan.shape[1] for fan in rays)
            for name, value in spec.parameters(gravity).items():
                row[name] = value
    return SensorTables(
        substep=(substep.numerator, substep.denominator),
        vehicles=table,
        rays=np.concatenate(rays, axis=1),
        targets=targets,
    )


def starting_only(tables: SensorTables, starting: Sequence[tuple[int, int]]) -> SensorTables:
    """Tables for one call of `sample` that samples only these sensors: numbers of the vehicle and of the sensor."""
    vehicles = tables.vehicles.copy()
    vehicles["samples"], vehicles["is_rolling"] = ABSENT, False
    for i, s in starting:
        vehicles[i]["samples"][s] = vehicles[i]["substeps"][s] = 1
    return tables._replace(vehicles=vehicles)


def most_rays(tables: SensorTables) -> tuple[int, int]:
    """Most rays of a LIDAR, and of a rolling one."""
    table, s = tables.vehicles, NUMBERS["lidar"]
    rays = table["last"][:, s] - table["first"][:, s]
    return int(rays.max(initial=0)), int((rays * table["is_rolling"]).max(initial=0))


def _schedule(spec: Any, is_on: bool, substep: Fraction) -> tuple[int, int]:
    """Samples per substep; one at the start of a sensor that is off, and one in each substep without a rate."""
    if not is_on:
        return 0, 1
    if spec.rate is None or getattr(spec, "is_rolling", False):
        return 1, 1
    schedule = Schedule.of(spec.rate, substep)
    return schedule.samples, schedule.substeps


def set_noise(columns: NoiseColumns, k: int, i: int, specs: Mapping[str, Any], factor: float) -> None:
    """Sets the parameters of the noise of vehicle i of world k to those of its sensors, times `factor`."""
    columns.is_noisy[k, i] = False
    for s, sensor in enumerate(SENSORS):
        if sensor not in specs:
            continue
        spec = specs[sensor].with_noise_factor(factor)
        rows = spec.channel_noise()
        if rows:
            columns.is_noisy[k, i, s] = not all(noise.is_silent for noise in rows)
            columns.channels[k, i, NOISY_VALUES[sensor]] = [
                (noise.sigma, noise.offset, noise.walk, noise.step) for noise in rows
            ]
        if isinstance(spec, LidarSpec):
            noise = spec.noise
            columns.is_noisy[k, i, s] = noise != type(noise)()
            columns.lidar[k, i, :5] = noise.sigma, noise.relative_sigma, noise.step, noise.dropout, noise.scale


def start_noise(columns: NoiseColumns, k: int, i: int, name: str, seed: int) -> None:
    """Sets the noise of vehicle i of world k, which has this `name`, to its start; ends its weather.

    Each sensor has a random stream, which depends on `seed`, `name` and the name of the sensor.
    """
    columns.lidar[k, i, WEATHER:], columns.stream[k, i, -1] = 0.0, 0
    for s in np.flatnonzero(columns.is_noisy[k, i]).tolist():
        sensor, stream = SENSORS[s], columns.stream[k, i, s]
        stream[:] = new_stream(random_generator(seed, name, sensor))
        offsets = columns.channels[k, i, NOISY_VALUES[sensor], 1].tolist()
        columns.bias[k, i, NOISY_VALUES[sensor]] = [offset * normal(stream) for offset in offsets]
        if KINDS[sensor] is LidarSpec:
            columns.lidar[k, i, 5] = 1.0 + columns.lidar[k, i, 4] * normal(stream)


def noise_columns(n: int, v: int) -> NoiseColumns:
    """No noise yet; see `set_noise` and `start_noise`."""
    sensors, channels = len(SENSORS), NOISY_VALUES[SENSORS[-1]].stop
    return NoiseColumns(
        is_noisy=np.zeros((n, v, sensors), np.bool_),
        stream=np.zeros((n, v, sensors + 1, 3), np.uint64),
        channels=np.zeros((n, v, channels, 4)),
        bias=np.zeros((n, v, channels)),
        lidar=np.zeros((n, v, WEATHER + WIDTH)),
    )


def reading_columns(n: int, v: int, rays: int, rolling_rays: int) -> ReadingColumns:
    """No readings yet, for LIDARs, and rolling ones, of at most so many rays."""
    return ReadingColumns(
        time=np.full((n, v, len(SENSORS)), np.nan),
        values=np.full((n, v, VALUES[SENSORS[-1]].stop), np.nan),
        encoder_ticks=np.zeros((n, v, 2), np.int64),
        lidar_ranges=np.full((n, v, rays), np.nan),
        sweep=np.zeros((n, v, 2), np.int64),
        sweep_ranges=np.zeros((n, v, rolling_rays)),
        sweep_hits=np.zeros((n, v, rolling_rays), np.int64),
    )
