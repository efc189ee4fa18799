"""2D LIDAR: ranges in the x-y plane of the sensor frame to everything except its own vehicle (report, table 7)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.base.arrays import Floats, Integers, read_only, read_only_copy
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import inlined
from autodrive.base.transforms import Quaternion, compose, inverse, rotate
from autodrive.physics.sensors.columns import (
    Due,
    Memory,
    ReadingColumns,
    mount_orientation,
    mount_position,
    poses_of,
)
from autodrive.physics.sensors.lidar.fan import cast_fan
from autodrive.physics.sensors.lidar.noise import RPLIDAR_A1M8, LidarNoise, classify, measure_with_noise
from autodrive.physics.sensors.lidar.sweep import RollingScan, Timing, cast_sweep
from autodrive.physics.sensors.lidar.weather import THRESHOLD, WEATHER, pass_weather
from autodrive.physics.sensors.sensor import STRONG, Distance, Mount, NoisePreset, NoisySpec, Rate, Reader, Sampled
from autodrive.protocol.messages import LidarScan


@inlined
def sample(due: Due, values: Floats, row: Any, memory: Memory) -> None:
    """All rays of a scan; of a rolling LIDAR, those that are due since the tick before."""
    k, i = due.k, due.i
    if row["is_rolling"] and due.now > 0:
        _sweep(due, row, memory)
        return
    first, last = row["first"][due.s], row["last"][due.s]
    rays = last - first
    inverse_range, hits = memory.working.inverse_range[:rays], memory.working.hits[:rays]
    is_weather = memory.noise.lidar[k, i, WEATHER + THRESHOLD] > 0.0
    cast_fan(
        memory.motion.vehicle_position[i],
        memory.motion.vehicle_orientation[i],
        mount_position(due, row),
        _orientation(due, row, memory),
        memory.sensors.rays[0, first:last],
        memory.sensors.rays[1, first:last],
        row["fan_start"],
        row["fan_increment"],
        row["scan_range_max"],
        i,
        memory.shapes,
        memory.motion.shape_position,
        memory.motion.shape_rotation,
        memory.working.near,
        memory.working.views,
        inverse_range,
        hits if is_weather else hits[:0],
    )
    if row["is_clockwise"]:
        for a in range(rays // 2):
            b = rays - 1 - a
            inverse_range[a], inverse_range[b] = inverse_range[b], inverse_range[a]
            hits[a], hits[b] = hits[b], hits[a]
    _measure_ranges(due, row, memory, due.time, inverse_range, hits)
    if row["is_rolling"]:
        memory.readings.sweep[k, i, 0], memory.readings.sweep[k, i, 1] = 1, 0


@inlined
def _orientation(due: Due, row: Any, memory: Memory) -> Quaternion:
    """Vehicle from sensor; a level LIDAR is turned so that its z axis is vertical and its x axis keeps its heading."""
    orientation = mount_orientation(due, row)
    if not row["is_level"]:
        return orientation
    vehicle = memory.motion.vehicle_orientation[due.i]
    ahead = rotate(compose(vehicle, orientation), (1.0, 0.0, 0.0))
    length = math.sqrt(ahead[0] * ahead[0] + ahead[1] * ahead[1])
    if length < 1e-9:
        return orientation
    cosine = max(-1.0, min(1.0, ahead[0] / length))
    half_sine = math.copysign(math.sqrt(0.5 * (1.0 - cosine)), ahead[1])
    return compose(inverse(vehicle), (math.sqrt(0.5 * (1.0 + cosine)), 0.0, 0.0, half_sine))


@inlined
def _sweep(due: Due, row: Any, memory: Memory) -> None:
    """Casts the rays of a rolling LIDAR that are due in the tick; `working.before` has the poses at its start.

    The last ray of scan n is cast at n / rate, each earlier ray `time_increment` before the next. Scan 0 is complete at
    the start: the vehicle stood still before it, so all its rays are cast there.
    """
    k, i = due.k, due.i
    first, last = row["first"][due.s], row["last"][due.s]
    rays = last - first
    progress, inverse_range = memory.readings.sweep[k, i], memory.readings.sweep_ranges[k, i, :rays]
    numerator, denominator = memory.sensors.substep
    time_before = (due.now - due.substeps) * numerator / denominator
    scan = RollingScan(
        vehicle=i,
        mount_position=mount_position(due, row),
        mount_orientation=mount_orientation(due, row),
        cosines=memory.sensors.rays[2, first:last],
        sines=memory.sensors.rays[3, first:last],
        range_max=row["scan_range_max"],
        inverse_range=inverse_range,
        hits=memory.readings.sweep_hits[k, i, :rays],
    )
    timing, before, after = (
        Timing(row["scan_rate"], row["time_increment"]),
        memory.working.before,
        poses_of(memory.motion),
    )
    shapes, near = memory.shapes, memory.working.near
    while True:
        progress[1] = cast_sweep(
            scan, timing, progress[0], progress[1], before, time_before, after, due.time, shapes, near
        )
        if progress[1] < rays:
            return
        _measure_ranges(due, row, memory, progress[0] / timing.rate, inverse_range, scan.hits)
        progress[0] += 1
        progress[1] = 0


@inlined
def _measure_ranges(due: Due, row: Any, memory: Memory, time: float, inverse_range: Floats, hits: Integers) -> None:
    """Writes the ranges of a scan that was complete at `time` [s]; `hits`: see `Working`."""
    weather = memory.noise.lidar[due.k, due.i, WEATHER:]
    if weather[THRESHOLD] > 0.0:
        streams = memory.noise.stream[due.k, due.i]
        pass_weather(inverse_range, hits, memory.sensors.targets, weather, streams[len(streams) - 1])
    noise, low, high = memory.noise, row["scan_range_min"], row["scan_range_max"]
    memory.readings.time[due.k, due.i, due.s] = time
    ranges = memory.readings.lidar_ranges[due.k, due.i, : len(inverse_range)]
    if noise.is_noisy[due.k, due.i, due.s]:
        f, stream = noise.lidar[due.k, due.i], noise.stream[due.k, due.i, due.s]
        measure_with_noise(inverse_range, f[5], stream, (f[0], f[1], f[2], f[3]), low, high, ranges)
    else:
        for n in range(len(ranges)):
            ranges[n] = classify(1.0 / inverse_range[n], low, high)


class LidarSpec(NoisySpec, Sampled):
    """A scanning range finder; by default the RPLIDAR A1 of the report.

    The rays cover one revolution, or `angle_min_deg` to `angle_max_deg`, or are `angle_increment_deg` apart. Ray 0 has
    the bearing `angle_min_deg`; 0 is straight ahead. The index increases to the left, or to the right if angle_max is
    below angle_min or the increment is negative.
    """

    COLUMNS: ClassVar[Mapping[str, Any]] = {
        "is_clockwise": np.bool_,  # the index of its rays increases to the right
        "is_rolling": np.bool_,  # it casts its rays one after another
        "is_level": np.bool_,  # its rays stay horizontal
        "scan_rate": np.float64,  # [Hz]
        "time_increment": np.float64,  # between its rays [s]
        "fan_start": np.float64,  # bearing of its rightmost ray [rad]
        "fan_increment": np.float64,  # [rad]
        "scan_range_min": np.float64,  # [m]
        "scan_range_max": np.float64,  # [m]
    }
    sample: ClassVar[Any] = sample

    mount: Mount = Mount()
    """Centre and axes of the scan."""
    rate: Rate = 7.0
    """Scan rate [Hz]; the first scan is complete at the start."""
    rays: int = Field(default=360, ge=1, le=10_000)
    """Number of rays in a scan."""
    angle_min_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Bearing of the first ray [deg], left positive."""
    angle_max_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Bearing of the last ray [deg]."""
    angle_increment_deg: float | None = Field(default=None, ge=-360.0, le=360.0)
    """Angle between successive rays [deg]; alternative to `angle_max_deg`."""
    range_min: Distance = 0.15
    """A smaller range [m] is reported as -inf (REP 117)."""
    range_max: Distance = 12.0
    """A greater range [m] is reported as +inf (REP 117)."""
    rated_reflectivity: float = Field(default=0.1, ge=1e-3, le=1.0)
    """Reflectivity of the darkest surface that it detects at `range_max` in clear air; only weather makes use of it."""
    intensity: float = Field(default=47.0, ge=0.0, le=1e6)
    """Constant value that is reported for every ray."""
    is_rolling: bool = False
    """False: all rays at one instant. True: each ray at its own time; the head makes one revolution per period."""
    is_level: bool = False
    """True: the rays stay horizontal and follow the heading of the sensor only, as in the published program."""
    noise: LidarNoise = LidarNoise()
    """Noise of the ranges; `realistic`: that of the data sheet."""
    data_sheet: LidarNoise = RPLIDAR_A1M8
    """Noise of the data sheet, which the preset `realistic` of a scenario selects; by default of the RPLIDAR A1M8."""

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        if isinstance(value, dict) and value.get("noise") == "realistic":
            return value | {"noise": value.get("data_sheet", RPLIDAR_A1M8)}
        return value

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.is_level and self.is_rolling:
            raise ValueError("a LIDAR is is_level or is_rolling, not both: level rays are cast at one instant")
        if self.range_max <= self.range_min:
            raise ValueError(f"range_max {self.range_max:g} m must be above range_min {self.range_min:g} m")
        if self.angle_max_deg is not None and self.angle_increment_deg is not None:
            raise ValueError("a LIDAR takes angle_max_deg or angle_increment_deg, not both")
        if self.angle_max_deg is not None and self.rays == 1:
            raise ValueError("a LIDAR with one ray takes angle_min_deg only, not angle_max_deg")
        if abs(self.angle_increment) < 1e-6:
            raise ValueError("the angle between the rays must not be 0: it must be at least 1e-6 rad, or 6e-5 deg")
        if abs(self.angle_increment) * (self.rays - 1) > 2.0 * math.pi * (1.0 + 1e-9):
            spread = math.degrees(abs(self.angle_increment) * (self.rays - 1))
            raise ValueError(f"the rays must cover at most 360 deg, not {spread:g} deg")
        return self

    @property
    def angle_min(self) -> float:
        """Bearing of ray 0 [rad]."""
        return math.radians(self.angle_min_deg)

    @property
    def angle_increment(self) -> float:
        """Angle between successive rays [rad]."""
        if self.angle_max_deg is not None:
            return math.radians(self.angle_max_deg - self.angle_min_deg) / (self.rays - 1)
        if self.angle_increment_deg is not None:
            return math.radians(self.angle_increment_deg)
        return 2.0 * math.pi / self.rays

    @property
    def time_increment(self) -> float:
        """Time between successive rays [s]; 0 if all are cast at one instant."""
        return abs(self.angle_increment) / (2.0 * math.pi * self.rate) if self.is_rolling else 0.0

    @property
    def noises(self) -> dict[NoisePreset, LidarNoise]:
        """The realistic one is that of its data sheet."""
        return {"ideal": LidarNoise(), "realistic": self.data_sheet, "strong": self.data_sheet.scaled(STRONG)}

    @property
    def bearings(self) -> Floats:
        """Bearings of the rays [rad], shape (n_ray,)."""
        return self.angle_min + self.angle_increment * np.arange(self.rays, dtype=np.float64)

    def parameters(self, gravity: float) -> dict[str, Any]:
        """Values of this sensor's columns in `SensorTables.vehicles`, by name."""
        return {
            "is_clockwise": self.angle_increment < 0.0,
            "is_rolling": self.is_rolling,
            "is_level": self.is_level,
            "scan_rate": self.rate,
            "time_increment": self.time_increment,
            "fan_start": self.bearings.min(),
            "fan_increment": abs(self.angle_increment),
            "scan_range_min": self.range_min,
            "scan_range_max": self.range_max,
        }

    def ray_constants(self) -> Floats:
        """Cosines and sines of the rays from right to left, then in the order of their index."""
        fan = self.bearings
        ordered = fan if (np.diff(fan) >= 0.0).all() else fan[::-1]
        return np.array(
            [
                [function(bearing) for bearing in bearings.tolist()]
                for bearings in (ordered, fan)
                for function in (cos, sin)
            ]
        )

    def reader(self, readings: ReadingColumns, vehicle: int, first: int) -> Reader:
        """The function that makes a `LidarScan` from time and values, see `Sampled.reader`."""
        ranges, constants = readings.lidar_ranges[0, vehicle, : self.rays], scan_constants(self)
        return lambda time, values: LidarScan(time, read_only_copy(ranges), *constants)


def scan_constants(spec: LidarSpec) -> tuple[Any, ...]:
    """The fields of a `LidarScan` that are the same in every scan: all after `ranges`."""
    return (
        read_only(np.full(spec.rays, spec.intensity)),
        spec.angle_min,
        spec.angle_increment,
        spec.range_min,
        spec.range_max,
        spec.rate,
        1.0 / spec.rate,
        spec.time_increment,
    )
