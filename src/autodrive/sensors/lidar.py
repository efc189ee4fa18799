"""2D LIDAR: ranges in the x-y plane of the sensor frame to everything except its own vehicle (report, table 7)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from autodrive.arrays import Floats
from autodrive.elementary import cos, sin
from autodrive.jit import jit_uncounted, resolved
from autodrive.model import Shapes
from autodrive.protocol.messages import LidarScan
from autodrive.sensors.fan import cast_fan
from autodrive.sensors.lidar_noise import LidarErrors, LidarNoise, classify
from autodrive.sensors.sensor import Distance, Mount, Rate, Sensor
from autodrive.sensors.sweep import PoseSnapshot, Timing, cast_sweep
from autodrive.specs import Spec
from autodrive.state import State


class LidarSpec(Spec):
    """A scanning range finder; by default the RPLIDAR A1 of the report.

    The rays cover one revolution, or `angle_min_deg` to `angle_max_deg`, or are `angle_increment_deg` apart. Ray 0 has
    the bearing `angle_min_deg`; 0 is straight ahead. The index increases to the left, or to the right if angle_max is
    below angle_min or the increment is negative.
    """

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
    intensity: float = Field(default=47.0, ge=0.0, le=1e6)
    """Constant value that is reported for every ray."""
    is_rolling: bool = False
    """False: all rays at one instant. True: each ray at its own time; the head makes one revolution per period."""
    noise: LidarNoise = LidarNoise()

    @model_validator(mode="after")
    def _fits(self) -> Self:
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


class Lidar(Sensor[LidarScan]):
    """Casts a whole scan at one instant."""

    def __init__(self, spec: LidarSpec) -> None:
        self._noise = None if spec.noise == LidarNoise() else LidarErrors(spec.noise)
        super().__init__(self._noise)
        self._spec = spec
        self._mount = spec.mount.position, spec.mount.orientation
        angles = spec.angle_min + spec.angle_increment * np.arange(spec.rays)
        self._directions = np.array([[turn(angle) for angle in angles.tolist()] for turn in (cos, sin)])
        self._inverse_range = np.zeros(spec.rays)
        self._constants = _constants(spec)
        # a fan is cast from right to left and reversed afterwards if the index increases to the right
        self._is_clockwise = spec.angle_increment < 0.0
        self._fan = np.ascontiguousarray(self._directions[:, ::-1]) if self._is_clockwise else self._directions
        self._cast_fan: Callable[..., None] | None = None
        self._fan_start, self._fan_increment = float(angles.min()), abs(spec.angle_increment)

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> LidarScan:
        """The scan at `time`."""
        self._cast(shapes, state, vehicle)
        if self._is_clockwise:
            self._inverse_range = self._inverse_range[::-1].copy()
        return self._scan(time)

    def _cast(self, shapes: Shapes, state: State, vehicle: int) -> None:
        arguments = (
            state.vehicle_position[vehicle],
            state.vehicle_orientation[vehicle],
            *self._mount,
            self._fan[0],
            self._fan[1],
            self._fan_start,
            self._fan_increment,
            self._spec.range_max,
            vehicle,
            shapes,
            state.shape_position,
            state.shape_rotation,
            np.empty(len(shapes.kind), np.int64),
            self._inverse_range,
        )
        if self._cast_fan is None:
            self._cast_fan = resolved(cast_fan, *arguments)
        self._cast_fan(*arguments)

    def _scan(self, time: float) -> LidarScan:
        """The scan of the inverse ranges, with noise."""
        spec = self._spec
        ranges = np.empty(spec.rays)
        if self._noise is None:
            measure(self._inverse_range, spec.range_min, spec.range_max, ranges)
        else:
            self._noise.measure(self._inverse_range, spec.range_min, spec.range_max, ranges)
        ranges.flags.writeable = False
        return LidarScan(time=time, ranges=ranges, **self._constants)


class RollingLidar(Lidar):
    """Casts each ray at its own time; `sample` must be called every tick. Poses are interpolated between ticks.

    The last ray of scan n is cast at n / rate, each earlier ray `time_increment` before the next. Scan 0 is complete at
    the start: the vehicle stood still before it, so all its rays are cast there.
    """

    def __init__(self, spec: LidarSpec) -> None:
        super().__init__(spec)
        self._time = 0.0
        self._before: PoseSnapshot | None = None
        self._scan_number = 1
        self._next_ray = 0
        self._timing = Timing(spec.rate, spec.time_increment)

    def reset(self, rng: np.random.Generator) -> None:
        """Delete the scans and draw the noise from `rng` from now on."""
        super().reset(rng)
        self._before = None
        self._scan_number, self._next_ray = 1, 0

    def sample(self, shapes: Shapes, state: State, vehicle: int, time: float) -> LidarScan:
        """The newest complete scan."""
        newest = self.latest or super().sample(shapes, state, vehicle, time)
        now = PoseSnapshot.of(state, vehicle)
        if self._before is None:  # the first scan starts with the next period
            self._scan_number = math.ceil(time * self._spec.rate - 1e-9) + 1
        while self._before is not None:
            self._next_ray = cast_sweep(
                *self._before,
                *now,
                *self._mount,
                self._directions[0],
                self._directions[1],
                self._timing,
                self._scan_number,
                self._next_ray,
                self._time,
                time,
                self._spec.range_max,
                vehicle,
                shapes,
                np.empty(len(shapes.kind), np.int64),
                self._inverse_range,
            )
            if self._next_ray < self._spec.rays:
                break
            newest = self._scan(self._scan_number / self._spec.rate)
            self._scan_number, self._next_ray = self._scan_number + 1, 0
        self._time, self._before = time, now
        return newest

    def save(self) -> Any:
        """The complete internal state, for `restore`."""
        progress = self._time, self._before, self._scan_number, self._next_ray, self._inverse_range.copy()
        return super().save(), progress

    def restore(self, saved: Any) -> None:
        """Set the state that `save` returned."""
        sensor, (self._time, self._before, self._scan_number, self._next_ray, inverse_range) = saved
        super().restore(sensor)
        self._inverse_range[:] = inverse_range


def _constants(spec: LidarSpec) -> dict[str, Any]:
    """The fields that are the same in every scan."""
    intensities = np.full(spec.rays, spec.intensity)
    intensities.flags.writeable = False
    return {
        "intensities": intensities,
        "angle_min": spec.angle_min,
        "angle_increment": spec.angle_increment,
        "range_min": spec.range_min,
        "range_max": spec.range_max,
        "scan_rate": spec.rate,
        "scan_time": 1.0 / spec.rate,
        "time_increment": spec.time_increment,
    }


@jit_uncounted
def measure(inverse_range: Floats, range_min: float, range_max: float, ranges: Floats) -> None:
    """The ranges that a sensor without noise reports."""
    for i in range(len(ranges)):
        ranges[i] = classify(1.0 / inverse_range[i], range_min, range_max)
